"""Sweeping: taking away the rows that no committed trial stands on."""

from collections.abc import Iterator, Mapping
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc
from deltalake import CommitProperties, DeltaTable, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError

from graspdb.store.fence import SWEEP, Patience, commit_properties, generation
from graspdb.store.layout import first_line
from graspdb.store.location import Location, open_parquet
from graspdb.store.lock import writing
from graspdb.store.open_tables import quoted
from graspdb.store.snapshot import CommittedIds, committed_ids, table_files
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import TABLES

_BATCH: Final = 200
"""Ingests named in one delete."""


def sweep(root: Location, tables: Mapping[str, DeltaTable]) -> dict[str, int]:
    """Delete the rows of ingests that were interrupted, repeated or replaced.

    The ids are listed first. Then a commit to `trials` bars every ingest that began before it from being
    committed: it starts over with fresh rows. What was listed and is not committed by then never will be.

    Parameters
    ----------
    root : Path or ObjectStorage
        The database's folder.
    tables : mapping of str to DeltaTable
        Its open tables; they are brought up to date.

    Returns
    -------
    dict of str to int
        Rows deleted by table; empty if there were none.

    Raises
    ------
    DatabaseError
        The database cannot be written, or other writers leave no turn.
    """
    with writing(root):
        return _sweep(root, tables)


def _sweep(root: Location, tables: Mapping[str, DeltaTable]) -> dict[str, int]:
    found = {name: _ingest_ids(root, name, tables[name]) for name in TABLES if name != "trials"}
    tables["trials"].update_incremental()
    if not any(len(ids) for ids in _dead(found, committed_ids(root, tables["trials"])).values()):
        return {}
    committed = _bar_unfinished(root, tables["trials"])
    number = generation(tables["trials"])
    deleted = {}
    for name, dead in _dead(found, committed).items():
        if len(dead):
            deleted[name] = sum(_delete(root, name, tables[name], batch, number) for batch in _batches(dead))
    return deleted


def _dead(found: Mapping[str, pa.Array], committed: CommittedIds) -> dict[str, pa.Array]:
    """Return the ids found in each table that are not visible in it."""
    return {name: ids.filter(pc.invert(pc.is_in(ids, committed.of(name)))) for name, ids in found.items()}


def _ingest_ids(root: Location, name: str, table: DeltaTable) -> pa.Array:
    """Return every ingest_id in a table: from the log, or from the files that hold several."""
    table.update_incremental()
    files = table_files(root, name, table)
    mixed = files.paths.filter(pc.invert(files.single)).to_pylist()
    # Files that a delete has rewritten hold texts of another Arrow type.
    columns = (
        open_parquet(path).read(columns=["ingest_id"])["ingest_id"].cast(pa.string()) for path in mixed
    )
    ids = [files.least.filter(files.single), *(column.unique() for column in columns)]
    return pa.chunked_array(ids, pa.string()).unique()


def _bar_unfinished(root: Location, trials: DeltaTable) -> CommittedIds:
    """Commit a sweep to `trials`, and return what is committed at that version."""
    patience = Patience(root)
    while True:
        committed = committed_ids(root, trials)
        try:
            write_deltalake(
                trials,
                TABLES["trials"].empty_table(),
                mode="append",
                commit_properties=commit_properties(trials, "sweep"),
            )
        except CommitFailedError:
            patience.pause()
            trials.update_incremental()
            continue
        except (DeltaError, OSError) as error:
            raise _cannot_write(root, "trials", error) from error
        return committed


def _batches(ids: pa.Array) -> Iterator[list[str]]:
    """Yield ids in lists that fit into one predicate."""
    for start in range(0, len(ids), _BATCH):
        yield ids.slice(start, _BATCH).to_pylist()


def _delete(root: Location, name: str, table: DeltaTable, ids: list[str], number: int) -> int:
    """Delete the rows of some ingests from a table and return how many there were.

    The commit keeps the number of the sweep: states before that sweep are to be read from versions before it.
    """
    patience = Patience(root)
    while True:
        try:
            metrics = table.delete(
                f"ingest_id IN ({quoted(ids)})",
                commit_properties=CommitProperties({SWEEP: number}, max_commit_retries=100),
            )
        except CommitFailedError:
            patience.pause()
            table.update_incremental()
            continue
        except (DeltaError, OSError) as error:
            raise _cannot_write(root, name, error) from error
        return int(metrics["num_deleted_rows"])


def _cannot_write(root: Location, name: str, error: Exception) -> DatabaseError:
    return DatabaseError(
        root,
        f"cannot sweep table {name!r}: {first_line(error)}",
        "Nothing that is committed was touched; free space or permissions, then run again.",
    )
