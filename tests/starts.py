#!/usr/bin/env python3
"""Logs of one joint between starts of its motor's encoder, which counts from wherever it is switched on; the output is absolute.

  starts.py FOLDER SEED

  joint:  ratio 100, two waves of 20 arcsec a motor turn, one of 6 a turn; 60 and 15 arcsec once and twice an output turn
          a spring of 1.5 arcsec/N.m that hardens, a lag of 4 arcsec; Maxwell slip of 10 arcsec; noise of 1.5 arcsec
  logs:   a 0, b .381, c .617 of a motor turn; turn: as c, its output a turn on; other: of another joint; later: as a
"""

import math
import random
import sys
from pathlib import Path

ARCSEC = math.pi / 648000.0
RATIO = 100.0
ROWS = 5000
RATED = 40.0
# Torque at which a spring slips, N·m, and arcsec that it holds back.
SLIPS = [(3.0, 1.0), (8.0, 2.0), (20.0, 2.0)]


def joint(psi: float, output: float, torque: float, way: float) -> float:
    """Error, arcsec."""
    waves = 20.0 * math.cos(2.0 * psi + 0.4) + 6.0 * math.sin(psi - 1.1)
    wheel = 60.0 * math.cos(output - 0.7) + 15.0 * math.sin(2.0 * output)
    return waves + wheel + 3.0 * torque - 1e-4 * torque**3 - 4.0 * way


def other(psi: float, output: float, torque: float, way: float) -> float:
    """Another joint."""
    return 45.0 * math.sin(3.0 * psi) + 3.0 * torque - 4.0 * way


def log(path: Path, chance: random.Random, start: float, output_turns: float, law) -> None:
    """One log: the motor goes 1.2 output turns there and back from anywhere, and reads `start` of a turn where it is."""
    # Switched on wherever it stands.
    begin = chance.uniform(0.0, 0.2) * 2.0 * math.pi * RATIO
    swing, phase = chance.uniform(25.0, 45.0), chance.uniform(0.0, 6.0)
    stops = [0.0] * len(SLIPS)
    torque = before = 0.0
    with path.open("w") as file:
        file.write("time_s,generator_rad,output_rad,torque_n_m\n")
        for k in range(ROWS):
            forward = k < ROWS // 2
            psi = begin + 2.4 * 2.0 * math.pi * RATIO / ROWS * (k if forward else ROWS - 1 - k)
            torque = RATED * (0.75 * math.sin(k / swing + phase) + 0.25 * math.sin(k / 7.1))
            stops = [max(-at, min(at, stop + torque - before)) for stop, (at, _) in zip(stops, SLIPS)]
            before = torque
            held = sum(size * stop / at for stop, (at, size) in zip(stops, SLIPS))
            error = law(psi, psi / RATIO, torque, 1.0 if forward else -1.0) - held + chance.gauss(0.0, 1.5)
            output = psi / RATIO + error * ARCSEC + 2.0 * math.pi * output_turns
            counts = round(output / (2.0 * math.pi) * 2**24) / 2**24
            reads = psi + start * 2.0 * math.pi
            file.write(f"{0.01 * k:.3f},{reads:.9f},{2.0 * math.pi * counts:.10f},{torque + chance.gauss(0.0, 0.02):.4f}\n")


def main() -> None:
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    chance = random.Random(seed)
    for name, start, turns, law in [
        ("a", 0.0, 0.0, joint),
        ("b", 0.381, 0.0, joint),
        ("c", 0.617, 0.0, joint),
        ("turn", 0.617, 1.0, joint),
        ("other", 0.2, 0.37, other),
        ("later", 0.0, 0.0, joint),
    ]:
        log(folder / f"{name}.csv", chance, start, turns, law)


main()
