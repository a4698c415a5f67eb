"""Taking trials, sessions and subjects out of a database."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import PurePosixPath
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable
from deltalake.exceptions import CommitFailedError, DeltaError

from graspdb.store.commit import append_rows, fresh_id, stamped, write_rows
from graspdb.store.content import content_key
from graspdb.store.fence import Patience, commit_properties
from graspdb.store.layout import bring_up_to_date, first_line, read_rows
from graspdb.store.location import Location
from graspdb.store.lock import writing
from graspdb.store.open_tables import quoted
from graspdb_schemas.errors import DatabaseError, ParameterError, nearest
from graspdb_schemas.tables import TABLES


class Kind(StrEnum):
    """What can be taken out of a database."""

    TRIAL = "trial"
    SESSION = "session"
    SUBJECT = "subject"


@dataclass(frozen=True)
class Removed:
    """What was taken out.

    Attributes
    ----------
    trials : tuple of str
        Keys of the trials.
    manifests : int
        Stored manifests of their sessions that were rewritten without them.
    """

    trials: tuple[str, ...]
    manifests: int


def remove(root: Location, tables: Mapping[str, DeltaTable], kind: Kind, keys: Sequence[str]) -> Removed:
    """Take trials out of a database in one step, and out of the stored manifests of their sessions.

    Their rows, and what no other trial stands on, are dead from then on: `sweep` deletes them, and `optimize`
    with no retention leaves no byte of them.

    Parameters
    ----------
    root : Path or ObjectStorage
        The database's folder.
    tables : mapping of str to DeltaTable
        Its open tables; they are brought up to date.
    kind : Kind
        What the keys name.
    keys : sequence of str
        Trials as ``<session>/<trial>``, subjects as ``<session>/<subject>``, or sessions.

    Raises
    ------
    ParameterError
        Nothing has one of the keys.
    DatabaseError
        The database cannot be written, or other writers leave no turn.
    """
    with writing(root):
        for name, table in tables.items():
            bring_up_to_date(root, name, table)
        patience = Patience(root)
        while True:
            tables["trials"].update_incremental()
            try:
                return _remove(root, tables, kind, keys)
            except CommitFailedError:
                patience.pause()


def _remove(root: Location, tables: Mapping[str, DeltaTable], kind: Kind, keys: Sequence[str]) -> Removed:
    """Do it on the version of `trials` that is loaded; fails if another commit comes in between."""
    table = tables["trials"]
    stored = read_rows("trials", table, ["session", "trial", "subject", "context"])
    named = _named(stored, kind)
    for key in keys:
        if key not in named:
            hint = nearest(key, sorted(set(named)))
            raise ParameterError(str(kind), key, f"a {kind} of the database{hint}")
    doomed = pc.is_in(pa.array(named, pa.string()), pa.array(list(keys), pa.string()))
    going = stored.filter(doomed)
    sessions = going["session"].unique().to_pylist()
    of_sessions = pc.is_in(stored["session"], pa.array(sessions, pa.string()))
    staying = stored.filter(pc.and_(of_sessions, pc.invert(doomed)))
    renamed = _rewrite_manifests(root, tables["sessions"], going, staying, kind)
    rows = read_rows("trials", table, TABLES["trials"].names, f"session IN ({quoted(sessions)})")
    rows = rows.filter(pc.is_in(rows["trial"], staying["trial"].combine_chunks()))
    _replace(root, table, sessions, _with_context(rows, renamed), going.num_rows)
    return Removed(tuple(sorted(going["trial"].to_pylist())), len(renamed))


def _named(trials: pa.Table, kind: Kind) -> list[str]:
    """Return for each trial the key that it has as what is to be removed."""
    if kind != Kind.SUBJECT:
        return list(trials[str(kind)].to_pylist())
    pairs = zip(trials["session"].to_pylist(), trials["subject"].to_pylist(), strict=True)
    return [f"{session}/{subject}" for session, subject in pairs]


def _rewrite_manifests(
    root: Location, sessions: DeltaTable, going: pa.Table, staying: pa.Table, kind: Kind
) -> dict[str, str]:
    """Write the manifests that staying trials stand on without those that go: old ingest_id -> new one."""
    sessions.update_incremental()
    ids = staying["context"].combine_chunks().flatten().unique()
    if not len(ids):
        return {}
    gone_trials = set(going["trial"].to_pylist())
    pairs = zip(going["session"].to_pylist(), going["subject"].to_pylist(), strict=True)
    gone_subjects = set(pairs) if kind == Kind.SUBJECT else set()
    stored = read_rows("sessions", sessions, TABLES["sessions"].names)
    stored = stored.filter(pc.is_in(stored["ingest_id"], ids)).sort_by("ingest_id")
    renamed: dict[str, str] = {}
    changed = []
    for row in stored.to_pylist():
        manifest = None if row["manifest"] is None else json.loads(row["manifest"])
        shorter = _without(row["session"], manifest, gone_trials, gone_subjects)
        if shorter == manifest:
            continue
        text = json.dumps(shorter, default=str, sort_keys=True)
        own = pa.Table.from_pylist([row | {"manifest": text}], TABLES["sessions"]).drop_columns("ingest_id")
        # Ids of later rows sort after those of earlier ones, as before.
        renamed[row["ingest_id"]] = f"{fresh_id()}-{content_key({'sessions': own})}"
        changed.append(stamped("sessions", own, renamed[row["ingest_id"]]))
    if changed:
        append_rows(root, "sessions", sessions, pa.concat_tables(changed))
    return renamed


def _without(session: str, manifest: Any, trials: set[str], subjects: set[tuple[str, str]]) -> Any:
    """Return a manifest without some trials and subjects."""
    if not isinstance(manifest, dict) or not isinstance(manifest.get("trials"), list):
        return manifest
    kept = [
        entry
        for entry in manifest["trials"]
        if f"{session}/{PurePosixPath(entry['file']).stem}" not in trials
        and (session, entry["subject"]) not in subjects
    ]
    people = {
        name: entry for name, entry in manifest.get("subjects", {}).items() if (session, name) not in subjects
    }
    return {**manifest, "trials": kept, "subjects": people}


def _with_context(rows: pa.Table, renamed: Mapping[str, str]) -> pa.Table:
    """Return rows of `trials` that stand on the rewritten manifests."""
    context = [[renamed.get(key, key) for key in keys] for keys in rows["context"].to_pylist()]
    place = rows.column_names.index("context")
    column = pa.array(context, rows.schema.field(place).type)
    return rows.set_column(place, rows.schema.field(place), column)


def _replace(
    root: Location, table: DeltaTable, sessions: Sequence[str], rows: pa.Table, removed: int
) -> None:
    """Leave of some sessions' trials the given rows: the commit point."""
    predicate = f"session IN ({quoted(sessions)})"
    properties = commit_properties(table, "remove", removed=removed)
    if rows.num_rows:
        write_rows(root, "trials", table, rows, properties, predicate)
        return
    try:
        table.delete(predicate, commit_properties=properties)
    except CommitFailedError:
        raise
    except (DeltaError, OSError) as error:
        raise DatabaseError(
            root, f"cannot write to table 'trials': {first_line(error)}", "Free space, then run again."
        ) from error
