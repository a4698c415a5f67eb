"""Bring Arrow tables to a declared schema: order and types of columns, units and documentation."""

from functools import cache

import pyarrow as pa

from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.tables import STORE_COLUMNS, TABLES


@cache
def rows_schema(name: str) -> pa.Schema:
    """Return the schema of a table's rows before they are stored: without the store's own columns.

    Parameters
    ----------
    name : str
        Name of the table.

    Raises
    ------
    ParameterError
        There is no such table.
    """
    if name not in TABLES:
        raise ParameterError("table", name, f"{', '.join(TABLES)}{nearest(name, list(TABLES))}")
    return pa.schema([field for field in TABLES[name] if field.name not in STORE_COLUMNS])


def conform(table: pa.Table, schema: pa.Schema, name: str) -> pa.Table:
    """Return `table` with the columns, types and metadata of `schema`, copying only what differs.

    Parameters
    ----------
    table : pyarrow.Table
        Any table with the schema's columns, in any order.
    schema : pyarrow.Schema
        What it shall have.
    name : str
        Name of the table, for messages.

    Raises
    ------
    ParameterError
        Columns are missing or unknown, a type cannot be cast, or a null stands where none may.
    """
    if table.schema.equals(schema, check_metadata=True):
        return table
    found, wanted = set(table.column_names), set(schema.names)
    if found != wanted or len(table.column_names) != len(wanted):
        missing = ", ".join(sorted(wanted - found)) or "none"
        unknown = ", ".join(sorted(found - wanted)) or "none"
        raise ParameterError(name, f"columns missing: {missing}; unknown: {unknown}", ", ".join(schema.names))
    try:
        return table.select(schema.names).cast(schema)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, pa.ArrowTypeError, ValueError) as error:
        raise ParameterError(name, str(error), "values of the declared types, see docs/tables.md") from error
