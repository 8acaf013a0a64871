#!/usr/bin/env python3
"""Double precision in an object of the reader for a processor whose floating-point unit has single precision alone.

double_precision.py OBJECT START_UP...: 0 if of the functions of the interface those named, and no other, reach a call of
double-precision arithmetic, or an instruction of it. The object is compiled with -ffunction-sections, so that each call of a
function in it is a relocation. Prints how many calls each function has.
"""
import collections
import re
import subprocess
import sys


def read(path):
    """Calls of each function: names, in order."""
    text = subprocess.run(["arm-none-eabi-objdump", "-dr", path], check=True, capture_output=True, text=True).stdout
    calls, function = collections.defaultdict(list), None
    for line in text.splitlines():
        if found := re.match(r"[0-9a-f]+ <(\w+)>:$", line):
            function = found[1]
            calls[function] += []
        elif found := re.search(r"R_ARM_(?:THM_)?(?:CALL|JUMP24|ABS32|MOVW_ABS_NC)\s+(\w+)", line):
            calls[function].append(found[1])
        elif re.search(r"\tv\w+\S*\.f64", line):
            calls[function].append("__aeabi_d_instruction")
    return calls


def is_double(name):
    """Whether a helper of the compiler takes or gives a double."""
    return re.fullmatch(r"__aeabi_(d\w+|\w+2d)", name) is not None


def reached(calls, function):
    """Helpers that a function may come to."""
    seen, left = set(), [function]
    while left:
        name = left.pop()
        if name not in seen:
            seen.add(name)
            left += calls.get(name, [])
    return {name for name in seen if is_double(name)}


def main():
    """See above."""
    path, *start_up = sys.argv[1:]
    calls = read(path)
    interface = [name for name in calls if name.startswith("fxt_")]
    sites = {name: sum(map(is_double, found)) for name, found in calls.items() if any(map(is_double, found))}
    print(f"{sum(sites.values())} calls of double precision:", ", ".join(f"{name} {count}" for name, count in sorted(sites.items())))
    found = sorted(name for name in interface if reached(calls, name))
    print("reached by", ", ".join(found), "of", len(interface))
    return found != sorted(start_up) or len(interface) < 20


if __name__ == "__main__":
    sys.exit(main())
