"""A database of many small trials, written into the tables as the store writes them."""

import sys
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable, write_deltalake

sys.path.append(str(Path(__file__).resolve().parents[1]))

from handmade import session_tables, trial_tables

from graspdb.store import Store
from graspdb.store.encoding import encoding
from graspdb.store.layout import read_rows
from graspdb_schemas.tables import TABLES, TRIAL_TABLES

PER_SESSION: Final = 100
PER_FILE: Final = 2000


def build(path: Path, n_trials: int) -> Store:
    """Write and optimize a database of `n_trials` trials in sessions of 100; each has rows in every table."""
    store = Store.create_or_open(path)
    n_sessions = -(-n_trials // PER_SESSION)
    for session in range(n_sessions):
        store.commit_session(session_tables(_session(session), subjects=["anna"]))
    firsts = [trial_tables(0, session=_session(session)) for session in range(n_sessions)]
    store.commit_trials(firsts)
    others = np.array([t for t in range(n_trials) if t % PER_SESSION])
    stored = {
        name: read_rows(name, DeltaTable(str(path / name)), TABLES[name].names)
        for name in ("trials", *TRIAL_TABLES)
    }
    for start in range(0, len(others), PER_FILE):
        _append(path, stored, others[start : start + PER_FILE])
    store = Store.open(path)
    store.optimize()
    return store


def _session(number: int) -> str:
    return f"study-{number:04}"


def _append(path: Path, stored: dict[str, pa.Table], trials: np.ndarray) -> None:
    """Append copies of the first trial, under keys and ingests of their own."""
    first = {row["session"]: row["context"] for row in stored["trials"].to_pylist()}
    sessions = [_session(trial // PER_SESSION) for trial in trials]
    keys = [f"{session}/anna_mug_{trial}" for session, trial in zip(sessions, trials, strict=True)]
    one = stored["trials"]["ingest_id"][0]
    ids = [f"{2**60 + int(trial):016x}-{int(trial):012x}" for trial in trials]
    for name in (*TRIAL_TABLES, "trials"):
        table = stored[name]
        own = table.filter(pc.equal(table["ingest_id"], one))
        if not own.num_rows:
            continue
        n = own.num_rows
        place = pa.array(np.repeat(np.arange(len(trials)), n))
        rows = own.take(np.tile(np.arange(n), len(trials)))
        columns = {
            "ingest_id": pa.array(ids).take(place),
            "trial": pa.array(keys).take(place),
            "session": pa.array(sessions).take(place),
            "grasp": pa.array([f"{key}/right/0" for key in keys]).take(place),
            "context": pa.array([first[session] for session in sessions], pa.list_(pa.string())).take(place),
        }
        for column, values in columns.items():
            if column in rows.column_names:
                rows = rows.set_column(rows.column_names.index(column), column, values)
        write_deltalake(
            str(path / name), rows.cast(TABLES[name]), mode="append", writer_properties=encoding(name)
        )
