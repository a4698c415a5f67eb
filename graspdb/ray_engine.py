"""Trials on a Ray cluster. Only this module imports Ray, which an extra installs."""

import logging
import os
import pickle
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from itertools import islice
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from graspdb.engines import CALLS_FOR_A_WORKER, LONGEST_SILENCE, SHARED_AT_HAND, EngineError, Shared
from graspdb_schemas.errors import MissingLibraryError

try:
    import ray
except ImportError as missing:
    raise MissingLibraryError("Ray", str(missing), "Install it with pip install 'graspdb[ray]'.") from missing

T = TypeVar("T")


class RayEngine:
    """Tasks on a Ray cluster, each on one core; results come back to this process.

    graspdb has to be installed on every node, in the same version, and the session's files have to be at the
    same path on each.

    Parameters
    ----------
    workers : int or None
        Tasks at once; as many as the cluster has cores if None.

    Raises
    ------
    EngineError
        The cluster cannot be reached.
    """

    def __init__(self, workers: int | None) -> None:
        self._started = not ray.is_initialized()
        if self._started:
            try:
                ray.init(log_to_driver=False, logging_level=logging.ERROR, include_dashboard=False)
            except (ConnectionError, RuntimeError, ValueError) as error:
                where = os.environ.get("RAY_ADDRESS", "this machine")
                raise EngineError(
                    f"the Ray cluster at {where} cannot be used: {str(error).splitlines()[0]}",
                    "Start one with `ray start --head`, and name it in RAY_ADDRESS.",
                ) from error
        self._workers = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._under_way: list[Any] = []

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Cancel what is under way and leave the cluster."""
        for task in self._under_way:
            ray.cancel(task, force=True)
        if self._started:
            ray.shutdown()

    def share(self, value: T) -> Shared[T]:
        """Put a value into the cluster's object store, from which each node fetches it once."""
        return _SharedObject(ray.put(_pickled(value)))

    def run(self, function: Callable[..., T], calls: Iterable[tuple[Any, ...]]) -> Iterator[list[T]]:
        """Yield results as they come; see `Engine.run`."""
        remote, left = ray.remote(num_cpus=1)(_call), iter(calls)
        while True:
            free = CALLS_FOR_A_WORKER * self._workers - len(self._under_way)
            self._under_way += [remote.remote(function, *arguments) for arguments in islice(left, free)]
            if not self._under_way:
                return
            ray.wait(self._under_way, num_returns=1, timeout=LONGEST_SILENCE, fetch_local=False)
            results, errors, self._under_way = self._fetched()
            yield results
            if errors:
                raise _as_raised(errors[0])

    def finished(self) -> list[Any]:
        """Return what the cluster has done and `run` has not yielded."""
        return self._fetched()[0]

    def _fetched(self) -> tuple[list[Any], list[Exception], list[Any]]:
        """Return the results of the tasks that are done, the errors of those that failed, and the others."""
        if not self._under_way:
            return [], [], []
        done, left = ray.wait(self._under_way, num_returns=len(self._under_way), timeout=0, fetch_local=False)
        results, errors = [], []
        for task in done:
            try:
                results.append(pickle.loads(ray.get(task)))
            except ray.exceptions.RayError as error:
                errors.append(error)
        return results, errors, left


def _as_raised(error: Exception) -> Exception:
    """Return what a task raised, or that it was lost."""
    if isinstance(error, ray.exceptions.RayTaskError):
        return error.cause if isinstance(error.cause, Exception) else error
    return EngineError(
        f"a task of the Ray cluster was lost: {str(error).splitlines()[0]}",
        "What was committed before is safe; look at the cluster with `ray status`, run again.",
    )


def _call(function: Callable[..., Any], *arguments: Any) -> bytes:
    return _pickled(function(*arguments))


def _pickled(value: Any) -> bytes:
    """Return a value as it goes through the cluster's object store.

    Ray would let arrays lie in the store, where they cannot be written to; libraries refuse such arrays.
    """
    return pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)


class _SharedObject(Generic[T]):
    """A value in the cluster's object store."""

    def __init__(self, reference: Any) -> None:
        self.reference = reference

    def load(self) -> T:
        """Return the value, fetched once for calls in a row."""
        value: T = _loaded(self.reference)
        return value


@lru_cache(maxsize=SHARED_AT_HAND)
def _loaded(reference: Any) -> Any:
    return pickle.loads(ray.get(reference))
