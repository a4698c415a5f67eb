"""SQL that shows a snapshot's Parquet files as documented views, with the functions beside them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import duckdb
import pyarrow as pa

from graspdb_queries.joins import views
from graspdb_queries.macros import macros_sql
from graspdb_queries.quoting import identifier, literal
from graspdb_queries.source import TableSource
from graspdb_schemas.tables import TABLE_DOCS, TABLES, doc_of, unit_of

INTERNAL: Final = "internal"
"""Schema that holds what the views are made of."""


def build_database(connection: duckdb.DuckDBPyConnection, sources: Mapping[str, TableSource]) -> None:
    """Create the documented functions and views of a database in an empty DuckDB database.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
        The empty database.
    sources : mapping of str to TableSource
        Files and committed rows of each table.
    """
    connection.execute(f"CREATE SCHEMA {INTERNAL}")
    for name, table in _helper_tables(sources):
        connection.register("incoming", table)
        connection.execute(f"CREATE TABLE {INTERNAL}.{name} AS SELECT * FROM incoming")
        connection.unregister("incoming")
    connection.execute(";".join(["BEGIN", *_statements(sources), "COMMIT"]))


def _helper_tables(sources: Mapping[str, TableSource]) -> Iterator[tuple[str, pa.Table]]:
    """Yield name and content of the tables that the views are made of."""
    for name, source in sources.items():
        if source.mixed_files:
            yield f"committed_{name}", pa.table({"ingest_id": source.committed})
        if source.may_lack_columns or not (source.files or source.mixed_files):
            yield f"empty_{name}", TABLES[name].empty_table()


def view_sql(name: str, source: TableSource) -> str:
    """Return the statement that creates a table's view."""
    columns = ", ".join(identifier(column) for column in TABLES[name].names)
    parts = []
    if source.files:
        parts.append(f"SELECT {columns} FROM {_rows(name, source, source.files)}")
    if source.mixed_files:
        committed = f"SELECT ingest_id FROM {INTERNAL}.committed_{name}"
        rows = _rows(name, source, source.mixed_files)
        parts.append(f"SELECT {columns} FROM {rows} WHERE ingest_id IN ({committed})")
    if not parts:
        parts.append(f"SELECT {columns} FROM {INTERNAL}.empty_{name}")
    rows = " UNION ALL ".join(parts)
    if name == "sessions":
        # A manifest grows with its session; the row of the latest ingest stands for the session.
        rows = (
            f"SELECT {columns} FROM ({rows}) "
            "QUALIFY row_number() OVER (PARTITION BY session ORDER BY ingest_id DESC) = 1"
        )
    return f"CREATE VIEW {identifier(name)} AS {rows}"


def _statements(sources: Mapping[str, TableSource]) -> Iterator[str]:
    """Yield the statements that create and document all functions and views of a database."""
    yield from macros_sql()
    for name, source in sources.items():
        yield view_sql(name, source)
        yield from _comments(name, TABLE_DOCS[name], TABLES[name])
    for view in views().values():
        yield view.sql
        yield from _comments(view.name, view.doc, view.schema)


def _comments(name: str, doc: str, schema: pa.Schema) -> Iterator[str]:
    """Yield the statements that document a view and its columns."""
    yield f"COMMENT ON VIEW {identifier(name)} IS {literal(doc)}"
    for field in schema:
        unit = unit_of(field)
        text = doc_of(field) + (f" [{unit}]" if unit else "")
        yield f"COMMENT ON COLUMN {identifier(name)}.{identifier(field.name)} IS {literal(text)}"


def _rows(name: str, source: TableSource, files: Sequence[str]) -> str:
    """Return what to select a table's rows from, of some of its files."""
    # A folder called key=value would otherwise become a column.
    listed = f"[{', '.join(literal(file) for file in files)}], hive_partitioning = false"
    if not source.may_lack_columns:
        return f"read_parquet({listed})"
    read = f"SELECT * FROM read_parquet({listed}, union_by_name = true)"
    return f"(SELECT * FROM {INTERNAL}.empty_{name} UNION ALL BY NAME {read})"
