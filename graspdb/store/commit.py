"""Committing trials: other rows first, the row in `trials` last and atomically.

docs/store.md says in plain words what this promises and why it holds.
"""

import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import pyarrow as pa
from deltalake import CommitProperties, DeltaTable, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError

from graspdb.store.bundle import Trial
from graspdb.store.encoding import encoding
from graspdb.store.fence import Patience, commit_properties
from graspdb.store.layout import bring_up_to_date, first_line
from graspdb.store.location import Location
from graspdb.store.lock import writing
from graspdb.store.open_tables import OpenTables, State, quoted
from graspdb_schemas.conform import conform
from graspdb_schemas.errors import DatabaseError, ParameterError
from graspdb_schemas.tables import TABLES


class Outcome(StrEnum):
    """What a commit did with a trial."""

    ADDED = "added"
    REPLACED = "replaced"
    UNCHANGED = "unchanged"


@dataclass(frozen=True)
class Committed:
    """What became of one trial.

    Attributes
    ----------
    trial : str
        Key of the trial.
    outcome : Outcome
        Added, replaced, or unchanged since its input_key stands in the database already.
    """

    trial: str
    outcome: Outcome


@dataclass(frozen=True)
class _Prepared:
    """A trial with its fresh ingest_id and the session-level rows it stands on: content key -> ingest_id."""

    trial: Trial
    ingest_id: str
    context: Mapping[str, str]


def commit_trials(
    root: Location, tables: OpenTables, trials: Sequence[Trial], force: bool
) -> tuple[Committed, ...]:
    """Commit trials together: all of them become visible in one step, or none.

    Parameters
    ----------
    root : Path or ObjectStorage
        The database's folder, for messages.
    tables : OpenTables
        Its open tables; they are brought up to date.
    trials : sequence of Trial
        The trials, each at most once.
    force : bool
        Whether to replace a trial that has not changed.

    Raises
    ------
    ParameterError
        A trial is given twice.
    DatabaseError
        The database cannot be written, or other writers leave no turn.
    """
    keys = [trial.key for trial in trials]
    if len(set(keys)) != len(keys):
        raise ParameterError("trials", max(keys, key=keys.count), "each trial once")
    tables.open_grown_anew()
    with writing(root):
        return _commit(root, tables, trials, force)


def _commit(
    root: Location, tables: OpenTables, trials: Sequence[Trial], force: bool
) -> tuple[Committed, ...]:
    keys = [trial.key for trial in trials]
    for name, table in tables.items():
        bring_up_to_date(root, name, table)
    patience = Patience(root)
    while True:
        state = tables.state(trials)
        todo = [trial for trial in trials if force or not state.unchanged(trial)]
        if not todo:
            return tuple(Committed(key, Outcome.UNCHANGED) for key in keys)
        prepared, rows = _prepare(todo, state)
        for name, parts in rows.items():
            append_rows(root, name, tables[name], pa.concat_tables(parts))
        outcomes = _publish(root, tables, prepared, state, force)
        if outcomes is not None:
            return tuple(Committed(key, outcomes.get(key, Outcome.UNCHANGED)) for key in keys)
        patience.pause()


def fresh_id() -> str:
    """Return an ingest_id that no other ingest has; later ones sort after earlier ones."""
    return f"{time.time_ns():016x}-{secrets.token_hex(6)}"


def _prepare(trials: Sequence[Trial], state: State) -> tuple[list[_Prepared], dict[str, list[pa.Table]]]:
    """Give every trial a fresh ingest_id, and return the rows to write before the trials' own."""
    known = dict(state.contexts)
    rows: dict[str, list[pa.Table]] = {}
    prepared = []
    for trial in trials:
        for unit in trial.units:
            if unit.content_key not in known:
                known[unit.content_key] = f"{fresh_id()}-{unit.content_key}"
                for name, table in unit.tables.items():
                    rows.setdefault(name, []).append(stamped(name, table, known[unit.content_key]))
        ingest_id = fresh_id()
        for name, table in trial.tables.items():
            rows.setdefault(name, []).append(stamped(name, table, ingest_id))
        context = {unit.content_key: known[unit.content_key] for unit in trial.units}
        prepared.append(_Prepared(trial, ingest_id, context))
    return prepared, rows


