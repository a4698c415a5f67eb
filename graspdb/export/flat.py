"""Rows of `grasps` as flat tables: a column for each number, with its unit and what it means."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyarrow as pa

from graspdb.export.grasp_arrays import QUALITIES
from graspdb.export.reading import vectors
from graspdb_schemas.tables import GRASPS, TRIALS, doc_of, unit_of
from graspdb_schemas.vocabulary import CONFIGURATION, N_Q, SITES

PROVENANCE: Final = ("rate", "data_set", "data_set_version", "original_id", "licence")
"""Columns of `trials` that go with each grasp."""

_LEFT_OUT: Final = ("ingest_id",)

_UNITS_OF_Q: Final = ("m",) * 3 + ("1",) * 4 + ("rad",) * (N_Q - 7)

_POSE: Final = tuple(f"{row}{column}" for row in range(3) for column in range(4))


@dataclass(frozen=True)
class FlatColumn:
    """One column of a flat table.

    Attributes
    ----------
    name : str
        Its name.
    kind : pyarrow.DataType
        Its type: a number, a text or a truth value.
    unit, doc : str
        Its unit, and what it means.
    """

    name: str
    kind: pa.DataType
    unit: str
    doc: str

    @property
    def field(self) -> pa.Field:
        """The column with its unit and documentation as metadata."""
        return pa.field(self.name, self.kind, metadata={"unit": self.unit, "doc": self.doc})


@dataclass(frozen=True)
class _Rule:
    """What becomes of one nested column: the flat columns, and how their values are found."""

    columns: tuple[FlatColumn, ...]
    values: Callable[[pa.ChunkedArray], list[Any]]


def flat_schema() -> pa.Schema:
    """Return the columns of a flat table, ``split`` last, with unit and documentation as metadata."""
    fields = [column.field for source in _sources() for column in _rule(source).columns]
    split = FlatColumn("split", pa.string(), "", "side of the split: train or valid; empty without one")
    return pa.schema([*fields, split.field])


def source_columns() -> tuple[str, ...]:
    """Return the columns that `flatten` needs, those of `grasps` first, then `PROVENANCE`."""
    return tuple(field.name for field in _sources())


def flatten(rows: pa.Table, split: str) -> pa.Table:
    """Return rows of `grasps` joined to `trials` as a flat table.

    Parameters
    ----------
    rows : pyarrow.Table
        Columns `source_columns`.
    split : str
        Side of the split of all rows.
    """
    schema = flat_schema()
    arrays: list[Any] = []
    for field in _sources():
        rule = _rule(field)
        arrays += [
            pa.array(values, type=column.kind, from_pandas=True)
            if not isinstance(values, (pa.Array, pa.ChunkedArray))
            else values.cast(column.kind)
            for column, values in zip(rule.columns, rule.values(rows[field.name]), strict=True)
        ]
    arrays.append(pa.array([split] * rows.num_rows, pa.string()))
    return pa.table(arrays, schema=schema)


def _sources() -> Iterator[pa.Field]:
    yield from (field for field in GRASPS if field.name not in _LEFT_OUT)
    yield from (TRIALS.field(name) for name in PROVENANCE)


def _rule(field: pa.Field) -> _Rule:
    """Return what becomes of a column."""
    name, unit, doc = field.name, unit_of(field), doc_of(field)
    if name == "q":
        columns = tuple(
            FlatColumn(f"q_{part}", pa.float64(), of, f"configuration of the hand: {part}")
            for part, of in zip(CONFIGURATION, _UNITS_OF_Q, strict=True)
        )
        return _Rule(columns, _configurations)
    if name == "sites_object":
        parts = [f"{site}_{axis}" for site in SITES for axis in "xyz"]
        return _numbers(name, parts, unit, "sphere centre in the object frame", (len(SITES), 3))
    if name == "object_from_hand":
        return _numbers(name, _POSE, "", "pose of the hand segment: row and column [m in column 3]", (4, 4))
    if name == "gap":
        return _numbers(name, SITES, unit, "signed distance to the object", (len(SITES),))
    if name == "quality":
        return _map(name, QUALITIES, unit, "grasp quality index")
    if name == "opposition_shares":
        return _map(name, ("pad", "palm", "side"), unit, "share of the fingers' opposition")
    if pa.types.is_nested(field.type):
        return _Rule((FlatColumn(name, pa.string(), unit, f"{doc}; spaces between"),), _texts)
    return _Rule((FlatColumn(name, field.type, unit, doc),), lambda column: [column])


def _numbers(
    name: str, parts: tuple[str, ...] | list[str], unit: str, doc: str, shape: tuple[int, ...]
) -> _Rule:
    """Return the rule of a column of vectors or matrices, of which the first numbers are taken."""
    columns = tuple(FlatColumn(f"{name}_{part}", pa.float64(), unit, f"{doc}: {part}") for part in parts)

    def values(column: pa.ChunkedArray) -> list[Any]:
        return list(vectors(column, *shape).reshape(len(column), -1).T[: len(parts)])

    return _Rule(columns, values)


def _map(name: str, keys: tuple[str, ...], unit: str, doc: str) -> _Rule:
    columns = tuple(FlatColumn(f"{name}_{key}", pa.float64(), unit, f"{doc}: {key}") for key in keys)

    def values(column: pa.ChunkedArray) -> list[Any]:
        rows = [dict(row or ()) for row in column.to_pylist()]
        return [[row.get(key) for row in rows] for key in keys]

    return _Rule(columns, values)


def _configurations(column: pa.ChunkedArray) -> list[Any]:
    """Return the numbers of configurations; those of other hand models than graspdb's own are left out."""
    rows = [q if q is not None and len(q) == N_Q else [np.nan] * N_Q for q in column.to_pylist()]
    return list(np.array(rows, dtype=float).reshape(len(rows), N_Q).T)


def _texts(column: pa.ChunkedArray) -> list[Any]:
    """Return lists of texts as one text each, with spaces; lists of lists with bars between the lists."""

    def joined(value: Any) -> str:
        if value and isinstance(value[0], list):
            return " | ".join(" ".join(part) for part in value)
        return " ".join(value)

    return [[None if value is None else joined(value) for value in column.to_pylist()]]
