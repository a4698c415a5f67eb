"""Earlier states of a database: which there were, and which versions of its tables they are."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

from deltalake import DeltaTable
from deltalake.exceptions import DeltaError

from graspdb.store.fence import SWEEP, generation
from graspdb.store.layout import first_line, open_table
from graspdb.store.location import Location, has_file
from graspdb_schemas.errors import DatabaseError, ParameterError
from graspdb_schemas.tables import TABLES

AsOf = int | datetime
"""A version of the database, or a time."""

_ACTIONS: Final = {
    "CREATE TABLE": "create",
    "WRITE": "ingest",
    "DELETE": "remove",
    "OPTIMIZE": "compact",
    "VACUUM START": "vacuum",
    "VACUUM END": "vacuum",
}
"""What operations of Delta Lake on `trials` are in a database's history."""


@dataclass(frozen=True)
class Change:
    """One version of a database.

    Attributes
    ----------
    version : int
        Its number, which is that of the table `trials`.
    time : datetime
        When it was committed, in UTC.
    action : str
        create, ingest, remove, sweep, compact, vacuum, or settings.
    added, replaced, removed : int
        Trials that came, were replaced, and went.
    """

    version: int
    time: datetime
    action: str
    added: int
    replaced: int
    removed: int


def read_history(root: Location) -> tuple[Change, ...]:
    """Return the versions of a database whose log is kept, the latest first.

    Raises
    ------
    DatabaseError
        The folder is no database, or its log cannot be read.
    """
    return tuple(_change(info) for info in _commits(root, "trials", open_table(root, "trials")))


def tables_as_of(root: Location, as_of: AsOf) -> dict[str, DeltaTable]:
    """Open every table at the version that has the rows of an earlier state.

    Of `trials` that is the version asked for. The rows it names were written to the other tables before, and
    the first to take any of them away is a sweep with a higher number than that version has seen. So the
    other tables are opened as they were just before the first such sweep.

    Raises
    ------
    ParameterError
        There was no such version, or nothing was there yet at that time.
    DatabaseError
        The folder is no database, or what that state needs has been vacuumed.
    """
    latest = open_table(root, "trials")
    version = _version(root, latest, as_of)
    trials = _open(root, "trials", version, as_of)
    swept = generation(trials)
    tables = {}
    for name in TABLES:
        before = None if generation(latest) == swept else _last_before_sweep(root, name, swept)
        tables[name] = trials if name == "trials" else _open(root, name, before, as_of)
    for name, table in tables.items():
        files = table.file_uris()
        if not all(has_file(file) for file in files):
            raise _gone(root, name, as_of)
    return tables


def _version(root: Location, trials: DeltaTable, as_of: AsOf) -> int:
    """Return the version of `trials` that was asked for."""
    if isinstance(as_of, int):
        if not 0 <= as_of <= trials.version():
            raise ParameterError("as_of", as_of, f"a version from 0 to {trials.version()}, or a time")
        return as_of
    moment = as_of.astimezone(UTC)
    changes = [_change(info) for info in _commits(root, "trials", trials)]
    earlier = [change.version for change in changes if change.time <= moment]
    if not earlier:
        oldest = min(change.time for change in changes)
        raise ParameterError(
            "as_of", as_of.isoformat(), f"a time from {oldest.isoformat()} on: nothing older is kept"
        )
    return max(earlier)


def _last_before_sweep(root: Location, name: str, swept: int) -> int | None:
    """Return the last version of a table that no later sweep has deleted from; None for the latest."""
    commits = _commits(root, name, open_table(root, name))
    later = [info["version"] for info in commits if int(info.get(SWEEP, 0)) > swept]
    return min(later) - 1 if later else None


def _open(root: Location, name: str, version: int | None, as_of: AsOf) -> DeltaTable:
    try:
        return open_table(root, name, version)
    except DatabaseError as error:
        if version is None:
            raise
        raise _gone(root, name, as_of) from error


def _gone(root: Location, name: str, as_of: AsOf) -> DatabaseError:
    state = f"version {as_of}" if isinstance(as_of, int) else f"the state of {as_of.isoformat()}"
    return DatabaseError(
        root,
        f"{state} is no longer kept: files of table {name!r} have been vacuumed",
        "Ask for a later state; graspdb optimize keeps as much of the past as --retention says.",
    )


def _commits(root: Location, name: str, table: DeltaTable) -> list[dict[str, Any]]:
    """Return what the log says of each version of a table, the latest first."""
    try:
        return table.history()
    except DeltaError as error:
        raise DatabaseError(
            root, f"the log of table {name!r} cannot be read: {first_line(error)}", "Restore a copy."
        ) from error


def _change(info: dict[str, Any]) -> Change:
    counts = {name: int(info.get(f"graspdb.{name}", 0)) for name in ("added", "replaced", "removed")}
    action = info.get("graspdb.action") or _ACTIONS.get(info["operation"], "settings")
    time = datetime.fromtimestamp(info["timestamp"] / 1000, UTC)
    return Change(info["version"], time, action, **counts)
