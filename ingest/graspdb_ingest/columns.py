"""Arrays to Arrow columns: missing values become nulls, rows become lists."""

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_schemas.tables import STORE_COLUMNS

Numbers = NDArray[Any]


def number_column(values: Numbers) -> pa.Array:
    """Return a column of numbers, null where NaN, from shape (n,)."""
    if values.dtype.kind != "f":
        return pa.array(values)
    return pa.array(values, mask=np.isnan(values))


def list_column(values: Numbers) -> pa.Array:
    """Return a column of lists from shape (n, k) or (n, m, k).

    The innermost list, a vector or a position, is null where any of its numbers is NaN; a matrix
    all of whose rows are missing is null as a whole.
    """
    missing: NDArray[np.bool_] = np.zeros(values.shape[:-1], dtype=bool)
    if values.dtype.kind == "f":
        missing = np.asarray(np.isnan(values).any(axis=-1))
    inner = _lists(pa.array(np.ascontiguousarray(values).ravel()), values.shape[-1], missing.ravel())
    if values.ndim == 2:
        return inner
    return _lists(inner, values.shape[1], np.asarray(missing.all(axis=1)))


def _lists(items: pa.Array, length: int, missing: NDArray[np.bool_]) -> pa.Array:
    offsets = pa.array(np.arange(len(missing) + 1, dtype=np.int32) * length)
    return pa.ListArray.from_arrays(offsets, items, mask=pa.array(missing))


def table(schema: pa.Schema, columns: dict[str, Any]) -> pa.Table:
    """Return a table of the columns given, in the order and with the types that the schema declares.

    Raises
    ------
    KeyError
        If a column is not declared, or one that is declared and not the store's own is not given.
    """
    names = [name for name in schema.names if name not in STORE_COLUMNS]
    if set(columns) != set(names):
        raise KeyError(f"columns {sorted(set(columns) ^ set(names))} do not match the schema")
    fields = [schema.field(name) for name in names]
    arrays = [_cast(columns[field.name], field.type) for field in fields]
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def _cast(values: Any, kind: pa.DataType) -> pa.Array:
    if isinstance(values, pa.Array):
        return values.cast(kind)
    return pa.array(values, type=kind)
