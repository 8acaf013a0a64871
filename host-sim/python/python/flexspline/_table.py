"""Compensation tables, and the core's step on arrays."""

from __future__ import annotations

import enum
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._columns import Columns, FloatArray
from ._errors import BadInput
from ._fields import Fields, rows_html
from ._inputs import PathLike, log, numbers, output, signs, spread, table_columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._runs import Calibration

ARCSEC_PER_RAD: float = _native.Table.arcsec_per_rad
"""Arc-seconds in a radian, as every number here is converted."""


MadeTable = tuple[str, bytes, str, str, str, str | None]
"""A table as it is made: generator, image, text of its JSON, Rust source, C header, samples as CSV."""


class Quality(enum.IntEnum):
    """How far an answer can be trusted, worst last: the column ``quality``."""

    IN_RANGE = 0
    """Inside the range of the table, side of the play known."""
    UNCERTAIN = 1
    """Known to within ``uncertainty_rad`` only: the torque lies inside a jump, or the side of the play is not known yet."""
    EXTRAPOLATED = 2
    """Torque or temperature outside the range of the table; the value at its edge is used."""
    DISABLED = 3
    """Torque or temperature was not finite: no correction is made."""


class PlayState:
    """Where a drive rests inside its play: what `Table.forward` follows from row to row, and from call to call.

    >>> PlayState().is_known, PlayState(direction=1).is_known
    (False, True)
    """

    _inner: _native.PlayState

    def __init__(self, direction: Literal[1, -1] | None = None) -> None:
        """Anywhere inside the play; or at the side where motion of the output in ``direction`` (+1 forward, -1 backward) leaves it."""
        self._inner = _native.PlayState(direction)

    @classmethod
    def restore(cls, saved: bytes) -> PlayState:
        """A state that `save` gave, also on board."""
        return cls._of(_native.PlayState.restore(saved))

    @classmethod
    def _of(cls, inner: _native.PlayState) -> PlayState:
        state = cls.__new__(cls)
        state._inner = inner
        return state

    def save(self) -> bytes:
        """28 bytes with a checksum, as firmware saves them."""
        return self._inner.save()

    def copy(self) -> PlayState:
        """Another state that begins as this one is."""
        return self._of(self._inner.copy())

    @property
    def is_known(self) -> bool:
        """Whether motion has shown the side."""
        return self._inner.is_known

    @property
    def offset_rad(self) -> float:
        """Estimated output less the middle of the play, rad."""
        return self._inner.offset_rad

    @property
    def uncertainty_rad(self) -> float:
        """The estimate is wrong by no more, rad."""
        return self._inner.uncertainty_rad

    def __reduce__(self) -> tuple[Any, ...]:
        return PlayState.restore, (self.save(),)

    def __repr__(self) -> str:
        return f"PlayState(offset_rad={self.offset_rad:.3g}, uncertainty_rad={self.uncertainty_rad:.3g})"


class Answer(Columns):
    """What the core says of each row."""

    quality: NDArray[np.uint8]
    """`Quality` of each row."""
    uncertainty_rad: NDArray[np.float32]
    """The error lies within this either way, rad at the output; what the table misses of its samples comes on top."""

    @property
    def extrapolated(self) -> NDArray[np.bool_]:
        """Rows whose torque or temperature lies outside the table."""
        return np.asarray(self.quality == Quality.EXTRAPOLATED)

    @property
    def uncertain(self) -> NDArray[np.bool_]:
        """Rows that are known to within ``uncertainty_rad`` only."""
        return np.asarray(self.quality == Quality.UNCERTAIN)

    @property
    def disabled(self) -> NDArray[np.bool_]:
        """Rows that got no correction."""
        return np.asarray(self.quality == Quality.DISABLED)


class Prediction(Answer):
    """Where the output is, row by row: what `Table.forward` gives."""

    output_rad: FloatArray
    """Output angle, rad: generator over ratio plus the transmission error."""
    transmission_error_rad: NDArray[np.float32]
    """Output angle less generator over ratio, rad; positive when the output leads."""

    @property
    def error_arcsec(self) -> FloatArray:
        """The transmission error in arc-seconds at the output."""
        return self.transmission_error_rad.astype(np.float64) * ARCSEC_PER_RAD


