#!/usr/bin/env python3
"""The pictures of the examples, by headless Chromium; nothing but Python's own library.

  picture.py page  REPORT.html[#ID] OUT.png [WIDTHxHEIGHT]   a report, from the top or from a part of it
  picture.py curve FILE.csv X Y[,Y...] OUT.png               columns of a CSV file as lines
  picture.py columns FILE.csv OUT.png                        all of them, over the first

Those of the pages, from the top of the project, after the commands of each page:

  examples/picture.py curve out/antenna_c.csv time_ms error_mas,missed_mas examples/antenna_c/antenna.png
  examples/picture.py curve out/antenna.csv time_ms error_mas,missed_mas examples/antenna_rust/antenna.png
  examples/picture.py page out/csf17/report.html examples/csf17_100/report.png 1000x1300
  examples/picture.py page out/lara8/report.html examples/lara8/report.png 1000x1300
  examples/picture.py curve out/learning_c.csv second missed_arcsec_rms,offset_arcsec examples/learning_c/learning.png
  examples/picture.py curve out/sweep/replay.csv torque_n_m measured_arcsec,predicted_arcsec examples/other_program/sweep.png
  examples/picture.py page out/own/report.html examples/own_drive/report.png 900x1000
"""

import csv
import html
import math
import pathlib
import subprocess
import sys
import tempfile

COLOURS = ["#1f5fa8", "#c2571a", "#3a7d44", "#7a4fa3"]


def photograph(address, out, size):
    width, height = (int(number) for number in size.split("x"))
    subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--force-device-scale-factor=0.8",
         "--virtual-time-budget=5000", f"--window-size={width},{height}", f"--screenshot={out}", address],
        check=True, stderr=subprocess.DEVNULL)  # fmt: skip


def steps(low, high):
    """Round numbers from low to high, about six."""
    rough = (high - low) / 6
    power = 10 ** math.floor(math.log10(rough))
    step = next(f * power for f in (1, 2, 5, 10) if f * power >= rough)
    first = math.ceil(low / step)
    return [k * step for k in range(first, math.floor(high / step) + 1)]


def drawing(xs, curves, x_name):
    width, height, left, bottom, top = 880, 380, 90, 50, 30
    values = [value for _, ys in curves for value in ys]
    low, high, first, last = min(values), max(values), min(xs), max(xs)
    margin = 0.05 * (high - low or 1)
    low, high = low - margin, high + margin
    x_of = lambda x: left + (x - first) / (last - first) * (width - left - 20)
    y_of = lambda y: top + (high - y) / (high - low) * (height - top - bottom)
    parts = []
    for y in steps(low, high):
        parts.append(f'<path d="M{left} {y_of(y):.1f}H{width - 20}" stroke="#ddd"/>')
        parts.append(f'<text x="{left - 8}" y="{y_of(y) + 4:.1f}" text-anchor="end">{y:g}</text>')
    for x in steps(first, last):
        parts.append(f'<text x="{x_of(x):.1f}" y="{height - bottom + 20}" text-anchor="middle">{x:g}</text>')
    parts.append(f'<text x="{width / 2}" y="{height - 8}" text-anchor="middle">{html.escape(x_name)}</text>')
    for (name, ys), colour, place in zip(curves, COLOURS, range(9)):
        points = " ".join(f"{x_of(x):.1f},{y_of(y):.1f}" for x, y in zip(xs, ys))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        # A name is some seven pixels a letter wide, and has 220 at least.
        before = sum(max(220, 7 * len(other) + 20) for other, _ in curves[:place])
        parts.append(f'<text x="{left + 10 + before}" y="20" fill="{colour}">{html.escape(name)}</text>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'style="font:14px sans-serif">{"".join(parts)}</svg>')  # fmt: skip


def main(kind, file, *rest):
    if kind == "page":
        out, size = rest[0], rest[1] if len(rest) > 1 else "1000x1000"
        path, _, part = file.partition("#")
        photograph(pathlib.Path(path).resolve().as_uri() + (f"#{part}" if part else ""), out, size)
        return
    with open(file, newline="") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    if kind == "columns":
        (x_name, *y_names), out = list(rows[0]), rest[0]
    else:
        x_name, y_names, out = rest[0], rest[1].split(","), rest[2]
    xs = [float(row[x_name]) for row in rows]
    curves = [(name, [float(row[name]) for row in rows]) for name in y_names]
    with tempfile.TemporaryDirectory() as folder:
        page = pathlib.Path(folder, "curve.html")
        page.write_text(f"<!doctype html><meta charset=utf-8><body style='margin:8px'>{drawing(xs, curves, x_name)}")
        photograph(page.as_uri(), out, "900x400")


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
