"""Rows a second of the step on arrays, beside the same loop in Rust (examples/step_rows.rs): rates.py STEP_ROWS TABLE.fxt [ROWS]

The two take turns, so that both see the machine as it is; the best of each counts.
"""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import flexspline

TURNS = 9


def main(program: str, image: str, rows: int = 2_000_000) -> None:
    """Measures and prints."""
    table = flexspline.Table.open(image)
    random = np.random.default_rng(1)
    generator = np.cumsum(random.normal(0.01, 0.02, rows))
    torque, temperature = random.uniform(-150.0, 150.0, rows), random.uniform(-40.0, 60.0, rows)
    best = {"forward": [np.inf, np.inf], "inverse": [np.inf, np.inf]}
    said, asked = table.forward(generator, torque, temperature), table.inverse(generator / table.ratio, torque, temperature, direction=1)
    with tempfile.TemporaryDirectory() as folder:
        given, out = Path(folder) / "rows.f64", Path(folder) / "out.bin"
        np.column_stack([generator, torque, temperature]).astype("<f8").tofile(given)
        for _ in range(TURNS):
            told = subprocess.run([program, image, given, out], check=True, capture_output=True, text=True).stdout
            for name, found in best.items():
                match = re.search(rf"{name} ([0-9.]+) s", told)
                assert match is not None, told
                found[0] = min(found[0], float(match[1]))
            clock = time.perf_counter()
            table.forward(generator, torque, temperature, out=said)
            best["forward"][1] = min(best["forward"][1], time.perf_counter() - clock)
            clock = time.perf_counter()
            table.inverse(said.output_rad, torque, temperature, direction=1, out=asked)
            best["inverse"][1] = min(best["inverse"][1], time.perf_counter() - clock)
    for name, (rust_s, python_s) in best.items():
        rust, python = (rows / seconds / 1e6 for seconds in (rust_s, python_s))
        print(f"{name}: {rust:.2f} million rows a second in Rust, {python:.2f} from Python, ratio of times {python_s / rust_s:.3f}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:4]))
