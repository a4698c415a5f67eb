"""Files with rows of several ingests of which all rows count, so that no query has to filter them."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray


def written_rows(trials: pa.Table, name: str) -> tuple[pa.Array, pa.Array]:
    """Return the ingest_ids of trials, and how many rows each wrote to a table; null where it does not say.

    Parameters
    ----------
    trials : pyarrow.Table
        Columns ingest_id and table_rows of `trials`.
    name : str
        The table.
    """
    said = trials["table_rows"].combine_chunks()
    counts = pc.fill_null(pc.map_lookup(said, pa.scalar(name), "first"), 0)
    return trials["ingest_id"].combine_chunks(), pc.if_else(
        said.is_valid(), counts, pa.scalar(None, pa.int32())
    )


def free_of_dead_rows(
    least: pa.Array, greatest: pa.Array, n_rows: pa.Array, ids: pa.Array, written: pa.Array
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
    ids : pyarrow.Array of string
        Committed ingest_ids.
    written : pyarrow.Array of integer
        Rows that each of them wrote to this table; null where it is not known.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for files of one ingest too; False everywhere if something is not known.
    """
    if not len(least) or least.null_count or greatest.null_count or n_rows.null_count or written.null_count:
        return np.zeros(len(least), bool)
    first, last, key = (_fixed(texts) for texts in (least, greatest, ids))
    order = np.argsort(key)
    key, before = key[order], np.concatenate([[0], np.cumsum(written.to_numpy()[order])])
    files = np.argsort(first, kind="stable")
    rows = n_rows.to_numpy()[files]
    free = np.zeros(len(files), bool)
    for run, start, end in _overlapping(first[files], last[files]):
        expected = before[np.searchsorted(key, end, "right")] - before[np.searchsorted(key, start, "left")]
        free[files[run]] = rows[run].sum() == expected
    return free


def _fixed(texts: pa.Array) -> NDArray[np.bytes_]:
    """Return texts as an array that numpy sorts fast; an empty one has texts too."""
    return np.array(texts.cast(pa.binary()).to_numpy(zero_copy_only=False), dtype="S")


def _overlapping(
    first: NDArray[np.bytes_], last: NDArray[np.bytes_]
) -> Iterator[tuple[slice, np.bytes_, np.bytes_]]:
    """Yield the runs of ranges, sorted by their start, that overlap, each with its start and end."""
    start, end = 0, last[0]
    for i in range(1, len(first)):
        if first[i] > end:
            yield slice(start, i), first[start], end
            start, end = i, last[i]
        end = max(end, last[i])
    yield slice(start, len(first)), first[start], end
