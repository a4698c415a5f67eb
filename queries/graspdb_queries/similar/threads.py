"""Work shared among threads, with linear algebra on one thread in each.

Libraries of linear algebra share out their work by themselves and round differently when they do. Here the
work is cut into pieces of a fixed size instead, so results are the same on any number of threads.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
R = TypeVar("R")


def in_threads(work: Callable[[T], R], pieces: Iterable[T]) -> list[R]:
    """Return what `work` makes of each piece, in order."""
    pieces = list(pieces)
    with _controller().limit(limits=1, user_api="blas"):
        if len(pieces) <= 1:
            return [work(piece) for piece in pieces]
        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            return list(pool.map(work, pieces))


@cache
def _controller() -> ThreadpoolController:
    """Return the libraries that are loaded; looking for them takes longer than a search."""
    return ThreadpoolController()
