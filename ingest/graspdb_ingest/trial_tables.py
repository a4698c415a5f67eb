"""The rows that a trial or a session brings to the database."""

from collections.abc import Mapping
from dataclasses import dataclass

import pyarrow as pa

from graspdb_schemas.conform import conform, rows_schema


@dataclass(frozen=True)
class TrialTables:
    """Rows by table name, as the schemas declare them less the columns that the store adds.

    Attributes
    ----------
    tables : mapping of str to pyarrow.Table
        The rows, cast to the declared types; a table without rows may be left out.

    Raises
    ------
    ParameterError
        A table is unknown, a column is missing or unknown, or a value does not fit its type.
    """

    tables: Mapping[str, pa.Table]

    def __post_init__(self) -> None:
        """Cast to the declared schemas."""
        cast = {name: conform(table, rows_schema(name), name) for name, table in self.tables.items()}
        object.__setattr__(self, "tables", cast)
