#!/usr/bin/env python3
"""Bound of the stack below a function: stack_bound.py ELF ROOT

Adds the frames (-Zemit-stack-sizes) along every call. Functions without a record, as those of C, count with all that their
instructions take off the stack pointer. Refuses what would make the bound unsound: calls through a register, recursion,
a stack pointer that is moved by a register.
"""
import re
import subprocess
import sys


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def frames(elf):
    """Frame in bytes by function address: u32 address and ULEB128 size, one after another; none where no compiler wrote them."""
    if ".stack_sizes" not in run("arm-none-eabi-objdump", "-h", elf):
        return {}
    data = bytearray()
    for line in run("arm-none-eabi-objdump", "-s", "-j", ".stack_sizes", elf).splitlines():
        words = re.match(r" [0-9a-f]+ ((?:[0-9a-f]{2,8} ){1,4})", line)
        if words:
            data += bytes.fromhex(words.group(1).replace(" ", ""))
    found, at = {}, 0
    while at + 4 < len(data):
        address, size, shift = int.from_bytes(data[at : at + 4], "little") & ~1, 0, 0
        at += 4
        while True:
            byte = data[at]
            at += 1
            size |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                break
        found[address] = size
    return found


def calls(elf):
    """Name of each function by address, and the addresses that it calls or jumps to, with calls through registers as text."""
    names, out, taken, here = {}, {}, {}, None
    for line in run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", elf).splitlines():
        start = re.match(r"([0-9a-f]+) <(.+)>:", line)
        if start:
            here = int(start.group(1), 16)
            names[here], out[here], taken[here] = start.group(2), set(), 0
            continue
        code = re.match(r"\s+[0-9a-f]+:\s+(\S+)\s*(.*)", line)
        if not code or here is None:
            continue
        mnemonic, operands = code.groups()
        taken[here] = add_up(taken[here], mnemonic, operands)
        target = re.match(r"([0-9a-f]+) <([^+>]+)>", operands)
        if re.match(r"(blx?|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?)(\.[nw])?$", mnemonic):
            if target:
                out[here].add(int(target.group(1), 16) & ~1)
            elif mnemonic in ("bl", "blx"):
                out[here].add(f"{mnemonic} {operands}")
        elif mnemonic == "bx" and operands != "lr":
            out[here].add(f"bx {operands}")
    return names, out, taken


def add_up(taken, mnemonic, operands):
    """What an instruction takes off the stack pointer, added up; None if that is not a constant."""
    if taken is None:
        return None
    if mnemonic.startswith(("push", "vpush")) or (mnemonic.startswith("stmdb") and operands.startswith("sp!")):
        size = 8 if "d" in operands and mnemonic.startswith("vpush") else 4
        for part in re.search(r"{(.*)}", operands).group(1).split(","):
            ends = re.findall(r"\d+", part)
            taken += size * (int(ends[1]) - int(ends[0]) + 1 if len(ends) == 2 else 1)
    elif re.match(r"sub(\.w|w)?$", mnemonic) and operands.startswith("sp"):
        constant = re.search(r"#(\d+)", operands)
        return taken + int(constant.group(1)) if constant else None
    elif re.search(r"\[sp, #-(\d+)\]!", operands):
        taken += int(re.search(r"\[sp, #-(\d+)\]!", operands).group(1))
    return taken


def main():
    elf, root = sys.argv[1:]
    sizes, (names, out, taken) = frames(elf), calls(elf)
    roots = [address for address, name in names.items() if name == root]
    if not roots:
        sys.exit(f"stack_bound: no function {root} in {elf}")
    known = {}

    def bound(address, above):
        name = names.get(address, hex(address))
        if address in above:
            sys.exit(f"stack_bound: {name} calls itself")
        if address not in known:
            frame = sizes.get(address, taken.get(address))
            if frame is None:
                sys.exit(f"stack_bound: {name} has no known frame")
            deepest = 0
            for callee in out[address]:
                if isinstance(callee, str):
                    sys.exit(f"stack_bound: {name} calls through a register: {callee}")
                if callee != address and callee in names:
                    deepest = max(deepest, bound(callee, above | {address}))
            known[address] = frame + deepest
        return known[address]

    print(bound(roots[0], frozenset()))


main()
