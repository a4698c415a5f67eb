"""Housekeeping: dead rows swept, small files joined, and files that nothing names deleted."""

import re
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Final

from deltalake import CommitProperties, DeltaTable
from deltalake.exceptions import CommitFailedError, DeltaError

from graspdb.store.encoding import encoding
from graspdb.store.fence import Patience, commit_properties
from graspdb.store.layout import LOG_RETENTION_KEY, bring_up_to_date, first_line
from graspdb.store.location import Location, ObjectStorage
from graspdb.store.lock import alone, writing
from graspdb.store.sweep import sweep
from graspdb_schemas.errors import DatabaseError, ParameterError
from graspdb_schemas.tables import TABLES

SAFE_RETENTION: Final = 168
"""How long files that no longer count are kept unless the user says otherwise [h]: a week."""

_UNFINISHED: Final = re.compile(r".*#\d+|.*\.tmp")
"""Names of files that a killed process was writing, which listings of a table leave out."""


@dataclass(frozen=True)
class OptimizedTable:
    """What was done to a table.

    Attributes
    ----------
    swept : int
        Dead rows deleted.
    files_before, files_after : int
        Files of its latest version.
    vacuumed : int
        Files deleted from disk.
    """

    swept: int
    files_before: int
    files_after: int
    vacuumed: int


def optimize(
    root: Location, tables: Mapping[str, DeltaTable], retention_hours: int
) -> dict[str, OptimizedTable]:
    """Sweep dead rows, join small files, delete old ones, and shorten the logs.

    Others may ingest and read at the same time. With a retention of less than a week it waits at the end
    until no writer is in the middle of a commit; states that were opened before may then be gone.

    Parameters
    ----------
    root : Path or ObjectStorage
        The database's folder.
    tables : mapping of str to DeltaTable
        Its open tables; they are brought up to date.
    retention_hours : int
        How long files are kept that the latest version does not need [h].

    Returns
    -------
    dict of str to OptimizedTable
        What was done, by table.

    Raises
    ------
    ParameterError
        The retention is negative.
    DatabaseError
        The database cannot be written, or other writers leave no turn.
    """
    if retention_hours < 0:
        raise ParameterError("retention_hours", retention_hours, "0 or more")
    for name, table in tables.items():
        bring_up_to_date(root, name, table)
    before = {name: len(table.file_uris()) for name, table in tables.items()}
    swept = sweep(root, tables)
    with writing(root):
        for name in TABLES:
            _compact(root, name, tables[name])
    after = {name: len(table.file_uris()) for name, table in tables.items()}
    with alone(root) if retention_hours < SAFE_RETENTION else nullcontext():
        vacuumed = {name: _forget(root, name, tables[name], retention_hours) for name in TABLES}
    return {
        name: OptimizedTable(swept.get(name, 0), before[name], after[name], vacuumed[name]) for name in TABLES
    }


def _compact(root: Location, name: str, table: DeltaTable) -> None:
    """Join a table's small files; those of `trials` in turn with all commits."""
    patience = Patience(root)
    while True:
        table.update_incremental()
        properties = (
            commit_properties(table, "compact")
            if name == "trials"
            else CommitProperties(max_commit_retries=100)
        )
        try:
            table.optimize.compact(commit_properties=properties, writer_properties=encoding(name))
            return
        except CommitFailedError:
            patience.pause()
        except (DeltaError, OSError) as error:
            raise _failed(root, name, error) from error


def _forget(root: Location, name: str, table: DeltaTable, hours: int) -> int:
    """Delete files that have not been needed for some time, and log entries as old; return how many files."""
    patience = Patience(root)
    while True:
        try:
            table.update_incremental()
            _keep_log_for(table, hours)
            old = table.vacuum(hours, dry_run=True, enforce_retention_duration=False, full=True)
            if old:
                table.vacuum(hours, dry_run=False, enforce_retention_duration=False, full=True)
            if not hours:
                # The last entry of a log stays, and may name trials; this one changes nothing and names none.
                table.alter.set_table_properties(_log_property(hours), raise_if_not_exists=False)
            table.create_checkpoint()
            table.cleanup_metadata()
            return len(old) + _delete_unfinished(root / name, hours)
        except CommitFailedError:
            patience.pause()
        except (DeltaError, OSError) as error:
            raise _failed(root, name, error) from error


def _keep_log_for(table: DeltaTable, hours: int) -> None:
    """Say in a table how long entries of its log are kept, where it says otherwise."""
    wanted = _log_property(hours)
    if table.metadata().configuration.items() >= wanted.items():
        return
    table.alter.set_table_properties(wanted, raise_if_not_exists=False)


def _log_property(hours: int) -> dict[str, str]:
    return {LOG_RETENTION_KEY: f"interval {hours} hours"}


def _delete_unfinished(folder: Location, hours: int) -> int:
    """Delete what killed processes left half-written, and return how many files that were.

    Object storage has no half-written files.
    """
    if isinstance(folder, ObjectStorage):
        return 0
    oldest = time.time() - 3600 * hours
    left = [
        file
        for place in (folder, folder / "_delta_log")
        for file in place.iterdir()
        if _UNFINISHED.fullmatch(file.name) and file.stat().st_mtime <= oldest
    ]
    for file in left:
        file.unlink(missing_ok=True)
    return len(left)


def _failed(root: Location, name: str, error: Exception) -> DatabaseError:
    return DatabaseError(
        root,
        f"cannot optimize table {name!r}: {first_line(error)}",
        "Nothing that is committed was lost; free space or permissions, then run again.",
    )
