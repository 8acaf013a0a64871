"""What the command does, as functions: simulate, tables, look, synthesize, calibrate, diagnose."""

from __future__ import annotations

import csv
import json
import os
import secrets
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._columns import Columns, FloatArray
from ._drive import Drive, drive_of
from ._errors import BadInput
from ._fields import Fields, rows_html
from ._inputs import PathLike, columns_option, log, names, numbers, path_text, spread, table_columns
from ._progress import Progress, shown
from ._table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GENERATORS = ("two-roller", "four-roller", "double-disc", "cam")
"""The wave generators by name."""

Mesh = Literal["coarse", "standard", "fine"]
Solver = Literal["fast", "reference"]


class Simulation(Columns):
    """A run along a path: a row for each increment, the columns of ``results.csv``; and ``summary``."""

    step: NDArray[np.int64]
    generator_rad: FloatArray
    """Generator angle, rad."""
    output_rad: FloatArray
    """Output angle, rad."""
    error_arcsec: FloatArray
    """Output angle less generator over ratio, arcsec; positive when the output leads."""
    torque_n_m: FloatArray
    """Load, N·m; positive turns the output forward."""
    flank_contacts: NDArray[np.int64]
    generator_contacts: NDArray[np.int64]
    max_von_mises_mpa: FloatArray
    """Largest von Mises stress of both wheels, MPa."""
    iterations: NDArray[np.int64]
    temperature_c: FloatArray
    settled: NDArray[np.bool_]
    """Whether start-up is over since the last reversal or change of load."""
    summary: Fields
    """``summary.json``: backlash_arcsec, kinematic_error_pp_arcsec, wind_up_arcsec, max_von_mises_mpa and others."""

    def __init__(self, columns: Mapping[str, Any], summary: Fields) -> None:
        super().__init__(columns)
        self.summary = summary

    def plot(self, ax: Axes | None = None) -> Axes:
        """The error (arcsec) over the generator angle (rad); needs matplotlib."""
        from . import _plots

        return _plots.simulation(self, ax)

    def __repr__(self) -> str:
        return f"Simulation({self.rows} rows, {self.summary.drive}, {self.summary.generator}, path {self.summary.path})"

    def _repr_html_(self) -> str:
        told = {name: value for name, value in self.summary.json.items() if value is not None}
        return rows_html(told, f"{self.rows} rows") + super()._repr_html_()


def simulate(
    drive: Drive | PathLike,
    generator: str,
    *,
    path: str | PathLike | object = "paper",
    torque_n_m: float | None = None,
    temperature_c: float | None = None,
    increment_rad: float | None = None,
    direction: Literal[1, -1] | None = None,
    mesh: Mesh = "standard",
    solver: Solver = "fast",
    threads: int | None = None,
    progress: Progress = None,
) -> Simulation:
    """Contact FEM of a drive along a path of its generator: ``flexspline simulate``.

    ``path`` is ``paper`` (+1 rad, then -2 rad), ``pitch`` (settled, then one tooth pitch), ``turn`` (settled, then a turn), the path of a CSV,
    or a table of columns (dict, DataFrame) with ``generator_rad`` and where wanted ``torque_n_m`` and ``temperature_c``.
    Load N·m at the output (default 0), positive turns it forward; temperature °C (default: the drive's reference).
    ``direction`` +1 or -1 is that of ``pitch`` and ``turn``. Raises `BadInput`, or `NotConverged`.

    >>> simulate("HHD-95", "cam", path="pitch", torque_n_m=50, mesh="coarse").summary.wind_up_arcsec > 0
    True
    """
    name, points = "points", None
    if isinstance(path, (str, os.PathLike)):
        name = os.fspath(path)
    else:
        points = _points(path)
    with shown(progress, "simulate") as tell:
        columns, summary = _native.simulate(
            drive_of(drive)._inner,
            generator,
            name,
            points,
            increment_rad=increment_rad,
            direction=direction,
            torque_n_m=torque_n_m,
            temperature_c=temperature_c,
            mesh=mesh,
            solver=solver,
            threads=threads,
            progress=tell,
        )
    return Simulation(columns, Fields(summary))


