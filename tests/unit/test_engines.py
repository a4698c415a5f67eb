"""Engines run every call once, in bounded memory, and say what a user has to know when a worker is lost."""

import operator
import os
import signal
from collections.abc import Iterator
from concurrent.futures import wait
from pathlib import Path

import pytest

from graspdb import engines
from graspdb.engines import CALLS_FOR_A_WORKER, Engine, EngineError, LocalEngine, make_engine
from graspdb_schemas.errors import ParameterError

WORKERS = 2


@pytest.fixture(params=[1, WORKERS])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    with LocalEngine(request.param) as opened:
        yield opened


def test_every_call_is_made_once_with_its_arguments(engine: Engine) -> None:
    results = [value for done in engine.run(pow, ((number, 2) for number in range(50))) for value in done]
    assert sorted(results) == [number**2 for number in range(50)]


def test_no_call_begins_while_results_wait_to_be_taken(engine: Engine) -> None:
    begun = []

    def calls() -> Iterator[tuple[int]]:
        for number in range(60):
            begun.append(number)
            yield (number,)

    taken = 0
    for done in engine.run(abs, calls()):
        assert len(begun) <= taken + CALLS_FOR_A_WORKER * WORKERS
        taken += len(done)
    assert taken == len(begun) == 60


def test_a_shared_value_is_the_same_in_every_worker(engine: Engine) -> None:
    value = {"points": bytearray(range(200))}
    shared = engine.share(value)
    loaded = [item for done in engine.run(operator.methodcaller("load"), [(shared,)] * 6) for item in done]
    assert loaded == [value] * 6


def test_nothing_shared_is_left_behind() -> None:
    with LocalEngine(1) as engine:
        path = engine.share("x").path  # type: ignore[attr-defined]
        assert path.exists()
    assert not Path(path.parent).exists()


def test_a_lost_worker_is_said_and_the_next_engine_works() -> None:
    with pytest.raises(EngineError, match="fewer --workers"), LocalEngine(WORKERS) as engine:
        list(engine.run(os._exit, [(9,)]))
    with LocalEngine(WORKERS) as engine:
        assert [value for done in engine.run(abs, [(-3,)]) for value in done] == [3]


def test_what_a_call_raises_is_raised(engine: Engine) -> None:
    with pytest.raises(ZeroDivisionError):
        list(engine.run(operator.truediv, [(1, 0)]))


def test_nothing_done_is_lost_where_a_call_fails() -> None:
    taken: list[float] = []

    def take(engine: Engine) -> None:
        for done in engine.run(operator.truediv, [(6, 2), (1, 0), (8, 2)]):
            taken.extend(done)

    with LocalEngine(WORKERS) as engine:
        with pytest.raises(ZeroDivisionError):
            take(engine)
        wait(engine._under_way)
        assert sorted([*taken, *engine.finished()]) == [3, 4]


def test_what_was_taken_is_not_finished_again(engine: Engine) -> None:
    assert engine.finished() == []
    list(engine.run(abs, [(-3,), (2,)]))
    assert engine.finished() == []


def test_silence_is_broken_by_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(engines, "LONGEST_SILENCE", 0.01)
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    with LocalEngine(WORKERS) as engine:
        results = engine.run(Path.read_text, [(gate,)])
        assert next(results) == []
        gate.write_text("open")
        assert [text for done in results for text in done] == ["open"]


def test_workers_leave_ctrl_c_to_the_process_that_commits() -> None:
    with LocalEngine(WORKERS) as engine:
        handlers = [
            handler for done in engine.run(signal.getsignal, [(signal.SIGINT,)] * 4) for handler in done
        ]
    assert set(handlers) == {signal.SIG_IGN}


def test_threads_of_workers_do_not_fight() -> None:
    with LocalEngine(WORKERS) as engine:
        found = [value for done in engine.run(os.getenv, [("OPENBLAS_NUM_THREADS",)]) for value in done]
    assert found == ["1"]


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ParameterError, match="did you mean 'local'"):
        make_engine("locl")
    with pytest.raises(ParameterError, match="workers"):
        make_engine("local", 0)
