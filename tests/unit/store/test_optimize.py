"""Tidying up changes no answer, and makes files few."""

import os
import time
from pathlib import Path

import pytest
from deltalake import DeltaTable
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store, commit
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.tables import TABLES

WEEK = 7 * 24 * 3600


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    for number in range(4):
        opened.commit_trial(trial_tables(number))
    opened.commit_trial(trial_tables(2, input_key="new"))
    return opened


def answers(path: Path) -> dict[str, list[str]]:
    with graspdb.open(path) as database:
        return {name: sorted(map(str, database.table(name).to_pylist())) for name in TABLES}


def data_files(path: Path) -> list[Path]:
    return [file for file in path.rglob("*.parquet") if file.parent.name != "_delta_log"]


def test_no_answer_changes_and_each_table_has_one_file(store: Store) -> None:
    before = answers(store.path)
    done = store.optimize()
    assert answers(store.path) == before
    assert (done["frames"].files_before, done["frames"].files_after) == (5, 1)
    assert done["frames"].swept == 4
    assert {len(DeltaTable(str(store.path / name)).file_uris()) for name in TABLES} == {0, 1}
    assert graspdb.verify(store.path).whole


def test_all_rows_of_the_joined_files_are_read_without_a_filter(store: Store) -> None:
    store.optimize()
    sources = store.snapshot().sources
    assert not any(sources[name].mixed_files for name in ("frames", "grasps", "contacts", "features"))


def test_a_second_time_there_is_nothing_to_do(store: Store) -> None:
    store.optimize()
    before = store.snapshot().versions
    assert not any(table.swept or table.vacuumed for table in store.optimize().values())
    assert store.snapshot().versions == before


def test_a_young_database_keeps_its_past_and_an_open_one_its_answers(store: Store) -> None:
    files = set(data_files(store.path))
    with graspdb.open(store.path) as database:
        store.optimize()
        assert files <= set(data_files(store.path))
        assert database.sql("SELECT count(*) FROM frames").rows() == [(16,)]


def test_what_killed_writers_left_is_deleted_once_it_is_a_week_old(store: Store) -> None:
    orphans = [
        store.path / "frames" / "part-00000-orphan.parquet",
        store.path / "frames" / "part-00000-torn.parquet#1",
        store.path / "frames" / "_delta_log" / "_commit_torn.json.tmp",
    ]
    for file in orphans:
        file.write_bytes(b"half")
    store.optimize()
    assert all(file.exists() for file in orphans), "they may belong to a writer at work"
    for file in orphans:
        os.utime(file, (time.time() - WEEK - 60,) * 2)
    store.optimize()
    assert not any(file.exists() for file in orphans)


def test_without_retention_nothing_is_left_but_the_latest_state(store: Store) -> None:
    before = answers(store.path)
    store.optimize(0)
    assert answers(store.path) == before
    assert len(data_files(store.path)) == sum(
        len(DeltaTable(str(store.path / name)).file_uris()) for name in TABLES
    )
    assert all(len(list((store.path / name / "_delta_log").glob("*.json"))) == 1 for name in TABLES)


def test_an_open_store_goes_on_after_logs_were_shortened(store: Store) -> None:
    other = Store.open(store.path)
    store.optimize(0)
    other.commit_session(session_tables())
    other.commit_trial(trial_tables(9))
    assert graspdb.verify(store.path).whole


def test_files_of_a_commit_under_way_are_not_vacuumed(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A vacuum without retention waits while another writer has files on disk that no log names yet."""
    waited: list[bool] = []
    publish = commit._publish

    def publish_late(*arguments: object) -> object:
        if not waited:
            with monkeypatch.context() as patched:
                patched.setattr("graspdb.store.fence._PATIENCE", 0.05)
                with pytest.raises(graspdb.GraspDBError, match="other writers left no turn"):
                    Store.open(store.path).optimize(0)
            waited.append(True)
        return publish(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(commit, "_publish", publish_late)
    store.commit_trial(trial_tables(9))
    assert waited
    assert graspdb.verify(store.path).whole


def test_a_negative_retention_is_refused(store: Store) -> None:
    with pytest.raises(ParameterError, match="retention_hours: found -1"):
        graspdb.optimize(store.path, retention_hours=-1)