def _points(path: object) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
    columns = table_columns(path)
    if "generator_rad" not in columns:
        raise BadInput(f"path: found columns {', '.join(columns)}, required: generator_rad; allowed too: torque_n_m, temperature_c")
    generator = numbers("path.generator_rad", columns["generator_rad"])

    def beside(name: str) -> FloatArray | None:
        if name not in columns:
            return None
        column = spread(numbers(f"path.{name}", columns[name]), generator.size)
        if column.size != generator.size:
            raise BadInput(f"path.{name}: found {column.size} values, allowed: {generator.size}, as of generator_rad")
        return column

    return generator, beside("torque_n_m"), beside("temperature_c")


def tables(
    drive: Drive | PathLike = "HHD-95",
    generators: str | Sequence[str] = GENERATORS,
    *,
    torque_n_m: float | None = None,
    most_nodes: int | None = None,
    node_tolerance_arcsec: float | None = None,
    positions: int = 8,
    temperatures_c: Sequence[float] | None = None,
    mesh: Mesh = "standard",
    solver: Solver = "fast",
    threads: int | None = None,
    progress: Progress = None,
) -> dict[str, Table]:
    """Compensation tables by contact FEM, one for each generator: ``flexspline tables``.

    ``torque_n_m`` is the largest load (default: the generator's rated torque, by the size of the drive), ``most_nodes`` the torque nodes either
    side of zero at most, ``node_tolerance_arcsec`` the miss at which one is added, ``positions`` the samples over a tooth pitch (4 to 32),
    ``temperatures_c`` the temperature nodes (default: the ends of the operating range).

    >>> tables("HHD-95", "cam", mesh="coarse")["cam"].save("out")  # doctest: +SKIP
    """
    with shown(progress, "tables") as tell:
        made = _native.tables(
            drive_of(drive)._inner,
            names("generators", generators),
            torque_n_m=torque_n_m,
            most_nodes=most_nodes,
            node_tolerance_arcsec=node_tolerance_arcsec,
            positions=positions,
            temperatures_c=None if temperatures_c is None else numbers("temperatures_c", temperatures_c).tolist(),
            mesh=mesh,
            solver=solver,
            threads=threads,
            progress=tell,
        )
    return {parts[0]: Table._made(parts) for parts in made}


def table_from_samples(
    samples: PathLike,
    drive: Drive | PathLike = "HHD-95",
    generator: str = "cam",
    *,
    half_width_arcsec: float | None = None,
    deviation_arcsec: float | None = None,
) -> Table:
    """The table of samples from another program or a bench: ``flexspline tables --from-samples``.

    A CSV with ``generator_rad, torque_n_m, temperature_c, direction`` (1 or -1) and ``output_rad``. ``half_width_arcsec`` is that of the play
    where there is one direction only, ``deviation_arcsec`` how far a sample may lie from the table (default 20).
    """
    parts = _native.project(
        drive_of(drive)._inner,
        generator,
        path_text("samples", samples),
        half_width_arcsec=half_width_arcsec,
        deviation_arcsec=deviation_arcsec,
    )
    return Table._made(parts)


class Look(Fields):
    """What is in logs: the fields of ``flexspline look --json``; as text, what that command prints."""

    columns_option: str | None
    """What to pass on as ``columns``; None where it is not clear."""
    ratio_proposed: float | None
    """The ratio that the rows speak for."""

    def __init__(self, text: str, printed: str) -> None:
        super().__init__(text)
        self._printed = printed

    def __repr__(self) -> str:
        return self._printed


