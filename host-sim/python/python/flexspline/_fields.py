"""The objects that the command writes as JSON, with their fields as attributes."""

from __future__ import annotations

import html
import json as _json
from collections.abc import Mapping
from typing import Any


def _wrapped(value: Any) -> Any:
    if isinstance(value, dict):
        return Fields(value)
    if isinstance(value, list):
        return [_wrapped(item) for item in value]
    return value


class Fields:
    """A JSON object: ``fields.held_out.rms_after_arcsec`` is ``fields.json["held_out"]["rms_after_arcsec"]``.

    Units are the ends of the names. What the command writes as null is None.
    """

    json: dict[str, Any]
    """The object as plain dicts, lists, numbers and strings."""

    def __init__(self, fields: Mapping[str, Any] | str) -> None:
        self.json = _json.loads(fields) if isinstance(fields, str) else dict(fields)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "json":
            raise AttributeError(name)
        if name not in self.json:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}; it has {', '.join(self.json)}")
        return _wrapped(self.json[name])

    def __getitem__(self, name: str) -> Any:
        return self.json[name]

    def __contains__(self, name: object) -> bool:
        return name in self.json

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.json]

    def __eq__(self, other: object) -> bool:
        return self.json == other.json if isinstance(other, Fields) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def to_json(self) -> str:
        """The text of the JSON, indented."""
        return _json.dumps(self.json, indent=2, ensure_ascii=False)

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={_short(value)}" for name, value in self.json.items())
        return f"{type(self).__name__}({fields})"

    def _repr_html_(self) -> str:
        return rows_html(self.json)


def _short(value: Any) -> str:
    if isinstance(value, (dict, list)):
        return f"<{len(value)}>" if value else "<none>"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)


def rows_html(fields: Mapping[str, Any], caption: str = "") -> str:
    """A table of names and values for a notebook."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th><td style='text-align:left'>{html.escape(_short(value))}</td></tr>"
        for name, value in fields.items()
    )
    above = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    return f"<table>{above}{rows}</table>"
