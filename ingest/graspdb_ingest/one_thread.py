"""Linear algebra on one thread: matrices of 58 rows are too small to share out, more threads only wait."""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Keep numpy's and scipy's linear algebra on one thread while the context lasts."""
    limiter: AbstractContextManager[object] = _libraries().limit(limits=1)
    return limiter


@cache
def _libraries() -> ThreadpoolController:
    """Return the libraries that are loaded; to look for them takes as long as some frames' tracking."""
    return ThreadpoolController()
