"""Arrays to Arrow columns: missing values become nulls, rows become lists."""

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

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


def sparse_column(values: Numbers) -> pa.Array:
    """Return a column of lists from shape (n, k), in which single numbers are null where NaN."""
    flat = np.ascontiguousarray(values).ravel()
    items = pa.array(flat, mask=np.isnan(flat))
    return _lists(items, values.shape[1], np.zeros(len(values), dtype=bool))


def flag_column(values: NDArray[np.bool_], unknown: NDArray[np.bool_]) -> pa.Array:
    """Return a column of lists from shape (n, k), in which single flags are null where they are unknown."""
    items = pa.array(values.ravel(), mask=unknown.ravel())
    return _lists(items, values.shape[1], np.zeros(len(values), dtype=bool))


def _lists(items: pa.Array, length: int, missing: NDArray[np.bool_]) -> pa.Array:
    offsets = pa.array(np.arange(len(missing) + 1, dtype=np.int32) * length)
    return pa.ListArray.from_arrays(offsets, items, mask=pa.array(missing))