def look(logs: object) -> Look:
    """Columns, units, ratio, torque, time and coverage of logs, and the mapping to read them with: ``flexspline look``.

    ``logs``: one log or a list of them, each a path or a table of columns, as for `calibrate`.

    >>> look("bench.csv").columns_option  # doctest: +SKIP
    """
    return Look(*_native.look(_logs(logs)))


def _logs(logs: object) -> list[str | tuple[str, bytes]]:
    several = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    if not several:
        raise BadInput("logs: found none, allowed: one or more")
    return [log(one, f"data {k}" if len(several) > 1 else "data") for k, one in enumerate(several, 1)]


class Synthesized(Columns):
    """Made-up measurements: the columns of ``data.csv``, which `calibrate` and `diagnose` take; and ``effects``."""

    effects: list[Fields]
    """What was hidden, with all values, as in ``truth.json``."""

    def __init__(self, columns: Mapping[str, Any], effects: list[Fields]) -> None:
        super().__init__(columns)
        self.effects = effects


def synthesize(
    effects: str | Sequence[str] = (),
    *,
    model: PathLike | None = None,
    table: Table | PathLike | bytes | None = None,
    drive: Drive | PathLike = "HHD-95",
    sessions: int = 6,
    rows: int = 3000,
    speed_rad_s: float = 6.0,
    torque_n_m: float = 40.0,
    temperatures_c: tuple[float, float] = (-20.0, 50.0),
    noise_arcsec: float = 2.0,
    wander_arcsec: float = 0.8,
    spread: bool = True,
    seed: int | None = None,
) -> Synthesized:
    """Measurements of a drive with effects of your choice, to try `diagnose` on: ``flexspline synthesize``, with its defaults.

    ``effects`` as the command takes them (``gravity_torque:torque_n_m=3``; ``flexspline synthesize --list`` has all). The drive is a
    ``model`` (a nominal.toml) or a ``table`` of ``drive``; with ``spread`` its unit is drawn. The same ``seed`` gives the same rows.

    >>> synthesize("flexspline_runout", model="nominal.toml", seed=1).rows  # doctest: +SKIP
    """
    allowed = {
        "sessions": (sessions, 1, 100),
        "rows": (rows, 50, 1_000_000),
        "speed_rad_s": (speed_rad_s, 1e-3, 1e3),
        "torque_n_m": (torque_n_m, 1e-3, 1e5),
        "noise_arcsec": (noise_arcsec, 0, 1e5),
        "wander_arcsec": (wander_arcsec, 0, 1e5),
        "temperatures_c": (temperatures_c[0], -200, temperatures_c[1]),
        "temperatures_c[1]": (temperatures_c[1], temperatures_c[0], 300),
    }
    for name, (value, least, most) in allowed.items():
        if not least <= value <= most:
            raise BadInput(f"{name}: found {value}, allowed: {least} to {most}")
    text, hidden = _native.synthesize(
        _known(None, model, table),
        drive_of(drive)._inner,
        [effects] if isinstance(effects, str) else list(effects),
        (sessions, rows, speed_rad_s, torque_n_m),
        (temperatures_c[0], temperatures_c[1]),
        (noise_arcsec, wander_arcsec),
        spread,
        secrets.randbits(32) if seed is None else seed,
    )
    names_of, *lines = csv.reader(text.splitlines())
    columns = np.array([[float(cell) if cell else np.nan for cell in line] for line in lines]).T
    return Synthesized(dict(zip(names_of, columns, strict=True)), [Fields(one) for one in json.loads(hidden)])


