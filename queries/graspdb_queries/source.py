"""What the engine is told about a table: which files to read, and which rows of them count."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import pyarrow as pa


def _none() -> pa.Array:
    return pa.array([], pa.string())


@dataclass(frozen=True)
class TableSource:
    """One table at one version.

    Attributes
    ----------
    files : tuple of str
        Parquet files of which every row counts.
    n_rows : tuple of int
        Rows of each of `files`.
    mixed_files : tuple of str
        Parquet files of which only the rows count whose ``ingest_id`` is in `committed`.
    committed : pyarrow.Array of string
        Committed ingest_ids; looked at for `mixed_files` alone.
    may_lack_columns : bool
        Whether files may be of an older format, which lacks columns: these are null then.
    """

    files: tuple[str, ...] = ()
    n_rows: tuple[int, ...] = ()
    mixed_files: tuple[str, ...] = ()
    committed: pa.Array = field(default_factory=_none)
    may_lack_columns: bool = False


def files_of(sources: Mapping[str, TableSource]) -> list[str]:
    """Return all files of a snapshot."""
    return [file for source in sources.values() for file in (*source.files, *source.mixed_files)]
