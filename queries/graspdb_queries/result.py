"""Answers, in the form that the asker works with."""

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa

from graspdb_schemas.errors import MissingLibraryError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

SHOWN_ROWS: Final = 20
"""Rows that a notebook shows of an answer."""

_CELL: Final = 60
"""Characters of a cell that it shows."""


@dataclass(frozen=True)
class Result:
    """The rows that a query came to.

    Attributes
    ----------
    table : pyarrow.Table
        The rows.
    """

    table: pa.Table

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.table.column_names)

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.table.num_rows)

    def arrow(self) -> pa.Table:
        """Return the rows as an Arrow table."""
        return self.table

    def rows(self) -> list[tuple[Any, ...]]:
        """Return the rows as tuples of Python values."""
        return list(zip(*(column.to_pylist() for column in self.table.columns), strict=True))

    def df(self) -> "pd.DataFrame":
        """Return the rows as a pandas data frame.

        Raises
        ------
        MissingLibraryError
            pandas is not installed.
        """
        try:
            import pandas  # noqa: F401, ICN001, RUF100
        except ImportError as error:
            raise MissingLibraryError("pandas", str(error), "Install it: pip install pandas") from error
        frame: pd.DataFrame = self.table.to_pandas()
        return frame

    def pl(self) -> "pl.DataFrame":
        """Return the rows as a polars data frame.

        Raises
        ------
        MissingLibraryError
            polars is not installed.
        """
        try:
            import polars
        except ImportError as error:
            raise MissingLibraryError("polars", str(error), "Install it: pip install polars") from error
        return polars.DataFrame(self.table)

    def _repr_html_(self) -> str:
        """Return the first rows as a table, for a notebook."""
        names = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        few = Result(self.table.slice(0, SHOWN_ROWS)).rows()
        lines = ("".join(f"<td>{html.escape(_shown(value))}</td>" for value in row) for row in few)
        body = "".join(f"<tr>{line}</tr>" for line in lines)
        rest = f", the first {SHOWN_ROWS} are shown" if len(self) > SHOWN_ROWS else ""
        count = "1 row" if len(self) == 1 else f"{len(self):,} rows"
        table = f"<table><thead><tr>{names}</tr></thead><tbody>{body}</tbody></table>"
        return f"<div>{table}<p>{count}{rest}</p></div>"


def _shown(value: Any) -> str:
    """Return a value as a cell of a table: few digits, and the beginning of what is long."""
    text = "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= _CELL else f"{text[: _CELL - 1]}…"