class Command(Answer):
    """What to command, row by row: what `Table.inverse` gives."""

    generator_rad: FloatArray
    """Generator angle to go to, rad."""
    predicted_error_rad: NDArray[np.float32]
    """Transmission error expected there, rad at the output."""

    @property
    def error_arcsec(self) -> FloatArray:
        """The transmission error expected there, in arc-seconds at the output."""
        return self.predicted_error_rad.astype(np.float64) * ARCSEC_PER_RAD


class WindUp(Columns):
    """Which torque winds a drive up as measured, row by row: what `Table.torque` gives. NaN where a reading is none."""

    torque_n_m: FloatArray
    """Torque at the output, N·m, within the range of the table."""
    low_n_m: FloatArray
    """The torque is no less, N·m; inside the play or a dead zone it may be far from ``torque_n_m``."""
    high_n_m: FloatArray
    """The torque is no more, N·m."""


class Replay(Columns):
    """The core over measured rows: the columns of ``replay.csv``, but that ``quality`` holds `Quality` numbers."""

    generator_rad: FloatArray
    torque_n_m: FloatArray
    temperature_c: FloatArray
    measured_arcsec: FloatArray
    """Output error as measured, arcsec."""
    predicted_arcsec: FloatArray
    """Output error as the core predicts it, arcsec."""
    residual_arcsec: FloatArray
    """Measured less predicted, arcsec."""
    uncertainty_arcsec: FloatArray
    quality: NDArray[np.uint8]
    torque_from_wind_up_n_m: FloatArray
    """Torque that the wind-up says, N·m, with ``torque_from_wind_up_low_n_m`` and ``torque_from_wind_up_high_n_m``."""
    summary: Fields
    """``summary.json``: rms_measured_arcsec, rms_residual_arcsec, max_residual_arcsec, rows_by_quality and others."""

    def __init__(self, columns: Mapping[str, Any], summary: Fields) -> None:
        super().__init__(columns)
        self.summary = summary

    def plot(self, ax: Axes | None = None) -> Axes:
        """Error as measured, and residual with the table, arcsec, over the generator angle, rad; needs matplotlib."""
        from . import _plots

        return _plots.replay(self, ax)


