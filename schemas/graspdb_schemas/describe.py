"""The declared tables as plain data, for the command line and the documentation."""

from dataclasses import asdict, dataclass
from typing import Any

import pyarrow as pa

from graspdb_schemas.tables import TABLE_DOCS, TABLES, doc_of, unit_of


@dataclass(frozen=True)
class DescribedColumn:
    """A column: name, type, unit, what it holds, and whether it may be null."""

    name: str
    kind: str
    unit: str
    doc: str
    nullable: bool


@dataclass(frozen=True)
class DescribedTable:
    """A table: name, what one row stands for, and its columns."""

    name: str
    doc: str
    columns: tuple[DescribedColumn, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the description as plain data."""
        return asdict(self)


def describe_tables() -> tuple[DescribedTable, ...]:
    """Return the description of every table, in the order of declaration."""
    return tuple(describe(name, TABLE_DOCS[name], schema) for name, schema in TABLES.items())


def describe(name: str, doc: str, schema: pa.Schema) -> DescribedTable:
    """Return the description of a table, or of a view with documented columns."""
    return DescribedTable(name, doc, tuple(_describe(field) for field in schema))


def _describe(field: pa.Field) -> DescribedColumn:
    return DescribedColumn(field.name, kind_of(field.type), unit_of(field), doc_of(field), field.nullable)


def kind_of(kind: pa.DataType) -> str:
    """Return an Arrow type in short: ``list<list<float>>`` without names of inner fields."""
    if pa.types.is_list(kind):
        return f"list<{kind_of(kind.value_type)}>"
    if pa.types.is_map(kind):
        return f"map<{kind_of(kind.key_type)}, {kind_of(kind.item_type)}>"
    return str(kind)
