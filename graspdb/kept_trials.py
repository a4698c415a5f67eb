"""A database with the rows of some trials alone: those of a session, those that may be passed on."""

from collections.abc import Iterable, Mapping

import pyarrow as pa

from graspdb_queries.engine import Engine
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import QueryError, nearest
from graspdb_schemas.tables import SESSION_TABLES


def keep_trials(
    sources: Mapping[str, TableSource], kept: Iterable[tuple[str, Iterable[str] | None]]
) -> dict[str, TableSource]:
    """Return the sources of a database with the rows of some trials alone.

    Session-level rows stay as far as a trial that stays stands on them.

    Parameters
    ----------
    sources : mapping of str to TableSource
        Files and rows of each table.
    kept : iterable of (str, iterable of str or None)
        ingest_id and context of each trial that stays.
    """
    rows = list(kept)
    trials = pa.array([ingest_id for ingest_id, _ in rows], pa.string())
    context = pa.array(sorted({key for _, keys in rows for key in keys or ()}), pa.string())
    return {
        name: TableSource(
            mixed_files=(*source.files, *source.mixed_files),
            committed=context if name in SESSION_TABLES else trials,
            may_lack_columns=source.may_lack_columns,
        )
        for name, source in sources.items()
    }


def keep_session(engine: Engine, sources: Mapping[str, TableSource], session: str) -> dict[str, TableSource]:
    """Return the sources of a database with the rows of one session alone.

    Raises
    ------
    QueryError
        There is no such session; the message names those there are.
    """
    rows = engine.sql("SELECT session, ingest_id, context FROM trials").rows()
    kept = [(ingest_id, context) for name, ingest_id, context in rows if name == session]
    if not kept:
        names = sorted({row[0] for row in rows})
        raise QueryError(
            f"the database has no session {session!r}{nearest(session, names)}",
            f"Its sessions: {', '.join(names) or 'none'}.",
        )
    return keep_trials(sources, kept)
