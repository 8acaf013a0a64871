"""Reads playback.csv of `flexspline export --format csv`; the other scripts here import it."""

import csv
import math
import sys

ARCSEC = math.pi / 648_000


class Curve:
    """Rows over the whole period of the output; corrections are added to the angle asked for."""

    def __init__(self, file):
        with open(file, encoding="utf-8") as lines:
            comments, rows = [], []
            for line in lines:
                (comments if line.startswith("#") else rows).append(line.removeprefix("# "))
        rows = list(csv.DictReader(rows))
        words = [line.split() for line in comments]
        self.ratio = next(float(w[1]) for w in words if w[0] == "ratio")
        self.mean_rad = next(float(w[1]) for w in words if w[0] == "mean_error_arcsec") * ARCSEC
        self.comments = [line.strip() for line in comments]
        self.step_rad = float(rows[1]["output_rad"])
        self.turns = round(len(rows) * self.step_rad / math.tau)  # output turns of a period
        self.step_rad = self.turns * math.tau / len(rows)
        names = [name for name in ("forward_arcsec", "backward_arcsec") if name in rows[0]]
        self.sign = 1 if names[0] == "forward_arcsec" else -1  # direction of the first column
        self.columns = [[float(row[name]) * ARCSEC for row in rows] for name in names]
        self.both = [sum(values) / len(names) for values in zip(*self.columns)]

    def at(self, values, output_rad):
        """Linear between the points of a column, around the period."""
        place, share = divmod(output_rad / self.step_rad, 1)
        low, high = (values[(int(place) + k) % len(values)] for k in (0, 1))
        return low + share * (high - low)


def refuse(message):
    sys.exit(f"error: {message}")
