"""Sweeping takes what is dead, and nothing else, whatever else is going on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deltalake import DeltaTable
from handmade import N_FRAMES, N_POINTS, session_tables, trial_tables

import graspdb
from graspdb.store import Outcome, Store, commit, snapshot
from graspdb_schemas.tables import TABLES


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    opened.commit_trial(trial_tables(1))
    return opened


def stored(store: Store) -> dict[str, int]:
    """Return the rows of each table, seen or not."""
    return {name: DeltaTable(str(store.path / name)).scan().read_all().num_rows for name in TABLES}


def leave_dead_rows(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupt an ingest of a new trial of a new session."""
    store.commit_session(session_tables("dead"))
    with monkeypatch.context() as patched:
        patched.setattr(commit, "_publish", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            store.commit_trial(trial_tables(1, session="dead"))


def test_nothing_dead_makes_no_new_version(store: Store) -> None:
    before = store.snapshot().versions
    assert store.sweep() == {}
    assert store.snapshot().versions == before


def test_interrupted_rows_are_taken(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    before = stored(store)
    leave_dead_rows(store, monkeypatch)
    assert stored(store)["frames"] == 2 * N_FRAMES
    deleted = store.sweep()
    assert deleted["frames"] == N_FRAMES
    assert deleted["object_points"] == N_POINTS
    assert stored(store) == before
    assert store.sweep() == {}


def test_replaced_rows_are_taken_and_what_others_stand_on_stays(store: Store) -> None:
    store.commit_trial(trial_tables(2))
    store.commit_session(session_tables(size=2.0))
    store.commit_trial(trial_tables(1, input_key="other"))
    deleted = store.sweep()
    assert deleted == {
        "markers": N_FRAMES,
        "frames": N_FRAMES,
        "grasps": 1,
        "contacts": 3,
        "features": 1,
        "reference_contacts": 2,
    }
    store.commit_trial(trial_tables(2, input_key="other"))
    assert store.sweep() == {**deleted, "objects": 1, "object_points": N_POINTS}
    with graspdb.open(store.path) as database:
        assert database.table("object_points")["position"].to_pylist()[1] == [2.0, 0.0, 0.0]


def test_compacted_files_are_swept_row_by_row(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    leave_dead_rows(store, monkeypatch)
    store.commit_trial(trial_tables(3))
    for name in TABLES:
        DeltaTable(str(store.path / name)).optimize.compact()
    with graspdb.open(store.path) as database:
        assert any(source.mixed_files for source in database.snapshot.sources.values())
        assert database.table("frames").num_rows == 2 * N_FRAMES
        assert set(database.table("frames")["trial"].to_pylist()) == {"s/anna_mug_1", "s/anna_mug_3"}
    assert Store.open(store.path).sweep()["frames"] == N_FRAMES
    assert stored(store)["frames"] == 2 * N_FRAMES


def between_rows_and_commit(monkeypatch: pytest.MonkeyPatch, act: Callable[[], Any]) -> None:
    """Do something once, after an ingest has written its rows and before it is committed."""
    publish = commit._publish
    done: list[bool] = []

    def first_act(*arguments: Any) -> Any:
        if not done:
            done.append(True)
            act()
        return publish(*arguments)

    monkeypatch.setattr(commit, "_publish", first_act)


def test_an_ingest_under_way_loses_nothing_to_a_sweep(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    other = Store.open(store.path)
    swept: list[dict[str, int]] = []
    between_rows_and_commit(monkeypatch, lambda: swept.append(other.sweep()))
    assert store.commit_trial(trial_tables(2)).outcome == Outcome.ADDED
    assert swept[0]["frames"] == N_FRAMES, "the sweep did take the rows of the ingest under way"
    with graspdb.open(store.path) as database:
        assert database.table("frames").num_rows == 2 * N_FRAMES
        assert database.grasp("s/anna_mug_2/right/0").contact_points.shape == (3, 3)
    assert store.sweep() == {}


def test_rows_that_an_ingest_counts_on_may_lose_their_last_trial(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def replace_and_sweep() -> None:
        other = Store.open(store.path)
        other.commit_session(session_tables(size=2.0))
        other.commit_trial(trial_tables(1, input_key="other"))
        assert other.sweep()["objects"] == 1

    between_rows_and_commit(monkeypatch, replace_and_sweep)
    store.commit_trial(trial_tables(2))
    with graspdb.open(store.path) as database:
        assert database.grasp("s/anna_mug_1/right/0").feature_cloud[:, 0].tolist() == [2.0, 6.0]
        assert database.grasp("s/anna_mug_2/right/0").feature_cloud[:, 0].tolist() == [1.0, 3.0]


def test_two_ingests_of_the_same_object_at_once_keep_it_once(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = Store.open(store.path), Store.open(store.path)
    for each in (first, second):
        each.commit_session(session_tables("t"))
    between_rows_and_commit(monkeypatch, lambda: second.commit_trial(trial_tables(2, session="t")))
    first.commit_trial(trial_tables(1, session="t"))
    with graspdb.open(store.path) as database:
        assert database.sql("SELECT count(*) FROM objects WHERE session = 't'").rows() == [(1,)]
        assert database.sql("SELECT count(*) FROM trials WHERE session = 't'").rows() == [(2,)]
    assert store.sweep() == {
        "sessions": 1,
        "subjects": 1,
        "hands": 1,
        "objects": 1,
        "object_points": N_POINTS,
    }
    with graspdb.open(store.path) as database:
        assert database.grasp("t/anna_mug_1/right/0").feature_cloud.shape == (2, 3)


def test_the_same_trial_ingested_twice_at_once_is_there_once(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Store.open(store.path)
    between_rows_and_commit(monkeypatch, lambda: other.commit_trial(trial_tables(2)))
    assert store.commit_trial(trial_tables(2)).outcome == Outcome.UNCHANGED
    with graspdb.open(store.path) as database:
        assert database.table("trials").num_rows == 2
        assert database.table("frames").num_rows == 2 * N_FRAMES


def test_a_snapshot_is_taken_again_if_its_trials_are_swept_meanwhile(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_table = snapshot.open_table
    done: list[bool] = []

    def replace_first(root: Path, name: str) -> DeltaTable:
        if name != "trials" and not done:
            done.append(True)
            store.commit_trial(trial_tables(1), force=True)
            store.sweep()
        return open_table(root, name)

    monkeypatch.setattr(snapshot, "open_table", replace_first)
    with graspdb.open(store.path) as database:
        assert done
        assert database.table("frames").num_rows == N_FRAMES
        assert database.table("trials").num_rows == 1


def test_a_snapshot_outlives_replacement_and_sweep(store: Store) -> None:
    with graspdb.open(store.path) as database:
        store.commit_trial(trial_tables(1, sites=["thumb_tip"]), force=True)
        store.commit_trial(trial_tables(2))
        store.sweep()
        assert database.table("contacts").num_rows == 3
        assert database.table("trials").num_rows == 1
    with graspdb.open(store.path) as database:
        assert database.table("contacts").num_rows == 4
