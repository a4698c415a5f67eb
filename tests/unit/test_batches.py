"""Which results are committed together, told by a clock that the tests set."""

from collections.abc import Iterator, Sequence

import pytest

from graspdb.batches import MOST_BYTES, PERIOD, commit_in_batches
from graspdb_schemas.errors import DatabaseError

COST = 0.1
"""Time that a commit takes [s]."""


class Ingest:
    """Results that come at given times, of a size, and the commits that they end up in."""

    def __init__(self, *times: float, size: int = 1, ending: type[BaseException] | None = None) -> None:
        self.times, self.size, self.ending = times, size, ending
        self.now = 0.0
        self.left: list[float] = []
        self.commits: list[tuple[float, list[float]]] = []

    def arrivals(self) -> Iterator[list[float]]:
        """Yield the results, and set the clock to when they come."""
        for time in self.times:
            self.now = max(self.now, time)
            yield [time]
        if self.ending is not None:
            raise self.ending

    def commit(self, results: Sequence[float]) -> None:
        """Keep what was committed and when."""
        if results:
            self.commits.append((self.now, list(results)))
            self.now += COST

    def run(self) -> list[list[float]]:
        """Ingest, and return the commits."""
        commit_in_batches(
            self.arrivals(), self.commit, lambda _: self.size, lambda: self.left, lambda: self.now
        )
        return self.batches

    @property
    def batches(self) -> list[list[float]]:
        """The results of each commit."""
        return [results for _, results in self.commits]


def test_slow_results_are_committed_one_by_one_as_they_come() -> None:
    ingest = Ingest(*(2 * PERIOD * number for number in range(5)))
    ingest.run()
    assert ingest.commits == [(time, [time]) for time in ingest.times]


def test_fast_results_are_committed_together_a_period_after_the_last_commit() -> None:
    ingest = Ingest(*(0.25 * number for number in range(100)))
    batches = ingest.run()
    assert [time for batch in batches for time in batch] == list(ingest.times)
    assert len(batches) <= 2 + ingest.times[-1] / PERIOD
    for when, batch in ingest.commits[:-1]:
        assert when - batch[0] <= PERIOD + 0.25 + COST


def test_what_waits_does_not_wait_for_the_next_result() -> None:
    ingest = Ingest(0.0, 0.1)
    quiet = [[0.0], [0.1], [], [], []]

    def arrivals() -> Iterator[list[float]]:
        for results in quiet:
            yield results
            ingest.now += 1.0

    commit_in_batches(arrivals(), ingest.commit, lambda _: 1, list, lambda: ingest.now)
    assert ingest.batches == [[0.0], [0.1]]
    assert ingest.commits[1][0] <= PERIOD + 1.0 + COST


def test_what_waits_is_bounded() -> None:
    size = MOST_BYTES // 4
    batches = Ingest(*([0.0] * 50), size=size).run()
    assert max(map(len, batches)) * size <= MOST_BYTES
    assert sum(map(len, batches)) == 50


def test_nothing_to_do_commits_nothing() -> None:
    assert Ingest().run() == []


@pytest.mark.parametrize("ending", [KeyboardInterrupt, ZeroDivisionError])
def test_what_there_is_when_computing_ends_early_is_committed(ending: type[BaseException]) -> None:
    ingest = Ingest(0.0, 0.1, 0.2, ending=ending)
    ingest.left = [0.3]
    with pytest.raises(ending):
        ingest.run()
    assert ingest.batches == [[0.0], [0.1, 0.2, 0.3]]


def test_a_commit_that_is_interrupted_is_done_again(monkeypatch: pytest.MonkeyPatch) -> None:
    ingest = Ingest(0.0, 0.1)
    commit, interrupts = ingest.commit, iter([KeyboardInterrupt])

    def interrupted(results: Sequence[float]) -> None:
        for error in interrupts:
            raise error
        commit(results)

    monkeypatch.setattr(ingest, "commit", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ingest.run()
    assert ingest.batches == [[0.0]]


def test_a_database_that_cannot_be_written_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    ingest = Ingest(0.0, 0.1)
    tried = []

    def full(results: Sequence[float]) -> None:
        tried.append(results)
        raise DatabaseError("db", "the disk is full", "Free space.")

    monkeypatch.setattr(ingest, "commit", full)
    with pytest.raises(DatabaseError):
        ingest.run()
    assert tried == [[0.0]]
