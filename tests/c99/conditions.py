#!/usr/bin/env python3
"""MC/DC and branches of the reader in C99: what no test shows is what a list says.

conditions.py SOURCE SHOWN LIST: SHOWN is what llvm-cov show -show-mcdc -show-branches=count says of SOURCE; LIST has a row for each condition
that no test shows to matter (function, condition, why) and for each branch that no test takes (function, condition, is, why), and says of how
many. 0 if what is missed is in the list and nothing else is, of no fewer conditions and branches.
"""
import os
import re
import sys


def function_at(lines, number):
    """Name of the function that a line, from 1, is in."""
    for line in reversed(lines[:number]):
        if found := re.match(r"[a-z][\w *]*?\b(\w+)\(.*", line):
            return found[1]
    return ""


def condition_at(lines, place):
    """Function and text of the condition that begins at a row and a column, both from 1."""
    row, column = map(int, place)
    text, depth = lines[row - 1][column - 1 :], 0
    for end, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth < 0 or letter == ";" or depth == 0 and text[end:].startswith((" && ", " || ", " ? ")):
            text = text[:end]
            break
    return function_at(lines, row), text.strip()


def missed_conditions(lines, shown):
    """Number of conditions joined by && or ||, and those of which no pair of tests shows that they matter."""
    found = []
    for region in shown.split("---> MC/DC Decision Region ")[1:]:
        places = re.findall(r"Condition C\d+ --> \((\d+):(\d+)\)", region)
        # Of a condition no pair is shown, or it is of a constant.
        found += zip(places, re.findall(r"C\d+-Pair: (not covered|covered|constant)", region), strict=True)
    return len(found), [condition_at(lines, place) for place, covered in found if covered == "not covered"]


def missed_branches(lines, shown):
    """Number of branches, two for each condition of if, for, while, ?:, && and ||, and those not taken."""
    found = re.findall(r"Branch \((\d+):(\d+)\): \[True: ([\d.]+)\w?, False: ([\d.]+)\w?\]", shown)
    missed = [(*condition_at(lines, of[:2]), side) for of in found for side, count in zip(("true", "false"), of[2:]) if count == "0"]
    return 2 * len(found), missed


def main():
    """See above."""
    source, shown, listed = (open(path, encoding="utf-8").read() for path in sys.argv[1:])
    lines, wrong = source.split("\n"), False
    rows = re.findall(r"^\| `(\w+)` \| `([^`]+)` \| (?:(true|false) \| )?(\S.*)", listed, re.MULTILINE)
    is_long = os.environ.get("FLEXSPLINE_FORM") == "long"
    for what, (number, missed) in {"conditions": missed_conditions(lines, shown), "branches": missed_branches(lines, shown)}.items():
        listed_of = [(tuple(row if what == "branches" else row[:2]), why) for *row, why in rows if bool(row[2]) == (what == "branches")]
        # A row whose reason names the long form may be taken there.
        allowed = [of for of, why in listed_of if of in missed or not (is_long and "long form" in why)]
        least = int(re.search(rf"(\d+)\s{what}", listed)[1])
        print(f"{what}: {number - len(missed)} of {number}, at least of {least}")
        for of in missed:
            print("  missed in", *of, "(in the list)" if of in allowed else "")
        for of in allowed:
            if of not in missed:
                print("  not missed any more:", *of)
        wrong |= sorted(missed) != sorted(allowed) or number < least
    return wrong


if __name__ == "__main__":
    sys.exit(main())