class Calibration(Fields):
    """A unit's table from its logs: the fields of ``calibration.json``, ``table``, and ``shown``."""

    held_out: Fields
    """rms_before_arcsec, rms_prior_arcsec, rms_after_arcsec, held out."""
    parts: list[Fields]
    """What was fitted: name, kept, held_out_gain, size_arcsec, why."""
    half_width_arcsec: float
    """Half-width of the 95 % interval of the error with the table, arcsec."""
    data_faults: list[Fields]
    notes: list[str]
    table: Table
    """The table."""
    shown: Columns
    """Rows for a picture: output_rad, measured_arcsec, left_arcsec."""

    def __init__(self, text: str, table: Table, shown_rows: Columns) -> None:
        super().__init__(text)
        self.table, self.shown = table, shown_rows

    def save(self, folder: PathLike) -> list[Path]:
        """Writes ``calibrated.fxt``, .json, .rs, .h and ``calibration.json`` into a folder; gives what was written."""
        written = self.table._save_as(Path(folder), "calibrated")
        target = Path(folder) / "calibration.json"
        target.write_text(self.to_json() + "\n", encoding="utf-8")
        return [*written, target]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Error as measured and as left (arcsec) over the output angle (deg); needs matplotlib."""
        from . import _plots

        return _plots.calibration(self, ax)

    def __repr__(self) -> str:
        held = self.held_out
        left = f"{held.rms_before_arcsec:.3g} -> {held.rms_after_arcsec:.3g} arcsec rms held out"
        return f"Calibration({left}, held to +-{self.half_width_arcsec:.3g}, table {self.table.table_id})"


def calibrate(
    logs: object,
    *,
    ratio: float | None = None,
    model: PathLike | None = None,
    table: Table | PathLike | bytes | None = None,
    generator: str = "cam",
    columns: str | Mapping[str, str] = "",
    rate_hz: float | None = None,
    torque_constant: float | None = None,
    split: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Calibration:
    """Logs of one unit to its table: ``flexspline calibrate``.

    ``logs``: one log or a list, each a path or a table of columns (DataFrame, Arrow table, dict of arrays). What is known before is one of
    ``ratio`` (negative where generator and output turn opposite ways), ``model`` (the path of a nominal.toml) and ``table``.
    Columns are ``time_s, generator_rad, output_rad`` or ``error_arcsec, torque_n_m, temperature_c`` unless ``columns`` maps them, as
    ``{"generator": "wave_gen_turns:turn"}``; ``rate_hz`` where there is no time; ``torque_constant`` N·m for an ampere.
    With ``split`` its `split` says what the encoders and the gear have of the error.
    Raises `BadInput`, or `NothingGained` where no table is better than none.

    >>> calibrate("bench.csv", ratio=101).save("unit7")  # doctest: +SKIP
    """
    with shown(progress, "calibrate") as tell:
        text, parts, rows = _native.calibrate(
            _logs(logs),
            _known(ratio, model, table),
            generator,
            (columns_option(columns), rate_hz, torque_constant),
            split,
            threads=threads,
            progress=tell,
        )
    made = Calibration(text, Table._made(parts), Columns(rows))
    if made.half_width_arcsec > made.held_out.rms_before_arcsec:
        one_load = "load_with_output_angle" in made
        narrower = "the load went with the output's angle: rows under other loads" if one_load else "more or calmer rows"
        warnings.warn(
            f"calibrate: error with the table +-{made.half_width_arcsec:.3g} arcsec (95 % interval), where {made.held_out.rms_before_arcsec:.3g} rms "
            f"were measured; {narrower} make it narrower",
            stacklevel=2,
        )
    return made


_OPTIONS = ("ratio", "model", "table", "generator", "columns", "rate_hz", "torque_constant", "split", "threads", "progress")
"""What `calibrate` takes beside the logs."""


class Calibrator:
    """`calibrate` and `Table.forward` as an estimator of scikit-learn, which need not be installed: clone, pipelines and cross_val_score take it.

    Rows are one motion in their order: a cross validation has to leave out blocks (``KFold(3)``), not shuffled rows.

    >>> Calibrator(ratio=101).fit(monday).score(tuesday)  # doctest: +SKIP
    """

    calibration_: Calibration
    """What `fit` found."""

    def __init__(self, **options: Any) -> None:
        """``options``: those of `calibrate`, as ``ratio``, ``model`` or ``table``."""
        self.options: dict[str, Any] = {}
        self.set_params(**options)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The options that were given; ``deep`` changes nothing, as none is an estimator."""
        return dict(self.options)

    def set_params(self, **options: Any) -> Calibrator:
        """Gives options another value; holds from the next `fit` on."""
        for name in options:
            if name not in _OPTIONS:
                raise BadInput(f"Calibrator: found {name}, allowed: {', '.join(_OPTIONS)}")
        self.options = {**self.options, **options}
        return self

    def fit(self, logs: object, y: object = None) -> Calibrator:
        """Learns the table of a unit from its logs, as `calibrate` takes them; ``y`` is not read, as the error stands in the logs."""
        self.calibration_ = calibrate(logs, **self.options)
        return self

    def predict(self, data: object) -> FloatArray:
        """The output error that the table expects for each row, arcsec, rows in the order of one motion: of a table of columns with
        ``generator_rad``, and where known ``torque_n_m`` and ``temperature_c``. No measured error is needed, and none is read."""
        columns = table_columns(data)
        if "generator_rad" not in columns:
            raise BadInput(f"data: found columns {', '.join(columns)}, required: generator_rad; allowed too: torque_n_m, temperature_c")
        load, temperature = columns.get("torque_n_m", 0.0), columns.get("temperature_c", 20.0)
        return self._table().forward(columns["generator_rad"], load, temperature).error_arcsec

    def score(self, data: object, y: object = None) -> float:
        """Share of the variance of the measured error that the table takes away: 1 is all of it, below 0 is worse than no table.
        ``data`` is what `Table.replay` takes; ``y`` is not read.

        A variance, as the zero of an output encoder is no table's to know."""
        rows = self._table().replay(data)
        measured = np.var(rows.measured_arcsec)
        if measured == 0.0:
            raise BadInput("data: found the same error in every row, allowed: errors that differ, as the score is a share of their variance")
        return float(1.0 - np.var(rows.residual_arcsec) / measured)

    def _table(self) -> Table:
        if not hasattr(self, "calibration_"):
            raise BadInput("Calibrator: not fitted yet, allowed: fit(logs) first")
        return self.calibration_.table

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "calibration_")

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import RegressorTags, Tags, TargetTags

        return Tags(estimator_type="regressor", target_tags=TargetTags(required=False), regressor_tags=RegressorTags())

    def __repr__(self) -> str:
        options = ", ".join(f"{name}={value!r}" for name, value in self.options.items())
        return f"Calibrator({options})" + (f" of {self.calibration_!r}" if hasattr(self, "calibration_") else "")


