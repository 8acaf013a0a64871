"""Drives: built in, from a file, with fields set."""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._errors import BadInput
from ._fields import rows_html
from ._inputs import PathLike


class Drive:
    """A strain wave drive that passed every check: a built-in name, or a drive file.

    >>> Drive("HHD-95").set({"flanks.friction_coefficient": 0.08}).ratio
    95.0

    Built in are ``HHD-95`` (ideal), ``HHD-95-typical`` (friction, compliances, tolerances), ``CUP-95`` (a cup), ``HHD-95-hermetic``
    (a closed sleeve), ``HHD-95-plane`` (no third dimension) and ``S-95`` (S-shaped teeth). Lengths are mm, angles as the names of the fields say; `to_toml` has every field with its unit.
    """

    BUILT_IN: tuple[str, ...] = tuple(_native.Drive.built_in())
    """Names of the drives that are built in."""

    _inner: _native.Drive

    def __init__(self, drive: PathLike = "HHD-95") -> None:
        """A drive by name or file. Raises `BadInput` with every problem of a file."""
        name = os.fspath(drive)
        known = _native.Drive.named(name)
        if known is None:
            try:
                text = Path(name).read_text(encoding="utf-8")
            except OSError as error:
                like = difflib.get_close_matches(name, self.BUILT_IN, n=1)
                hint = f"; did you mean `{like[0]}`?" if like else ""
                raise BadInput(
                    f"drive: found {name!r}, which cannot be read as a file ({error.strerror or error}); allowed: a drive file, or one of "
                    f"the built-in drives {', '.join(self.BUILT_IN)}{hint}"
                ) from None
            known = _native.Drive.from_toml(name, text)
        self._inner = known

    @classmethod
    def from_toml(cls, text: str, name: str = "drive.toml") -> Drive:
        """The drive in the text of a file; ``name`` stands in messages."""
        return cls._of(_native.Drive.from_toml(name, text))

    @classmethod
    def _of(cls, inner: _native.Drive) -> Drive:
        drive = cls.__new__(cls)
        drive._inner = inner
        return drive

    def set(self, *assignments: str | Mapping[str, Any], **fields: Any) -> Drive:
        """This drive with fields changed, and checked.

        ``drive.set({"flanks.friction_coefficient": 0.08})``, ``drive.set({"flanks": {"friction_coefficient": 0.08}})``,
        ``drive.set("flanks.friction_coefficient=0.08")`` and ``drive.set(flanks__friction_coefficient=0.08)`` say the same.
        """
        sets: list[str] = []
        for assignment in assignments:
            sets.extend([assignment] if isinstance(assignment, str) else _assignments(assignment))
        sets.extend(_assignments({name.replace("__", "."): value for name, value in fields.items()}))
        return self._of(self._inner.with_sets(sets))

    def to_toml(self) -> str:
        """The drive as a complete file, each field with its unit and meaning; reads back as the same drive."""
        return self._inner.to_toml()

    def save(self, path: PathLike) -> None:
        """Writes `to_toml` to a file."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    @property
    def fields(self) -> dict[str, Any]:
        """Every field, section by section."""
        return tomllib.loads(self.to_toml())

    @property
    def name(self) -> str:
        """What results call it."""
        return self._inner.name

    @property
    def ratio(self) -> float:
        """Generator turns to one of the output; negative where they turn opposite ways."""
        return self._inner.ratio

    @property
    def drive_hash(self) -> str:
        """BLAKE3 of the drive's physics, hexadecimal; tables carry it."""
        return self._inner.drive_hash

    def __eq__(self, other: object) -> bool:
        return self.to_toml() == other.to_toml() if isinstance(other, Drive) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return Drive.from_toml, (self.to_toml(), self.name)

    def __repr__(self) -> str:
        return f"Drive({self.name!r}, ratio {self.ratio:g})"

    def _repr_html_(self) -> str:
        fields = self.fields
        flat = {f"{section}.{key}": value for section, of in fields.items() if isinstance(of, dict) for key, value in of.items()}
        return rows_html(flat, f"{self.name}, ratio {self.ratio:g}")


def drive_of(drive: Drive | PathLike) -> Drive:
    """A drive, or the one that is meant."""
    return drive if isinstance(drive, Drive) else Drive(drive)


def _assignments(fields: Mapping[str, Any], below: str = "") -> Iterator[str]:
    for name, value in fields.items():
        path = f"{below}{name}"
        if isinstance(value, Mapping):
            yield from _assignments(value, f"{path}.")
        else:
            yield f"{path}={_literal(path, value)}"


def _literal(path: str, value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    elif isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_literal(path, item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_literal(path, item)}" for key, item in value.items()) + " }"
    raise BadInput(f"{path}: found {type(value).__name__}, allowed: a number, a word, or a list")
