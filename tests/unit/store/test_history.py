"""Earlier states are read as they were, for as long as they are kept."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from handmade import N_FRAMES, session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb.store.history import read_history
from graspdb_schemas.errors import DatabaseError, ParameterError

Rows = dict[str, list[object]]
LOOKED_AT = ("trials", "frames", "contacts", "sessions", "object_points")
"""Tables of every kind: the commit point, rows of trials, rows that trials share."""


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    return opened


def rows(path: Path, as_of: int | datetime | None = None) -> Rows:
    with graspdb.open(path, as_of=as_of) as database:
        return {name: sorted(map(str, database.table(name).to_pylist())) for name in LOOKED_AT}


def grow(store: Store) -> dict[int, Rows]:
    """Add, replace, sweep and remove; return the rows that each version showed when it was the latest."""
    seen = {0: rows(store.path)}

    def note() -> None:
        seen[store.snapshot().versions["trials"]] = rows(store.path)

    for number in range(3):
        store.commit_trial(trial_tables(number))
        note()
    store.commit_trial(trial_tables(1, input_key="new", sites=["thumb_tip"]))
    note()
    store.sweep()
    note()
    graspdb.remove(store.path, "trial", ["s/anna_mug_2"])
    note()
    store.commit_trial(trial_tables(4))
    note()
    return seen


def test_every_version_is_read_as_it_was_whatever_came_after(store: Store) -> None:
    seen = grow(store)
    assert {v: rows(store.path, v) for v in seen} == seen
    store.optimize()
    assert {v: rows(store.path, v) for v in seen} == seen
    store.commit_trial(trial_tables(4), force=True)
    store.sweep()
    assert {v: rows(store.path, v) for v in seen} == seen


def test_a_time_is_the_last_version_committed_by_then(store: Store) -> None:
    seen = grow(store)
    changes = read_history(store.path)
    for change in changes:
        if change.version in seen:
            assert rows(store.path, change.time) == rows(store.path, change.version)
    assert rows(store.path, datetime.now(UTC)) == rows(store.path)
    local = changes[0].time.astimezone().replace(tzinfo=None)
    assert rows(store.path, local) == rows(store.path, changes[0].version)
    with pytest.raises(ParameterError, match="nothing older is kept"):
        graspdb.open(store.path, as_of=changes[-1].time - timedelta(seconds=1))


def test_the_history_says_what_happened(store: Store) -> None:
    grow(store)
    store.optimize()
    told = [(c.action, c.added, c.replaced, c.removed) for c in reversed(read_history(store.path))]
    assert told[:8] == [
        ("create", 0, 0, 0),
        ("ingest", 1, 0, 0),
        ("ingest", 1, 0, 0),
        ("ingest", 1, 0, 0),
        ("ingest", 0, 1, 0),
        ("sweep", 0, 0, 0),
        ("remove", 0, 0, 1),
        ("ingest", 1, 0, 0),
    ]
    assert ("compact", 0, 0, 0) in told[8:]


@pytest.mark.parametrize("version", [-1, 99])
def test_a_version_that_never_was_is_refused(store: Store, version: int) -> None:
    with pytest.raises(ParameterError, match="a version from 0 to 0, or a time"):
        graspdb.open(store.path, as_of=version)


def test_a_state_whose_files_are_gone_is_refused_and_not_answered_in_part(store: Store) -> None:
    seen = grow(store)
    store.optimize(0)
    for version in seen:
        with pytest.raises(DatabaseError, match="no longer kept"):
            graspdb.open(store.path, as_of=version)
    assert len(rows(store.path)["frames"]) == 3 * N_FRAMES
