"""Several processes on one database: nothing lost, nothing doubled, readers see whole states."""

import multiprocessing
import sys
from pathlib import Path
from typing import Any

import pytest
from handmade import N_FRAMES, session_tables, trial_tables

import graspdb
from graspdb.store import Store

N_TRIALS = 12
CONTEXT = multiprocessing.get_context("spawn")


def ingest(path: str, session: str, force: bool) -> None:
    """Create or open the database and commit trials of one session, one by one."""
    store = Store.create_or_open(path)
    store.commit_session(session_tables(session))
    for number in range(N_TRIALS):
        store.commit_trial(trial_tables(number, session=session), force=force)


def sweep(path: str, times: int) -> None:
    """Sweep a number of times."""
    store = Store.open(path)
    for _ in range(times):
        store.sweep()


def optimize(path: str, retention_hours: int) -> None:
    """Optimize a number of times."""
    store = Store.open(path)
    for _ in range(5):
        store.optimize(retention_hours)


def started(target: Any, *arguments: Any) -> Any:
    process = CONTEXT.Process(target=target, args=arguments)
    process.start()
    return process


@pytest.fixture(autouse=True)
def _children_find_the_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setitem(sys.modules, Path(__file__).stem, sys.modules[__name__])


def check(path: Path, sessions: list[str]) -> None:
    with graspdb.open(path) as database:
        trials = database.table("trials")["trial"].to_pylist()
        assert sorted(trials) == sorted(f"{name}/anna_mug_{i}" for name in sessions for i in range(N_TRIALS))
        frames = database.sql("SELECT trial, count(*) FROM frames GROUP BY trial").rows()
        assert dict(frames) == dict.fromkeys(trials, N_FRAMES)
        assert database.sql(
            "SELECT session, count(*) FROM objects GROUP BY session ORDER BY session"
        ).rows() == [(name, 1) for name in sorted(sessions)]
        assert database.info().several_versions == ()


def test_processes_that_create_and_fill_one_database_at_once(tmp_path: Path) -> None:
    path = tmp_path / "db"
    processes = [started(ingest, str(path), name, False) for name in ("a", "b", "b")]
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0, 0]
    check(path, ["a", "b"])


def test_readers_see_whole_states_while_others_write_and_sweep(tmp_path: Path) -> None:
    path = tmp_path / "db"
    ingest(str(path), "a", False)
    processes = [
        started(ingest, str(path), "a", True),
        started(ingest, str(path), "b", False),
        started(sweep, str(path), 10),
    ]
    seen = 0
    while any(process.is_alive() for process in processes):
        with graspdb.open(path) as database:
            torn = database.sql(
                """
                SELECT trial FROM trials
                LEFT JOIN (SELECT trial, count(*) AS n FROM frames GROUP BY trial) USING (trial)
                WHERE n IS DISTINCT FROM $n
                """,
                n=N_FRAMES,
            )
            assert torn.rows() == []
            twice = database.sql("SELECT trial FROM trials GROUP BY trial HAVING count(*) > 1")
            assert twice.rows() == []
            trials = database.sql("SELECT count(*) FILTER (session = 'a') FROM trials").rows()
            assert trials == [(N_TRIALS,)]
            seen += 1
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0, 0]
    assert seen > 3
    check(path, ["a", "b"])
    Store.open(path).sweep()
    check(path, ["a", "b"])


def test_two_ingests_and_an_optimize_beside_a_reader(tmp_path: Path) -> None:
    """Nothing fails, nothing is lost, and what was once committed is in every later answer, whole."""
    path = tmp_path / "db"
    ingest(str(path), "first", False)
    processes = [
        started(ingest, str(path), "a", False),
        started(ingest, str(path), "b", False),
        started(optimize, str(path), 168),
    ]
    trials: set[str] = set()
    answers = 0
    while any(process.is_alive() for process in processes):
        with graspdb.open(path) as database:
            counts = """
                SELECT trial, (SELECT count(*) FROM frames f WHERE f.trial = t.trial),
                    (SELECT count(*) FROM grasps g WHERE g.trial = t.trial)
                FROM trials t
            """
            seen = database.sql(counts).rows()
            assert {(frames, grasps) for _, frames, grasps in seen} == {(N_FRAMES, 1)}
            assert trials <= {trial for trial, *_ in seen}
            trials = {trial for trial, *_ in seen}
            assert database.sql(counts).rows() == seen, "one state, however often it is asked"
            answers += 1
    assert [process.exitcode for process in processes] == [0, 0, 0]
    assert answers > 3
    check(path, ["first", "a", "b"])
    assert graspdb.verify(path).whole


def test_ingests_beside_an_optimize_without_retention(tmp_path: Path) -> None:
    path = tmp_path / "db"
    ingest(str(path), "first", False)
    processes = [
        started(ingest, str(path), "a", False),
        started(ingest, str(path), "a", True),
        started(optimize, str(path), 0),
    ]
    for process in processes:
        process.join(240)
    assert [process.exitcode for process in processes] == [0, 0, 0]
    check(path, ["first", "a"])
    assert graspdb.verify(path).whole