class Diagnosis(Fields):
    """A verdict on measured rows: the fields of ``diagnosis.json``, ``rows``, and what was made of the causes."""

    verdict: str
    """``none``, ``explained``, ``partly_explained`` or ``unknown``."""
    finding: str
    """``fault_found``, ``nothing_found``, ``not_understood`` or ``data_unusable``."""
    table: Fields
    """Which table was made, and why: kind (``extended``, ``calibrated`` or ``none``), file, rms_left_out_arcsec, why."""
    hints: list[Fields]
    """Causes that gain too little to be named: name, gain, why_not_a_cause."""
    causes: list[Fields]
    """Strongest first: name, confidence, parameters (value, std), held_out_gain, size_arcsec, look_alikes."""
    data_faults: list[Fields]
    next_experiment: str | None
    """What to record to tell look-alikes apart."""
    rows: Columns
    """Rows that were looked at: session, time_s, generator_rad, error_arcsec, nominal_arcsec, recalibrated_arcsec, extended_arcsec."""
    drive_toml: str | None
    """The extended drive or model with the causes; None where none was found."""
    extended_table: Table | None
    """The table that leaves least in rows left out: of the causes, or calibrated (``table.kind``); None where none gains."""
    explanation: str | None
    """Why the cause of ``explain`` was named or not."""

    def __init__(self, text: str, rows: Columns, drive_toml: str | None, table: Table | None, explanation: str | None) -> None:
        super().__init__(text)
        self.rows, self.drive_toml, self.extended_table, self.explanation = rows, drive_toml, table, explanation

    def save(self, folder: PathLike) -> list[Path]:
        """Writes ``diagnosis.json``, where causes were found ``drive-extended.toml``, and the table; gives what was written."""
        into = Path(folder)
        into.mkdir(parents=True, exist_ok=True)
        written = [into / "diagnosis.json"]
        written[0].write_text(self.to_json() + "\n", encoding="utf-8")
        if self.drive_toml is not None:
            written.append(into / "drive-extended.toml")
            written[1].write_text(self.drive_toml, encoding="utf-8")
        if self.extended_table is not None:
            written.extend(self.extended_table._save_as(into, self.table.file.removesuffix(".fxt")))
        return written

    def plot(self, ax: Axes | None = None) -> Axes:
        """What the nominal model leaves of the error and what is left with the causes (arcsec), over time or rows; needs matplotlib."""
        from . import _plots

        return _plots.diagnosis(self, ax)

    def __repr__(self) -> str:
        found = ", ".join(f"{cause.name} ({100 * cause.confidence:.0f} %)" for cause in self.causes)
        return f"Diagnosis({self.finding}, {self.verdict}: {found or 'no cause'})"


