"""Answers, in the form that the asker works with."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from graspdb_schemas.errors import MissingLibraryError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl


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
