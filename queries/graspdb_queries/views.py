"""SQL that shows a snapshot's Parquet files as documented views."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import pyarrow as pa

from graspdb_queries.source import TableSource
from graspdb_schemas.tables import TABLE_DOCS, TABLES, doc_of, unit_of

INTERNAL: Final = "internal"
"""Schema that holds what the views are made of."""


def identifier(name: str) -> str:
    """Return a name as an SQL identifier."""
    return '"' + name.replace('"', '""') + '"'


def literal(text: str) -> str:
    """Return a text as an SQL literal."""
    return "'" + text.replace("'", "''") + "'"


def helper_tables(sources: Mapping[str, TableSource]) -> Iterator[tuple[str, pa.Table]]:
    """Yield name and content of the tables that the views are made of."""
    for name, source in sources.items():
        if source.mixed_files:
            yield f"committed_{name}", pa.table({"ingest_id": source.committed})
        elif not source.files:
            yield f"empty_{name}", TABLES[name].empty_table()


def view_sql(name: str, source: TableSource) -> str:
    """Return the statement that creates a table's view."""
    columns = ", ".join(identifier(column) for column in TABLES[name].names)
    parts = []
    if source.files:
        parts.append(f"SELECT {columns} FROM {_read(source.files)}")
    if source.mixed_files:
        committed = f"SELECT ingest_id FROM {INTERNAL}.committed_{name}"
        parts.append(f"SELECT {columns} FROM {_read(source.mixed_files)} WHERE ingest_id IN ({committed})")
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


def comments_sql(name: str) -> Iterator[str]:
    """Yield the statements that document a table's view and columns."""
    yield f"COMMENT ON VIEW {identifier(name)} IS {literal(TABLE_DOCS[name])}"
    for field in TABLES[name]:
        unit = unit_of(field)
        text = doc_of(field) + (f" [{unit}]" if unit else "")
        yield f"COMMENT ON COLUMN {identifier(name)}.{identifier(field.name)} IS {literal(text)}"


def _read(files: Sequence[str]) -> str:
    # A folder called key=value would otherwise become a column.
    listed = ", ".join(literal(file) for file in files)
    return f"read_parquet([{listed}], hive_partitioning = false)"