class Table:
    """A compensation table: what the core reads on board, read by the same code.

    ``Table.open("out/cam.fxt")`` checks all of an image. Angles are rad, torque N·m at the output (positive turns it forward),
    temperature °C. `forward`, `inverse` and `replay` are the core's own functions over rows, without the GIL, with the same bits.
    """

    info: Fields | None = None
    """What the command writes as ``<generator>.json``; None for a table that was opened."""
    samples_csv: str | None = None
    """The samples of its sweep as CSV, if it was swept."""

    _inner: _native.Table
    _sources: tuple[str, str] | None = None

    def __init__(self, inner: _native.Table) -> None:
        """Use `Table.open`."""
        self._inner = inner
        self._header = inner.header()

    @classmethod
    def open(cls, image: PathLike | bytes | bytearray | memoryview) -> Table:
        """The table of an image: the path of an ``.fxt``, or its bytes. Raises `BadInput` where it fails any check."""
        if isinstance(image, (str, os.PathLike)):
            name = os.fspath(image)
            try:
                content = Path(name).read_bytes()
            except OSError as error:
                raise BadInput(f"{name}: {error.strerror or error}") from None
            return cls(_native.Table.check(name, content))
        return cls(_native.Table.check("image", bytes(image)))

    @classmethod
    def _made(cls, parts: MadeTable) -> Table:
        _, image, info, rust, header, samples = parts
        table = cls(_native.Table.check("image", image))
        table.info, table.samples_csv, table._sources = Fields(info), samples, (rust, header)
        return table

    @property
    def image(self) -> bytes:
        """The bytes of the ``.fxt``."""
        return self._inner.image

    @property
    def table_id(self) -> str:
        """First 16 hex digits of the BLAKE3 of the image's contents."""
        return self._header["table_id"]

    @property
    def generator(self) -> str:
        """Wave generator that it is marked with."""
        return self._header["generator"]

    @property
    def ratio(self) -> float:
        """Generator turns to one of the output; negative where they turn opposite ways."""
        return self._header["ratio"]

    @property
    def flexspline_teeth(self) -> int:
        """Teeth of the flexspline."""
        return self._header["flexspline_teeth"]

    @property
    def circular_spline_teeth(self) -> int:
        """Teeth of the circular spline."""
        return self._header["circular_spline_teeth"]

    @property
    def fixed(self) -> str:
        """The member that stands still: ``flexspline`` or ``circular_spline``."""
        return self._header["fixed"]

    @property
    def torque_range_n_m(self) -> tuple[float, float]:
        """Torques that it holds for, N·m; beyond them it extrapolates and says so."""
        low, high = self._header["torque_range_n_m"]
        return low, high

    @property
    def temperature_range_c(self) -> tuple[float, float]:
        """Temperatures that it holds for, °C."""
        low, high = self._header["temperature_range_c"]
        return low, high

    @property
    def torque_nodes_n_m(self) -> FloatArray:
        """Torque nodes, N·m, ascending."""
        return self._header["torque_nodes_n_m"].copy()

    @property
    def temperature_nodes_c(self) -> FloatArray:
        """Temperature nodes, °C, ascending."""
        return self._header["temperature_nodes_c"].copy()

    @property
    def dead_zone_n_m(self) -> float:
        """Torque below which the output stays where it is inside its clearance, N·m."""
        return self._header["dead_zone_n_m"]

    @property
    def drive_hash(self) -> str:
        """BLAKE3 of the drive (`Drive.drive_hash`), hexadecimal."""
        return self._header["drive_hash"]

    @property
    def header(self) -> Fields:
        """All that stands in the header, ``tool_version``, ``mesh_level`` and what the table misses of its samples among it."""
        plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in self._header.items()}
        return Fields(plain)

    def forward(
        self,
        generator_rad: ArrayLike,
        torque_n_m: ArrayLike = 0.0,
        temperature_c: ArrayLike = 20.0,
        *,
        direction: ArrayLike | None = None,
        state: PlayState | None = None,
        out: Prediction | None = None,
    ) -> Prediction:
        """Where the output is, for each row; one value may stand for all rows.

        Without ``direction`` the rows are one motion in their order, and the play is followed from row to row, beginning at ``state``
        (which goes on with the motion; by default nothing is known of the play, and rows are ``uncertain`` until motion has shown the
        side). With ``direction`` (+1 output forward, -1 backward; one, or one for each row) every row stands for itself, in steady motion.
        ``out``: results of before, whose arrays are written anew.

        >>> table.forward(np.linspace(0, 6, 1000), 12.0).error_arcsec  # doctest: +SKIP
        """
        generator, torque, temperature = self._rows(("generator_rad", generator_rad), torque_n_m, temperature_c)
        inputs, rows = [generator, torque, temperature], generator.size
        sides = self._sides(direction, state)
        prediction = Prediction(
            {
                "output_rad": _out(out, "output_rad", np.float64, rows, inputs),
                "transmission_error_rad": _out(out, "transmission_error_rad", np.float32, rows, inputs),
                "uncertainty_rad": _out(out, "uncertainty_rad", np.float32, rows, inputs),
                "quality": _out(out, "quality", np.uint8, rows, inputs),
            }
        )
        play = None if state is None else state._inner
        self._inner.forward(generator, torque, temperature, sides, play, *prediction.columns.values())
        return prediction

    def inverse(
        self,
        output_rad: ArrayLike,
        torque_n_m: ArrayLike = 0.0,
        temperature_c: ArrayLike = 20.0,
        *,
        direction: ArrayLike | None = None,
        state: PlayState | None = None,
        out: Command | None = None,
    ) -> Command:
        """Which generator angle brings the output to ``output_rad``, for each row for itself.

        With ``direction`` in steady motion that way; with ``state`` from where the drive rests (it is not changed); with neither the
        middle of the play is aimed at, with its half-width as uncertainty.
        """
        target, torque, temperature = self._rows(("output_rad", output_rad), torque_n_m, temperature_c)
        inputs, rows = [target, torque, temperature], target.size
        sides = self._sides(direction, state)
        command = Command(
            {
                "generator_rad": _out(out, "generator_rad", np.float64, rows, inputs),
                "predicted_error_rad": _out(out, "predicted_error_rad", np.float32, rows, inputs),
                "uncertainty_rad": _out(out, "uncertainty_rad", np.float32, rows, inputs),
                "quality": _out(out, "quality", np.uint8, rows, inputs),
            }
        )
        play = None if state is None else state._inner
        self._inner.inverse(target, torque, temperature, sides, play, *command.columns.values())
        return command

    def torque(
        self,
        generator_rad: ArrayLike,
        output_rad: ArrayLike,
        temperature_c: ArrayLike = 20.0,
        *,
        half_width_arcsec: ArrayLike = 0.0,
        direction: ArrayLike | None = None,
        state: PlayState | None = None,
        calibration: Calibration | None = None,
    ) -> WindUp:
        """Which torque winds the drive up from ``generator_rad`` to ``output_rad``, both on the zeros of the table.

        With ``direction`` each row for itself, in steady motion that way; else in their order, from ``state`` or anywhere in the play.
        ``half_width_arcsec`` is that of the readings and of the table. A ``calibration`` gives it, and the hysteresis, which no table holds:
        torques as the command ``replay`` finds them. A row for itself knows no loads before it: it has the half-width without hysteresis.
        """
        if calibration is not None and getattr(getattr(calibration, "table", None), "table_id", None) != self.table_id:
            raise BadInput(f"calibration: found {calibration!r}, allowed: what calibrate gave with this table, {self.table_id}")
        found = {} if calibration is None else calibration.json.get("torque_from_wind_up", {})
        half_width_arcsec = found.get("half_width_arcsec" if direction is None else "half_width_alone_arcsec", half_width_arcsec)
        hysteresis = json.dumps(found["hysteresis"]) if "hysteresis" in found and direction is None else None
        reading = numbers("output_rad", output_rad)
        generator, half_width = spread(numbers("generator_rad", generator_rad), reading.size), numbers("half_width_arcsec", half_width_arcsec)
        if not (half_width >= 0.0).all():
            raise BadInput(f"half_width_arcsec: found {half_width.min()}, allowed: 0 and more")
        temperature = numbers("temperature_c", temperature_c)
        said = WindUp({name: np.empty(generator.size) for name in ("torque_n_m", "low_n_m", "high_n_m")})
        play = None if state is None else state._inner
        sides = self._sides(direction, state)
        self._inner.torque(generator, reading, temperature, half_width / ARCSEC_PER_RAD, sides, play, hysteresis, *said.columns.values())
        return said

    def replay(
        self,
        data: object | None = None,
        *,
        generator_rad: ArrayLike | None = None,
        output_rad: ArrayLike | None = None,
        error_arcsec: ArrayLike | None = None,
        torque_n_m: ArrayLike = 0.0,
        temperature_c: ArrayLike = 20.0,
    ) -> Replay:
        """The core over measured rows in their order, as ``flexspline replay`` runs it.

        ``data`` is the path of a CSV, or a table of columns (DataFrame, Arrow table, dict) with ``generator_rad``, ``output_rad`` (rad) or
        ``error_arcsec``, and where recorded ``torque_n_m`` and ``temperature_c``. Or give the columns one by one.
        """
        if data is not None:
            if isinstance(data, (str, os.PathLike)):
                columns, summary = self._inner.replay_file(str(log(data)), float(numbers("temperature_c", temperature_c)[0]))
                return Replay(columns, Fields(summary))
            given = table_columns(data)
            generator_rad = given.get("generator_rad", generator_rad)
            output_rad, error_arcsec = given.get("output_rad", output_rad), given.get("error_arcsec", error_arcsec)
            torque_n_m, temperature_c = given.get("torque_n_m", torque_n_m), given.get("temperature_c", temperature_c)
        if generator_rad is None or (output_rad is None) == (error_arcsec is None) and output_rad is None:
            raise BadInput("replay: generator_rad and one of output_rad and error_arcsec are needed")
        generator, torque, temperature = self._rows(("generator_rad", generator_rad), torque_n_m, temperature_c)
        if output_rad is not None:
            output_angle = spread(numbers("output_rad", output_rad), generator.size)
            if output_angle.size != generator.size:
                raise BadInput(f"output_rad: found {output_angle.size} values, allowed: {generator.size}, as of generator_rad")
            error = (output_angle - generator / self.ratio) * ARCSEC_PER_RAD
        else:
            error = numbers("error_arcsec", 0.0 if error_arcsec is None else error_arcsec)
        unknown = np.flatnonzero(~np.isfinite(error))
        if unknown.size:
            name = "error_arcsec" if output_rad is None else "output_rad"
            others = f" and in {unknown.size - 1} other rows" if unknown.size > 1 else ""
            raise BadInput(f"{name}[{unknown[0]}]: found {error[unknown[0]]:g}{others}, allowed: finite; leave out rows without a measurement")
        columns, summary = self._inner.replay(generator, error, torque, temperature)
        return Replay(columns, Fields(summary))

    def _rows(self, first: tuple[str, ArrayLike], torque_n_m: ArrayLike, temperature_c: ArrayLike) -> list[FloatArray]:
        """The columns of a call; the angle as long as the longest."""
        angle = numbers(*first)
        torque, temperature = numbers("torque_n_m", torque_n_m), numbers("temperature_c", temperature_c)
        if angle.size == 1:
            angle = spread(angle, max(torque.size, temperature.size))
        return [angle, torque, temperature]

    @staticmethod
    def _sides(direction: ArrayLike | None, state: PlayState | None) -> NDArray[np.int8] | None:
        if direction is not None and state is not None:
            raise BadInput("direction: found it beside state, allowed: one of the two")
        return None if direction is None else signs("direction", direction)

    def save(self, target: PathLike) -> list[Path]:
        """Writes the table: to a file ``.fxt``, or into a folder as the command does (``<generator>.fxt``, and of a table made here .json, .rs,
        .h and samples). Gives what was written."""
        path = Path(target)
        if path.suffix == ".fxt":
            path.write_bytes(self.image)
            return [path]
        return self._save_as(path, self.generator)

    def _save_as(self, folder: Path, name: str) -> list[Path]:
        folder.mkdir(parents=True, exist_ok=True)
        parts: dict[str, bytes] = {"fxt": self.image}
        if self.info is not None:
            parts["json"] = (self.info.to_json() + "\n").encode()
        if self._sources is not None:
            parts["rs"], parts["h"] = (text.encode() for text in self._sources)
        if self.samples_csv is not None:
            parts["samples.csv"] = self.samples_csv.encode()
        for ending, content in parts.items():
            (folder / f"{name}.{ending}").write_bytes(content)
        return [folder / f"{name}.{ending}" for ending in parts]

    def plot(
        self,
        what: Literal["wind-up", "ripple"] = "wind-up",
        *,
        torques_n_m: Sequence[float] | None = None,
        temperature_c: float | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """A picture; needs matplotlib. ``wind-up``: error (arcsec) over torque (N·m) at generator angle 0, moving either way.
        ``ripple``: error over two tooth pitches of the generator (rad) at some torques. The temperature is by default the middle node."""
        from . import _plots

        return _plots.table(self, what, torques_n_m, temperature_c, ax)

    def __reduce__(self) -> tuple[Any, ...]:
        state = {"info": self.info, "samples_csv": self.samples_csv, "_sources": self._sources}
        return Table.open, (self.image,), state

    def __repr__(self) -> str:
        low, high = self.torque_range_n_m
        cold, warm = self.temperature_range_c
        return f"Table({self.table_id}, {self.generator}, ratio {self.ratio:g}, {low:g} to {high:g} N·m, {cold:g} to {warm:g} C)"

    def _repr_html_(self) -> str:
        plain = {name: value for name, value in self.header.json.items() if not name.endswith(("nodes_n_m", "nodes_c"))}
        return rows_html(plain, f"table {self.table_id}")


def _out(
    out: Answer | None, name: str, kind: type[Any], rows: int, inputs: Sequence[NDArray[Any]]
) -> NDArray[Any]:
    """A new array, or that of ``out``."""
    if out is None:
        return np.empty(rows, dtype=kind)
    if name not in out:
        raise BadInput(f"out: found columns {', '.join(out)}, allowed: the result of an earlier call of the same kind")
    return output(name, out[name], kind, rows, inputs)
