"""Rows as numpy columns, and their ways to pandas and Arrow."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas
    import pyarrow

_SHOWN = 8


class Columns(Mapping[str, Any]):
    """Columns by name, all as long: ``rows.error_arcsec`` is ``rows["error_arcsec"]``, a numpy array (a list where it is text).

    Units are the ends of the names: rad, arcsec (at the output), n_m, c, s, mpa.
    ``pandas.DataFrame(dict(rows))`` and whatever takes Arrow (``__arrow_c_stream__``) take it too.
    """

    columns: dict[str, Any]
    """The columns in the order of the file that the command writes."""

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self.columns = dict(columns)

    def __getitem__(self, name: str) -> Any:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "columns":
            raise AttributeError(name)
        if name not in self.columns:
            raise AttributeError(f"{type(self).__name__} has no column {name!r}; it has {', '.join(self.columns)}")
        return self.columns[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.columns]

    __hash__ = None  # type: ignore[assignment]

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return max((len(column) for column in self.columns.values()), default=0)

    def to_pandas(self) -> pandas.DataFrame:
        """A pandas DataFrame of the same columns; needs pandas."""
        import pandas

        return pandas.DataFrame(self.columns)

    def to_arrow(self) -> pyarrow.Table:
        """A pyarrow Table of the same columns; needs pyarrow."""
        import pyarrow

        return pyarrow.table(self.columns)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The columns for whatever takes Arrow by its C interface (polars, pandas, DuckDB); needs pyarrow."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.rows} rows: {', '.join(self.columns)})"

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{_cell(column[row])}</td>" for column in self.columns.values()) + "</tr>"
            for row in range(min(self.rows, _SHOWN))
        )
        more = f"<p>{self.rows} rows</p>" if self.rows > _SHOWN else ""
        return f"<table><tr>{head}</tr>{body}</table>{more}"


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, (float, np.floating)) else html.escape(str(value))


FloatArray = NDArray[np.float64]
