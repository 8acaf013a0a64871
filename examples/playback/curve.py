"""Reads playback.csv of `flexspline export --format csv`; the other scripts here import it."""

import math
import sys

ARCSEC = math.pi / 648_000


def arguments(*kinds, optional=0):
    """The curve of the file named first on the command line, and the words after it as numbers."""
    usage, words = sys.modules["__main__"].__doc__.splitlines()[0], sys.argv[1:]
    if not len(kinds) - optional < len(words) <= len(kinds) + 1:
        refuse(f"found {len(words)} arguments; allowed: {usage}")
    return Curve(words[0]), *(number(word, usage, kind) for word, kind in zip(words[1:], kinds))


def number(text, where, kind=float):
    """A finite number; `where` says in which line of a file or of arguments."""
    try:
        if math.isfinite(value := kind(text)):
            return value
    except ValueError:
        pass
    refuse(f"{where}: found {text!r}; allowed: a {'whole ' if kind is int else ''}number")


def refuse(message):
    """Ends the script with one line; 2 is the exit code of bad input."""
    print(f"error: {message}", file=sys.stderr)
    sys.exit(2)


class Curve:
    """Rows over the whole period of the output; corrections are added to the angle asked for."""

    def __init__(self, file):
        try:
            with open(file, encoding="utf-8") as text:
                lines = text.read().split("\n")
        except (OSError, UnicodeDecodeError) as error:
            refuse(f"{file}: {error}")
        if lines.pop():
            refuse(f"{file}:{len(lines) + 1}: the line was cut off; allowed: a whole file")
        above = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
        self.comments = [line.removeprefix("# ").strip() for line in lines[:above]]
        self.header = f"{file}:{above + 1}"
        said = {name: k for k, name in enumerate(line.split(" ")[0] for line in self.comments)}
        names = lines[above].split(",") if above < len(lines) else []
        columns = [name for name in ("forward_arcsec", "backward_arcsec") if name in names]
        if not {"ratio", "mean_error_arcsec"} <= said.keys() or names[:1] != ["output_rad"] or not columns:
            self.refuse("no playback; allowed: what `flexspline export --format csv` writes, whole")
        of = lambda name: number(self.comments[said[name]].split(" ")[-1], f"{file}:{said[name] + 1}")
        self.ratio, self.mean_rad = of("ratio"), of("mean_error_arcsec") * ARCSEC
        rows = []
        for line, text in enumerate(lines[above + 1 :], above + 2):
            cells = text.split(",")
            if len(cells) != len(names):
                refuse(f"{file}:{line}: found {len(cells)} cells; allowed: {len(names)}")
            rows.append([number(cell, f"{file}:{line}") for cell in cells])
        last, step = (rows[-1][0], rows[1][0]) if len(rows) > 1 else (0, 0)
        self.turns = round((last + step) / math.tau)  # output turns of a period
        whole = abs(self.ratio * self.turns - round(self.ratio * self.turns)) < 1e-6
        if self.turns < 1 or not whole or abs(last + step - self.turns * math.tau) > step / 2:
            what = f"the last angle is {last} rad, a step is {step}"
            refuse(f"{file}:{len(lines)}: {what}; allowed: rows over a whole period")
        self.step_rad = self.turns * math.tau / len(rows)
        for k, row in enumerate(rows):
            if abs(row[0] - k * self.step_rad) > self.step_rad / 2:
                due = f"{k * self.step_rad:.9f}, rows in even steps"
                refuse(f"{file}:{above + 2 + k}: found {row[0]} rad; allowed: {due}")
        self.sign = 1 if columns[0] == "forward_arcsec" else -1  # direction of the first column
        self.columns = [[row[names.index(name)] * ARCSEC for row in rows] for name in columns]
        self.both = [sum(values) / len(columns) for values in zip(*self.columns)]

    def refuse(self, message):
        """Refuses the columns or the rows, by the line of the names."""
        refuse(f"{self.header}: {message}")

    def at(self, values, output_rad):
        """Linear between the points of a column, around the period."""
        place, share = divmod(output_rad / self.step_rad, 1)
        low, high = (values[(int(place) + k) % len(values)] for k in (0, 1))
        return low + share * (high - low)