def diagnose(
    data: object,
    *,
    ratio: float | None = None,
    model: PathLike | None = None,
    table: Table | PathLike | bytes | None = None,
    drive: Drive | PathLike = "HHD-95",
    generator: str | None = None,
    columns: str | Mapping[str, str] = "",
    rate_hz: float | None = None,
    torque_constant: float | None = None,
    kernels: PathLike | None = None,
    explain: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Diagnosis:
    """What the simulation gets wrong in measured data, and why: ``flexspline diagnose``.

    ``data``: the path of a log, or a table of columns (DataFrame, Arrow table, dict of arrays); columns as for `calibrate`. The nominal model is
    ``model`` (the path of a nominal.toml or drive-extended.toml), the ``table`` of ``drive``, or a ``ratio`` alone. ``generator`` is by default the table's, else
    ``cam``. ``kernels`` is the path of a .kernels.json of that table; ``explain`` asks about a cause by name.

    >>> diagnose("bench.csv", model="nominal.toml").causes  # doctest: +SKIP
    """
    opened = None if table is None else _opened(table)
    kind = generator or ("cam" if opened is None else opened.generator)
    with shown(progress, "diagnose") as tell:
        text, drive_toml, parts, explanation, rows = _native.diagnose(
            log(data),
            _known(ratio, model, opened),
            drive_of(drive)._inner,
            kind,
            (columns_option(columns), rate_hz, torque_constant),
            kernels=None if kernels is None else path_text("kernels", kernels),
            explain=explain,
            threads=threads,
            progress=tell,
        )
    extended = None if parts is None else Table._made(parts)
    return Diagnosis(text, Columns(rows), drive_toml, extended, None if explanation is None else explanation[0])


def _opened(table: Table | PathLike | bytes) -> Table:
    return table if isinstance(table, Table) else Table.open(table)


def _known(ratio: float | None, model: PathLike | None, table: Table | PathLike | bytes | None) -> float | str | bytes:
    """What is known of the drive before: one of the three."""
    given = [name for name, value in (("ratio", ratio), ("model", model), ("table", table)) if value is not None]
    if len(given) != 1:
        raise BadInput(f"found {' and '.join(given) or 'none of ratio, model, table'}, allowed: one of ratio, model and table")
    if ratio is not None:
        return float(ratio)
    if model is not None:
        return path_text("model", model)
    assert table is not None
    return _opened(table).image
