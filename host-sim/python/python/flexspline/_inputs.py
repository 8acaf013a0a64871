"""What a caller gives, as the compiled half takes it: one clear error, or a conversion."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import BadInput

PathLike = str | os.PathLike[str]
Scalar = TypeVar("Scalar", bound=np.generic)


def numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """One value or one column, as float64 that lie one behind the other: copied only where they do not."""
    if isinstance(value, np.ma.MaskedArray):
        value = np.ma.filled(value.astype(np.float64), np.nan)
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise BadInput(f"{name}: found values of type {array.dtype}, allowed: real numbers")
    if array.ndim > 1:
        raise BadInput(f"{name}: found an array of shape {array.shape}, allowed: one number, or one row after another")
    return np.ascontiguousarray(np.atleast_1d(array), dtype=np.float64)


def signs(name: str, value: ArrayLike) -> NDArray[np.int8]:
    """Directions, +1 or -1."""
    array = numbers(name, value)
    wrong = array[np.abs(array) != 1.0]
    if wrong.size:
        raise BadInput(f"{name}: found {wrong[0]:g}, allowed: 1 or -1")
    return array.astype(np.int8)


def spread(column: NDArray[Scalar], rows: int) -> NDArray[Scalar]:
    """One value for all rows, where there are several."""
    return np.full(rows, column[0], dtype=column.dtype) if column.size == 1 and rows != 1 else column


def output(name: str, array: object, kind: type[Scalar], rows: int, inputs: Sequence[NDArray[Any]]) -> NDArray[Scalar]:
    """An array that results can be written into."""
    wanted = np.dtype(kind)
    if not isinstance(array, np.ndarray):
        raise BadInput(f"out.{name}: found {type(array).__name__}, allowed: a numpy array of {wanted}")
    whole = array.dtype == wanted and array.flags.c_contiguous and array.flags.writeable
    if not whole or array.shape != (rows,):
        layout = "" if whole else f", contiguous={array.flags.c_contiguous}, writeable={array.flags.writeable}"
        raise BadInput(
            f"out.{name}: found {array.dtype} of shape {array.shape}{layout}, allowed: {wanted} of shape ({rows},), "
            "contiguous and writeable"
        )
    if any(np.may_share_memory(array, of) for of in inputs):
        raise BadInput(f"out.{name}: found memory of an input, allowed: memory of its own")
    return array


def is_path(value: object) -> bool:
    return isinstance(value, (str, os.PathLike))


def log(data: object, name: str = "data") -> str | tuple[str, bytes]:
    """A log as a path, or as a CSV in memory where it is a table of columns (DataFrame, Arrow table, dict of arrays)."""
    if isinstance(data, (str, os.PathLike)):
        return os.fspath(data)
    columns = {key: kept for key, column in table_columns(data).items() if (kept := _plain(column)) is not None}
    if not columns:
        raise BadInput(f"{name}: found no column of numbers")
    lengths = {key: len(column) for key, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise BadInput(f"{name}: found columns of {lengths} rows, allowed: all as long")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(columns)
    text.writelines(",".join(row) + "\n" for row in zip(*(_cells(column) for column in columns.values()), strict=True))
    return name, text.getvalue().encode()


def table_columns(data: object) -> dict[str, Any]:
    """The columns of whatever is a table."""
    if isinstance(data, Mapping):
        return {str(key): value for key, value in data.items()}
    names = getattr(data, "column_names", None)
    if names is None:
        names = getattr(data, "columns", None)
    if names is None or not hasattr(data, "__getitem__"):
        raise BadInput(
            f"data: found {type(data).__name__}, allowed: the path of a log, a DataFrame, an Arrow table or a dict of arrays"
        )
    return {str(key): data[key] for key in names}


def _plain(column: object) -> NDArray[Any] | None:
    """A column as numbers; times as seconds; None where it is neither."""
    array = np.asarray(column)
    if array.ndim != 1:
        raise BadInput(f"data: found a column of shape {array.shape}, allowed: one row after another")
    if array.dtype.kind in "mM" and array.size:
        since = array - array[0] if array.dtype.kind == "M" else array
        seconds: NDArray[Any] = since / np.timedelta64(1, "s")
        return seconds
    if array.dtype.kind == "O":
        # What pandas makes of numbers of which some are missing.
        try:
            return np.array([np.nan if _is_missing(value) else float(value) for value in array])
        except (TypeError, ValueError):
            return None
    return array if array.dtype.kind in "fiu" else None


def _is_missing(value: object) -> bool:
    return value is None or type(value).__name__ in ("NAType", "NaTType")


def _cells(column: NDArray[Any]) -> list[str]:
    return ["" if value != value else repr(value) for value in column.tolist()]


def columns_option(columns: str | Mapping[str, str]) -> str:
    """A mapping of columns as the command takes it."""
    return columns if isinstance(columns, str) else ",".join(f"{quantity}={place}" for quantity, place in columns.items())


def names(name: str, value: str | Sequence[str]) -> list[str]:
    """One name, or several."""
    found = [value] if isinstance(value, str) else list(value)
    if not found:
        raise BadInput(f"{name}: found none, allowed: one or more")
    return found


def path_text(name: str, value: object) -> str:
    """A path."""
    if not isinstance(value, (str, os.PathLike)):
        raise BadInput(f"{name}: found {type(value).__name__}, allowed: a path")
    return str(os.fspath(value))
