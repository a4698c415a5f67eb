"""Files with rows of several ingests of which all rows count, so that no query has to filter them."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray


class WrittenRows:
    """How many rows committed ingests wrote to each table.

    Parameters
    ----------
    ids : pyarrow.Array of string
        Their ingest_ids.
    table_rows : pyarrow.MapArray of string to integer
        What each wrote, by table; null where it is not known.
    """

    def __init__(self, ids: pa.Array, table_rows: pa.MapArray) -> None:
        texts = np.array(ids.cast(pa.binary()).to_numpy(zero_copy_only=False), dtype="S")
        self._order = np.argsort(texts)
        self._ids = texts[self._order]
        self._known = not table_rows.null_count
        self._row = np.repeat(np.arange(len(ids)), np.diff(table_rows.offsets.to_numpy()))
        tables = table_rows.keys.dictionary_encode()
        self._names, self._table = tables.dictionary.to_pylist(), tables.indices.to_numpy()
        self._n = table_rows.items.to_numpy()

    def within(self, name: str) -> "RowsWithin | None":
        """Return how many rows of a table were written by ranges of ingests; None if it is not known."""
        if not self._known:
            return None
        rows = np.zeros(len(self._ids), np.int64)
        if name in self._names:
            of_table = self._table == self._names.index(name)
            rows[self._row[of_table]] = self._n[of_table]
        return RowsWithin(self._ids, np.concatenate([[0], np.cumsum(rows[self._order])]))


class RowsWithin:
    """How many rows of one table were written by the committed ingests of a range.

    Parameters
    ----------
    ids : ndarray of bytes, shape (n,)
        The ingest_ids, sorted.
    before : ndarray of int, shape (n + 1,)
        Rows that all ingests before each one wrote, and in the end all rows.
    """

    def __init__(self, ids: NDArray[np.bytes_], before: NDArray[np.int64]) -> None:
        self._ids = ids
        self._before = before

    def __call__(self, first: str, last: str) -> int:
        """Return the rows of the ingests from one to another, both included."""
        start = np.searchsorted(self._ids, np.bytes_(first.encode()), "left")
        stop = np.searchsorted(self._ids, np.bytes_(last.encode()), "right")
        return int(self._before[stop] - self._before[start])


def free_of_dead_rows(
    least: pa.Array, greatest: pa.Array, n_rows: pa.Array, written: RowsWithin | None
) -> NDArray[np.bool_]:
    """Tell in which files with rows of several ingests all rows count.

    The rows of every committed ingest are there. So if the files whose ranges of ids overlap have, together,
    as many rows as the committed ingests of that range wrote, they have no others.

    Parameters
    ----------
    least, greatest : pyarrow.Array of string, shape (n,)
        Range of ingest_ids of every file of which rows may count; null where the log does not say.
    n_rows : pyarrow.Array of integer, shape (n,)
        Rows of each file; null where the log does not say.
    written : RowsWithin or None
        What committed ingests wrote to this table; None if it is not known.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for files of one ingest too; False everywhere if something is not known.
    """
    free = np.zeros(len(least), bool)
    if not len(least) or written is None or least.null_count or greatest.null_count or n_rows.null_count:
        return free
    order = pc.sort_indices(least).to_numpy()
    rows = n_rows.to_numpy()[order]
    for run, start, end in _overlapping(least.take(order).to_pylist(), greatest.take(order).to_pylist()):
        free[order[run]] = rows[run].sum() == written(start, end)
    return free


def _overlapping(first: list[str], last: list[str]) -> Iterator[tuple[slice, str, str]]:
    """Yield the runs of ranges, sorted by their start, that overlap, each with its start and end."""
    start, end = 0, last[0]
    for i in range(1, len(first)):
        if first[i] > end:
            yield slice(start, i), first[start], end
            start, end = i, last[i]
        end = max(end, last[i])
    yield slice(start, len(first)), first[start], end
