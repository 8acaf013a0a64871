#!/usr/bin/env python3
"""MC/DC of the reader in C99: what is missed is what a list says.

conditions.py SOURCE SHOWN LIST: SHOWN is what llvm-cov show -show-mcdc says of SOURCE; LIST has a row for each condition that no test shows to
matter: function, condition, why. 0 if the conditions missed are those of the list.
"""
import re
import sys


def function_at(lines, number):
    """Name of the function that a line, from 1, is in."""
    for line in reversed(lines[:number]):
        if found := re.match(r"[a-z][\w *]*?\b(\w+)\(.*", line):
            return found[1]
    return ""


def main():
    """See above."""
    source, shown, listed = (open(path, encoding="utf-8").read() for path in sys.argv[1:])
    lines = source.split("\n")
    missed, conditions = [], 0
    for region in shown.split("---> MC/DC Decision Region ")[1:]:
        places = re.findall(r"Condition C\d+ --> \((\d+):(\d+)\)", region)
        # Of a condition no pair is shown, or it is of a constant.
        for place, covered in zip(places, re.findall(r"C\d+-Pair: (not covered|covered|constant)", region), strict=True):
            row, column = map(int, place)
            conditions += 1
            if covered == "not covered":
                text = re.split(r" && | \|\| |;|\)$", lines[row - 1][column - 1 :])[0].strip()
                missed.append((function_at(lines, row), text))
    rows = re.findall(r"^\| `(\w+)` \| `([^`]+)` \| \S", listed, re.MULTILINE)
    print(f"MC/DC: {conditions - len(missed)} of {conditions} conditions")
    for name, text in missed:
        print(f"  missed in {name}: {text}", "(in the list)" if (name, text) in rows else "")
    for name, text in rows:
        if (name, text) not in missed:
            print(f"  not missed any more: {name}: {text}")
    return sorted(missed) != sorted(rows) or conditions < 150


if __name__ == "__main__":
    sys.exit(main())
