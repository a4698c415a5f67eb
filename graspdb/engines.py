"""Where trials are worked on: in this process, in others beside it, or on a Ray cluster.

An engine only computes. Whoever asked it commits what comes back, so a database has one writer for an ingest
whatever the engine.
"""

import pickle
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from enum import StrEnum
from functools import lru_cache
from itertools import count, islice
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Generic, Protocol, Self, TypeVar

from joblib import cpu_count
from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.process_executor import BrokenProcessPool

from graspdb_schemas.errors import GraspDBError, ParameterError, nearest

T = TypeVar("T")
Shareable_co = TypeVar("Shareable_co", covariant=True)

CALLS_FOR_A_WORKER: Final = 2
"""Calls under way for each worker: one at work and one that waits, or whose result waits to be committed."""

SHARED_AT_HAND: Final = 6
"""Shared values that a worker keeps loaded: a session, two hands, and objects of trials in a row."""

LONGEST_SILENCE: Final = 1.0
"""Time after which workers that are all still at work are said to have done nothing [s]."""

_ONE_THREAD: Final = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"
)
"""Environment of workers: with one process a core, threads of matrix products only wait for each other."""


class EngineError(GraspDBError):
    """An engine cannot be had, or lost what it was working on."""

    def __init__(self, found: str, remedy: str) -> None:
        self.found = found
        self.remedy = remedy
        super().__init__(f"{found}. {remedy}")


class EngineName(StrEnum):
    """Engines that trials can be worked on by."""

    LOCAL = "local"
    RAY = "ray"


class Shared(Protocol, Generic[Shareable_co]):
    """A value that many calls need, handed to them by name and loaded once in each worker."""

    def load(self) -> Shareable_co:
        """Return the value."""


class Engine(Protocol):
    """Runs calls of one function in any order, in bounded memory."""

    def share(self, value: T) -> Shared[T]:
        """Put a value where every worker can load it."""

    def run(self, function: Callable[..., T], calls: Iterable[tuple[Any, ...]]) -> Iterator[list[T]]:
        """Call a function with each tuple of arguments, and yield what is done since the last time.

        That is nothing where no worker has been done for `LONGEST_SILENCE`. Where a call fails, what is done
        is yielded before the error is raised.
        Arguments are taken as workers get free, and no new call begins while the results of
        `CALLS_FOR_A_WORKER` calls for each worker wait to be taken. So memory is bounded by the number of
        workers, not of calls.

        Raises
        ------
        EngineError
            A worker was lost.
        """

    def finished(self) -> list[Any]:
        """Return the results that are there and have not been yielded; for when `run` is broken off."""

    def __enter__(self) -> Self:
        """Return itself."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop what is under way and give back what was shared."""


def make_engine(name: str = EngineName.LOCAL, workers: int | None = None, at_most: int = 1) -> Engine:
    """Return an engine.

    Parameters
    ----------
    name : {'local', 'ray'}
        Processes of this machine, or a Ray cluster: the one that RAY_ADDRESS names, else one that runs on
        this machine, else a new one of this machine alone.
    workers : int, optional
        Calls that are worked on at once; as many as there are cores unless given.
    at_most : int
        Calls that there are to do; more workers than these are not started.

    Raises
    ------
    ParameterError
        There is no such engine, or `workers` is less than one.
    MissingLibraryError
        Ray is not installed.
    """
    if workers is not None and workers < 1:
        raise ParameterError("workers", workers, "1 or more")
    if name not in tuple(EngineName):
        known = [str(engine.value) for engine in EngineName]
        raise ParameterError("engine", name, ", ".join(known) + nearest(name, known))
    if name == EngineName.RAY and at_most:
        from graspdb.ray_engine import RayEngine

        return RayEngine(workers)
    return LocalEngine(max(1, min(workers or cpu_count(), at_most)))


class LocalEngine:
    """Processes of this machine; with one worker, this process itself.

    Parameters
    ----------
    workers : int
        How many.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._folder = Path(tempfile.mkdtemp(prefix="graspdb-ingest-"))
        self._numbers = count()
        self._executor: Any = None
        self._under_way: set[Future[Any]] = set()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the workers, at once if something failed, and remove what was shared."""
        if self._executor is not None:
            self._executor.shutdown(kill_workers=kind is not None)
        shutil.rmtree(self._folder, ignore_errors=True)

    def share(self, value: T) -> Shared[T]:
        """Write a value to a file of a temporary folder."""
        path = self._folder / f"{next(self._numbers)}.pickle"
        with path.open("wb") as file:
            pickle.dump(value, file, protocol=pickle.HIGHEST_PROTOCOL)
        return _SharedFile(path)

    def run(self, function: Callable[..., T], calls: Iterable[tuple[Any, ...]]) -> Iterator[list[T]]:
        """Yield results as they come; see `Engine.run`."""
        if self._workers == 1:
            yield from ([function(*arguments)] for arguments in calls)
            return
        if self._executor is None:
            # Not the one that joblib keeps for all: whoever uses joblib besides would find it without the
            # memory maps that joblib adds to it.
            self._executor = ProcessPoolExecutor(
                max_workers=self._workers, env=_ONE_THREAD, initializer=_leave_interrupts_to_the_parent
            )
        try:
            yield from self._windowed(function, iter(calls))
        except BrokenProcessPool as error:
            raise EngineError(
                "a worker process was killed, perhaps since memory ran out",
                "What was committed before is safe; run again with fewer --workers.",
            ) from error

    def finished(self) -> list[Any]:
        """Return what workers have done and `run` has not yielded."""
        return [future.result() for future in self._under_way if future.done() and not future.exception()]

    def _windowed(self, function: Callable[..., T], calls: Iterator[tuple[Any, ...]]) -> Iterator[list[T]]:
        while True:
            free = CALLS_FOR_A_WORKER * self._workers - len(self._under_way)
            self._under_way |= {
                self._executor.submit(function, *arguments) for arguments in islice(calls, free)
            }
            if not self._under_way:
                return
            done, left = wait(self._under_way, LONGEST_SILENCE, FIRST_COMPLETED)
            errors = [error for error in (future.exception() for future in done) if error is not None]
            results = [future.result() for future in done if not future.exception()]
            self._under_way = left
            yield results
            if errors:
                raise errors[0]


class _SharedFile(Generic[T]):
    """A value in a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> T:
        """Return the value, read once for calls in a row."""
        value: T = _loaded(self.path)
        return value


@lru_cache(maxsize=SHARED_AT_HAND)
def _loaded(path: Path) -> Any:
    with path.open("rb") as file:
        return pickle.load(file)


def _leave_interrupts_to_the_parent() -> None:
    """Let Ctrl-C, which a terminal sends to all processes, be handled by the one that commits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
