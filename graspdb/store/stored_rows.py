"""The rows of a table on disk: some columns of all, or ingest by ingest, hardly more than one in memory."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

import numpy as np
import pyarrow as pa

from graspdb.store.location import open_parquet
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.tables import TABLES

T = TypeVar("T")

_FILES_AT_ONCE: Final = 8
"""Files that are read side by side."""


def for_each_file(read: Callable[[str], T], files: Sequence[str]) -> list[T]:
    """Return what is read from each file; those of object storage take their time, and so come together."""
    if len(files) < 2:
        return [read(file) for file in files]
    with ThreadPoolExecutor(_FILES_AT_ONCE) as pool:
        return list(pool.map(read, files))


def ingests(
    name: str, files: Sequence[str], expected: Callable[[str], int | None]
) -> Iterator[tuple[str, pa.Table]]:
    """Yield the rows of each ingest in a table: its ingest_id, and the rows without what the store adds.

    Parameters
    ----------
    name : str
        Name of the table.
    files : sequence of str
        Its files.
    expected : callable
        How many rows an ingest should have. As soon as there are so many they are yielded; those of an ingest
        of which that is not known, or that has fewer, when all files have been read.

    Raises
    ------
    OSError, pyarrow.ArrowException
        A file is missing or damaged.
    """
    waiting: dict[str, list[pa.Table]] = {}
    for file in files:
        for ingest_id, rows in _runs(name, file):
            parts = waiting.setdefault(ingest_id, [])
            parts.append(rows)
            if sum(part.num_rows for part in parts) == expected(ingest_id):
                yield ingest_id, pa.concat_tables(waiting.pop(ingest_id))
    for ingest_id, parts in waiting.items():
        yield ingest_id, pa.concat_tables(parts)


def _runs(name: str, file: str) -> Iterator[tuple[str, pa.Table]]:
    """Yield the runs of rows of one ingest in a file, as declared."""
    with open_parquet(file) as parquet:
        stored = parquet.schema_arrow.names
        declared = [field for field in rows_schema(name) if field.name in stored]
        # Of `trials` the columns that the store adds are wanted, too.
        fields = [field for field in TABLES[name] if field.name in stored] if name == "trials" else declared
        for group in range(parquet.num_row_groups):
            table = parquet.read_row_group(group)
            ids = table["ingest_id"].combine_chunks().dictionary_encode()
            edges = np.flatnonzero(np.diff(ids.indices.to_numpy())) + 1
            rows = table.select([field.name for field in fields]).cast(pa.schema(fields))
            for start, stop in zip([0, *edges], [*edges, table.num_rows], strict=True):
                if stop > start:
                    yield str(table["ingest_id"][int(start)]), rows.slice(start, stop - start)
