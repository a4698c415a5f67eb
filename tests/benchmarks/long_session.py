"""A session of many trials: a few simulated ones, committed again and again by other names."""

from pathlib import Path
from typing import Final

import pyarrow as pa

import graspdb
from graspdb.simulate import simulate_session
from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables
from graspdb_queries.quoting import identifier
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.tables import SESSION_TABLES, TABLES

SESSION: Final = "many"
_AT_ONCE: Final = 20
"""Trials of one commit."""


def build(folder: Path, n_trials: int) -> Path:
    """Write a database with a session of so many trials, and return it."""
    simulate_session(folder / "session", subjects=1, trials=1, seed=0)
    graspdb.ingest(folder / "session", db=folder / "few", workers=2)
    store = Store.create_or_open(folder / "many")
    with graspdb.open(folder / "few") as few:
        store.commit_session(TrialTables({name: _rows(few, name) for name in SESSION_TABLES}))
        trials = [row[0] for row in few.sql("SELECT trial FROM trials ORDER BY trial").rows()]
        copies = [_copy(few, trials[i % len(trials)], i) for i in range(n_trials)]
    for start in range(0, n_trials, _AT_ONCE):
        store.commit_trials(copies[start : start + _AT_ONCE])
    return folder / "many"


def _rows(
    database: graspdb.Database, name: str, trial: str | None = None, copy: str | None = None
) -> pa.Table:
    """Return rows of a table in the session `SESSION`; those of a trial by the name of its copy."""
    columns = rows_schema(name).names
    renamed = {"session": "$session", "trial": "$copy", "grasp": "$copy || substr(grasp, len($trial) + 1)"}
    renamed |= {"input_key": "$copy"} if name == "trials" else {}
    if trial is None:
        renamed = {"session": "$session"}
    select = ", ".join(f"{renamed[c]} AS {c}" if c in renamed else identifier(c) for c in columns)
    where = " WHERE trial = $trial" if trial is not None else ""
    given = {"session": SESSION, "trial": trial, "copy": copy}
    statement = f"SELECT {select} FROM {name}{where}"
    used = {key: value for key, value in given.items() if f"${key}" in statement}
    return database.sql(statement, **used).table


def _copy(database: graspdb.Database, trial: str, number: int) -> TrialTables:
    copy = f"{SESSION}/{trial.partition('/')[2]}_{number:04}"
    names = [name for name in TABLES if name not in SESSION_TABLES]
    return TrialTables({name: _rows(database, name, trial, copy) for name in names})