def _publish(
    root: Location, tables: OpenTables, prepared: Sequence[_Prepared], state: State, force: bool
) -> dict[str, Outcome] | None:
    """Write the rows in `trials`: the commit point.

    Returns
    -------
    dict of str to Outcome, or None
        What became of each trial written; None if a sweep came between, so that rows written before
        it may be gone.
    """
    patience = Patience(root)
    expected = state.generation
    while state.generation == expected:
        todo = [item for item in prepared if force or not state.unchanged(item.trial)]
        if not todo:
            return {}
        context = {item.trial.key: _context(item, state) for item in todo}
        rows = pa.concat_tables([_trial_row(item, context[item.trial.key]) for item in todo])
        keys = [item.trial.key for item in todo]
        replaced = [key for key in keys if key in state.input_keys]
        predicate = f"trial IN ({quoted(keys)})" if replaced else None
        properties = commit_properties(
            tables["trials"], "ingest", added=len(keys) - len(replaced), replaced=len(replaced)
        )
        try:
            write_rows(root, "trials", tables["trials"], rows, properties, predicate)
        except CommitFailedError:
            patience.pause()
            state = tables.state([item.trial for item in prepared])
            continue
        tables.follow(state, {item.trial.key: item.trial.input_key for item in todo}, context)
        return {key: Outcome.REPLACED if key in replaced else Outcome.ADDED for key in keys}
    return None


def _context(item: _Prepared, state: State) -> list[str]:
    """Return the session-level rows a trial stands on; those another writer has committed meanwhile win."""
    return [state.contexts.get(key, ingest_id) for key, ingest_id in item.context.items()]


def _trial_row(item: _Prepared, context: list[str]) -> pa.Table:
    """Return the row in `trials`."""
    counts = [(name, table.num_rows) for name, table in item.trial.tables.items()]
    added: dict[str, Any] = {
        "context": context,
        "table_rows": counts,
        "table_hashes": list(item.trial.hashes.items()),
    }
    row = item.trial.row
    for column, value in added.items():
        row = row.append_column(column, pa.array([value], TABLES["trials"].field(column).type))
    return stamped("trials", row, item.ingest_id)


def stamped(name: str, table: pa.Table, ingest_id: str) -> pa.Table:
    """Return a table's rows with their ingest_id, as declared."""
    stamp = pa.repeat(pa.scalar(ingest_id, pa.string()), table.num_rows)
    return conform(table.append_column("ingest_id", stamp), TABLES[name], name)


def append_rows(root: Location, name: str, table: DeltaTable, rows: pa.Table) -> None:
    """Append rows to a table whose rows stay unseen until `trials` names their ingest_id."""
    patience = Patience(root)
    while True:
        # A table that was opened before its log was shortened could not be written to.
        table.update_incremental()
        try:
            return write_rows(root, name, table, rows, CommitProperties(max_commit_retries=100), None)
        except CommitFailedError:
            patience.pause()


def write_rows(
    root: Location,
    name: str,
    table: DeltaTable,
    rows: pa.Table,
    properties: CommitProperties,
    predicate: str | None,
) -> None:
    """Append rows, or put them in the place of those that a predicate names, in one Delta commit."""
    how = encoding(name)
    try:
        if predicate is None:
            write_deltalake(table, rows, mode="append", commit_properties=properties, writer_properties=how)
        else:
            write_deltalake(
                table,
                rows,
                mode="overwrite",
                predicate=predicate,
                commit_properties=properties,
                writer_properties=how,
            )
    except CommitFailedError:
        raise
    except (DeltaError, OSError) as error:
        raise DatabaseError(
            root,
            f"cannot write to table {name!r}: {first_line(error)}",
            "What was committed before is safe; free space or permissions, then run again.",
        ) from error
