"""Session-level rows as units that are told apart by their content."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from graspdb_schemas.tables import ROW_KEYS

if TYPE_CHECKING:
    from hashlib import _Hash

KEY_LENGTH: Final = 32
"""Hexadecimal digits of a content key: 128 bits of a sha256."""

_VALID: Final = b"\x01"

_UNITS: Final[tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]] = (
    (("sessions",), ("session",)),
    (("subjects",), ("session", "subject")),
    (("hands",), ("session", "subject", "side")),
    (("objects", "object_points"), ("session", "object")),
)
"""Tables whose rows belong together, and the columns that name what they describe."""


@dataclass(frozen=True)
class Unit:
    """The rows that describe one session, subject, hand or object.

    Attributes
    ----------
    content_key : str
        The same for the same rows, different for different ones.
    describes : mapping of str to str
        What the rows describe: values of their columns session, subject, side, object.
    tables : mapping of str to pyarrow.Table
        Its rows by table, without ingest_id.
    """

    content_key: str
    describes: Mapping[str, str]
    tables: Mapping[str, pa.Table]

    def belongs_to(self, trial: Mapping[str, Any]) -> bool:
        """Whether a trial with this row in `trials` stands on the unit."""
        return all(trial.get(column) == value for column, value in self.describes.items() if column != "side")


def units(tables: Mapping[str, pa.Table]) -> Iterator[Unit]:
    """Yield the units among the rows of a trial or a session."""
    for names, columns in _UNITS:
        present = [name for name in names if name in tables and tables[name].num_rows]
        if not present:
            continue
        for named in tables[present[0]].select(columns).group_by(list(columns)).aggregate([]).to_pylist():
            rows = {name: _matching(tables[name], named) for name in present}
            yield Unit(content_key(rows), named, rows)


def content_key(tables: Mapping[str, pa.Table]) -> str:
    """Return a key of the content of tables: of names, types and values.

    Layout in memory does not matter, nor does the order of rows that have a key of their own. A column
    without a value is left out, so that rows keep their keys when a later format adds columns.
    """
    digest = hashlib.sha256()
    for name in sorted(tables):
        table = _ordered(name, tables[name])
        digest.update(f"{name}:{table.num_rows}".encode())
        for column in table.column_names:
            array = table[column].combine_chunks()
            if array.null_count < len(array):
                digest.update(f"{name}.{column}".encode())
                _update(digest, array)
    return digest.hexdigest()[:KEY_LENGTH]


def _ordered(name: str, table: pa.Table) -> pa.Table:
    """Return a table with its rows in the order of their keys."""
    keys = ROW_KEYS.get(name)
    if keys is None or table.num_rows < 2:
        return table
    order = pc.sort_indices(table, sort_keys=[(key, "ascending") for key in keys]).to_numpy()
    return table if (np.diff(order.astype(np.int64)) > 0).all() else table.take(order)


def _matching(table: pa.Table, named: Mapping[str, str]) -> pa.Table:
    """Return the rows whose columns have the given values."""
    mask = pa.scalar(True)
    for column, value in named.items():
        mask = pc.and_(mask, pc.equal(table[column], value))
    return table if pc.all(mask).as_py() else table.filter(mask)


def _update(digest: "_Hash", array: pa.Array) -> None:
    """Feed an array's type, length, nulls and values to a digest."""
    kind = array.type
    digest.update(f"{kind.id}:{len(array)}".encode())
    digest.update(_numbers(pc.is_valid(array)) if array.null_count else _VALID * len(array))
    if pa.types.is_list(kind):
        digest.update(_numbers(pc.list_value_length(array)))
        _update(digest, array.flatten())
    elif pa.types.is_boolean(kind) or pa.types.is_integer(kind) or pa.types.is_floating(kind):
        digest.update(_numbers(array))
    elif pa.types.is_string(kind):
        digest.update(_numbers(pc.binary_length(array)))
        digest.update(_text(array))
    else:
        for value in array.to_pylist():
            digest.update(repr(value).encode())


def _numbers(array: pa.Array) -> memoryview:
    """Return the values of an array, zero in the place of nulls."""
    known = pc.fill_null(array, pa.scalar(0).cast(array.type)) if array.null_count else array
    return np.asarray(known.to_numpy(zero_copy_only=False)).data


def _text(array: pa.Array) -> memoryview:
    """Return all texts of an array one after the other, as UTF-8."""
    texts = pc.drop_null(array)
    if not len(texts):
        return memoryview(b"")
    _, places, letters = texts.buffers()
    bounds = np.frombuffer(places, np.int32)[texts.offset : texts.offset + len(texts) + 1]
    return memoryview(letters or b"")[bounds[0] : bounds[-1]]
