"""What is removed is gone for readers at once, and from the disk after optimize without retention."""

import json
from pathlib import Path
from typing import Any

import pytest
from handmade import N_FRAMES, session_tables, trial_tables
from removed_person import PERSON, fill, is_trace

import graspdb
from graspdb.store import Store
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.tables import TABLES


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return fill(tmp_path / "db")


def traces(path: Path) -> list[str]:
    """Return every file with a trace of the person."""
    files = [file for file in path.rglob("*") if file.is_file()]
    return [str(file.relative_to(path)) for file in files if is_trace(file.name, file.read_bytes())]


def test_a_subject_is_gone_and_after_optimize_no_byte_is_left(store: Store) -> None:
    assert graspdb.remove(store.path, "subject", [f"s/{PERSON}"]).trials == (
        f"s/{PERSON}_mug_0",
        f"s/{PERSON}_mug_1",
    )
    with graspdb.open(store.path) as database:
        assert PERSON not in repr([database.table(name).to_pylist() for name in TABLES])
        assert database.table("trials")["subject"].unique().to_pylist() == ["anna"]
        assert json.loads(database.table("sessions")["manifest"][0].as_py()) == {
            "subjects": {"anna": {"hand_length": 190}},
            "trials": [{"file": "trials/anna_mug_0.c3d", "subject": "anna"}],
        }
    found = set(traces(store.path))
    assert any("_delta_log" in file for file in found), "the search does find what is left before"
    assert {name for name in TABLES if any(file.startswith(f"{name}/part") for file in found)} >= {
        "sessions",
        "subjects",
        "hands",
        "trials",
        "frames",
        "markers",
        "grasps",
    }
    graspdb.optimize(store.path, retention_hours=0)
    assert traces(store.path) == []
    assert graspdb.verify(store.path).whole
    with graspdb.open(store.path) as database:
        assert database.table("frames").num_rows == 2 * N_FRAMES


def test_what_others_wrote_in_compacted_files_goes_too(store: Store) -> None:
    store.optimize()
    graspdb.remove(store.path, "subject", [f"s/{PERSON}"])
    graspdb.optimize(store.path, retention_hours=0)
    assert traces(store.path) == []
    assert graspdb.verify(store.path).whole


def test_a_trial_goes_alone(store: Store) -> None:
    graspdb.remove(store.path, "trial", ["s/anna_mug_0", f"s/{PERSON}_mug_1"])
    with graspdb.open(store.path) as database:
        assert sorted(database.table("trials")["trial"].to_pylist()) == ["s/anna_mug_1", f"s/{PERSON}_mug_0"]
        kept: dict[str, Any] = json.loads(database.table("sessions")["manifest"][0].as_py())
        assert [entry["file"] for entry in kept["trials"]] == [f"trials/{PERSON}_mug_0.c3d"]
        assert sorted(kept["subjects"]) == ["anna", PERSON]
        assert database.grasp("s/anna_mug_1/right/0").contact_points.shape == (3, 3)


def test_a_session_goes_with_all_that_stands_on_it(store: Store) -> None:
    store.commit_session(session_tables("other"))
    store.commit_trial(trial_tables(1, session="other"))
    graspdb.remove(store.path, "session", ["s"])
    store.optimize()
    with graspdb.open(store.path) as database:
        assert {
            name: set(database.table(name)["session"].to_pylist()) for name in ("sessions", "objects")
        } == {
            "sessions": {"other"},
            "objects": {"other"},
        }
    assert graspdb.verify(store.path).whole
    graspdb.remove(store.path, "session", ["other"])
    with graspdb.open(store.path) as database:
        assert set(database.info().rows.values()) == {0}


def test_removing_is_one_step_and_a_removed_trial_may_come_back(store: Store) -> None:
    before = store.snapshot().versions["trials"]
    graspdb.remove(store.path, "trial", ["s/anna_mug_0"])
    assert store.snapshot().versions["trials"] == before + 1
    store.commit_session(session_tables(subjects=["anna"]))
    store.commit_trial(trial_tables(0))
    assert graspdb.verify(store.path).whole


@pytest.mark.parametrize(
    ("kind", "key", "message"),
    [
        ("trial", "s/anna_mug_9", "did you mean 's/anna_mug_"),
        ("subject", "anna", "a subject of the database"),
        ("session", "S", "a session of the database"),
        ("trails", "s", "kind: found 'trails'; allowed: trial, session, subject"),
    ],
)
def test_an_unknown_key_removes_nothing(store: Store, kind: str, key: str, message: str) -> None:
    before = store.snapshot().versions
    with pytest.raises(ParameterError, match=message):
        graspdb.remove(store.path, kind, ["s/anna_mug_0", key] if kind == "trial" else [key])
    assert store.snapshot().versions == before
