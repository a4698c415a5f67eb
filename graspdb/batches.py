"""Which results are committed together: those that come faster than they are worth a commit each."""

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Final, TypeVar

from graspdb.free_memory import give_back_free_memory
from graspdb_schemas.errors import DatabaseError

T = TypeVar("T")

PERIOD: Final = 4.0
"""Time from one commit to the next where results come faster [s]; a commit takes a tenth of it, or less."""

MOST_BYTES: Final = 64 * 2**20
"""Results that wait for their commit have so many bytes at most, and those of the last one."""


def commit_in_batches(
    arrivals: Iterable[Sequence[T]],
    commit: Callable[[Sequence[T]], None],
    size: Callable[[T], int],
    finished: Callable[[], Sequence[T]],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Commit results as they come, together where they come fast.

    What comes is committed at once if the last commit was a `PERIOD` ago, and otherwise waits until it was,
    or until `MOST_BYTES` wait. So whoever kills the process loses what was computed within one period, at the
    most. If computing ends early, by Ctrl-C or an error, what there is by then is committed before.

    Parameters
    ----------
    arrivals : iterable of sequence
        Results since the last time; an empty one from time to time where none comes for long.
    commit : callable
        Commits results. What it was interrupted in is handed to it again.
    size : callable
        Bytes of a result.
    finished : callable
        Returns results that are there and did not arrive, for when no more will arrive.
    clock : callable
        Returns the time [s].
    """
    waiting: list[T] = []
    last = -float("inf")
    try:
        for results in arrivals:
            waiting += results
            full = sum(map(size, waiting)) >= MOST_BYTES
            if waiting and (full or clock() - last >= PERIOD):
                commit(waiting)
                waiting, last = [], clock()
                give_back_free_memory()
        commit(waiting)
        waiting = []
    except DatabaseError:
        raise
    except (KeyboardInterrupt, Exception):
        commit([*waiting, *finished()])
        raise
