"""Keeping a database in order: taking things out, tidying up, checking that it is whole."""

from collections.abc import Mapping, Sequence
from os import PathLike

from graspdb.store import Store
from graspdb.store.location import location
from graspdb.store.optimize import SAFE_RETENTION, OptimizedTable
from graspdb.store.remove import Kind, Removed
from graspdb.store.verify import Verified
from graspdb.store.verify import verify as verify_store
from graspdb_schemas.errors import ParameterError, nearest


def remove(db: str | PathLike[str], kind: str, keys: Sequence[str]) -> Removed:
    """Take trials, sessions or subjects out of a database in one step.

    Readers no longer see them. Their bytes stay in older versions of the tables until `optimize` deletes
    these; with ``retention_hours=0`` it leaves none.

    Parameters
    ----------
    db : path
        The database's folder, or its URL in object storage.
    kind : {'trial', 'session', 'subject'}
        What the keys name.
    keys : sequence of str
        Trials as ``<session>/<trial>``, subjects as ``<session>/<subject>``, or sessions.

    Raises
    ------
    ParameterError
        There is no such kind, or nothing has one of the keys.
    DatabaseError
        The folder is no database, or cannot be written.
    """
    if kind not in tuple(Kind):
        raise ParameterError("kind", kind, ", ".join(Kind) + nearest(kind, list(Kind)))
    return Store.open(db).remove(Kind(kind), keys)


def optimize(
    db: str | PathLike[str], *, retention_hours: int = SAFE_RETENTION
) -> Mapping[str, OptimizedTable]:
    """Delete dead rows, join small files, and delete files that no version of the last hours needs.

    Others may ingest and read at the same time. With a retention of less than a week, databases that were
    opened before may fail to answer afterwards; open them again.

    Parameters
    ----------
    db : path
        The database's folder, or its URL in object storage.
    retention_hours : int
        How far back earlier states can still be read [h].

    Returns
    -------
    mapping of str to OptimizedTable
        What was done, by table.

    Raises
    ------
    ParameterError
        The retention is negative.
    DatabaseError
        The folder is no database, or cannot be written.
    """
    return Store.open(db).optimize(retention_hours)


def verify(db: str | PathLike[str]) -> Verified:
    """Read a whole database and check files, hashes, formats and every reference between its tables.

    Raises
    ------
    DatabaseError
        The folder is no database.
    """
    return verify_store(location(db))
