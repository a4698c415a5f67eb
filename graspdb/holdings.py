"""What a database holds, counted from what its logs and footers say, without a query engine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc

from graspdb.store.location import Location, open_parquet
from graspdb.store.snapshot import Snapshot
from graspdb.store.stored_rows import for_each_file
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import TABLES

_DESCRIBED: Final = {
    "subject": ("subjects", ["session", "subject"]),
    "hand": ("hands", ["session", "subject", "side"]),
    "object": ("objects", ["session", "object"]),
}
"""What may have several versions -> its table, and the columns that name it."""


@dataclass(frozen=True)
class Info:
    """What a database holds.

    Attributes
    ----------
    path : Path or ObjectStorage
        Where it is.
    format : int
        Version of its format.
    rows : mapping of str to int
        Rows of each table that are visible.
    versions : mapping of str to int
        Version of each table.
    rejected : int
        Trials that were rejected.
    several_versions : tuple of str
        Hands, objects and subjects of which trials stand on more than one version, since their
        description has changed and not every trial was ingested again.
    """

    path: Location
    format: int
    rows: Mapping[str, int]
    versions: Mapping[str, int]
    rejected: int
    several_versions: tuple[str, ...]


def read_info(snapshot: Snapshot) -> Info:
    """Return what a state of a database holds.

    Raises
    ------
    DatabaseError
        A file is missing or damaged.
    """
    sources = snapshot.sources
    try:
        rows = {name: _n_rows(source) for name, source in sources.items()}
        rows["sessions"] = len(_visible("sessions", sources["sessions"], ["session"])["session"].unique())
        status = _visible("trials", sources["trials"], ["status"])["status"]
        several = sorted(key for kind in _DESCRIBED for key in _of_several_versions(kind, sources))
    except (OSError, pa.ArrowException) as error:
        raise DatabaseError(
            snapshot.path,
            f"cannot be read: {str(error).splitlines()[0]}",
            "A file is missing or damaged: restore the folder from a copy.",
        ) from error
    return Info(
        path=snapshot.path,
        format=snapshot.format,
        rows=rows,
        versions=snapshot.versions,
        rejected=pc.sum(pc.equal(status, "rejected")).as_py() or 0,
        several_versions=tuple(several),
    )


def _of_several_versions(kind: str, sources: Mapping[str, TableSource]) -> list[str]:
    name, columns = _DESCRIBED[kind]
    versions = _visible(name, sources[name], columns).group_by(columns).aggregate([([], "count_all")])
    several = versions.filter(pc.greater(versions["count_all"], 1)).select(columns).to_pylist()
    return [f"{kind} {'/'.join(row.values())}" for row in several]


def _n_rows(source: TableSource) -> int:
    """Return how many rows of a table count."""
    whole = sum(source.n_rows)

    def counted(file: str) -> int:
        with open_parquet(file) as parquet:
            groups = (parquet.read_row_group(i, columns=["ingest_id"]) for i in range(parquet.num_row_groups))
            return sum(pc.sum(_counting(group, source)).as_py() or 0 for group in groups)

    return whole + sum(for_each_file(counted, source.mixed_files))


def _visible(name: str, source: TableSource, columns: Sequence[str]) -> pa.Table:
    """Return columns of the rows of a table that count."""
    schema = pa.schema([TABLES[name].field(column) for column in columns])

    def whole(file: str) -> pa.Table:
        with open_parquet(file) as parquet:
            return parquet.read(columns=list(columns)).select(columns).cast(schema)

    def mixed(file: str) -> pa.Table:
        with open_parquet(file) as parquet:
            rows = parquet.read(columns=[*columns, "ingest_id"])
        # Files that a delete has rewritten hold texts of an Arrow type that cannot be filtered.
        return rows.select(columns).cast(schema).filter(_counting(rows, source))

    parts = [*for_each_file(whole, source.files), *for_each_file(mixed, source.mixed_files)]
    return pa.concat_tables(parts) if parts else schema.empty_table()


def _counting(rows: pa.Table, source: TableSource) -> pa.ChunkedArray:
    """Return which rows count."""
    return pc.is_in(rows["ingest_id"].cast(pa.string()), source.committed)
