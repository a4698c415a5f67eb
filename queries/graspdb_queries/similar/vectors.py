"""Exact search for the nearest vectors: in single precision first, then exactly where that cannot decide."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.threads import in_threads

Vectors = NDArray[np.float32]
Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

BLOCK: Final = 32_768
"""Rows compared at a time; fixed, so that results do not depend on the number of threads."""

SPARSE: Final = 4
"""Below one in this many rows, the wanted ones are picked out before they are compared."""


@dataclass(frozen=True, eq=False)
class VectorIndex:
    """Vectors in memory.

    Attributes
    ----------
    vectors : ndarray of float32, shape (n, d)
        One row a feature.
    """

    vectors: Vectors

    @cached_property
    def squares(self) -> Vectors:
        """Squared length of every vector."""
        return np.asarray(np.einsum("nd,nd->n", self.vectors, self.vectors))

    @cached_property
    def longest(self) -> float:
        """Length of the longest vector."""
        return float(np.sqrt(self.squares.max(initial=0.0)))

    def nearest(self, query: Vectors, count: int, rows: Rows | None = None) -> tuple[Rows, Floats]:
        """Return the rows nearest to a query, nearest first, and their exact squared distances.

        Rows at equal distance come in their own order.

        Parameters
        ----------
        query : ndarray of float32, shape (d,)
            The vector.
        count : int
            How many rows, at most.
        rows : ndarray of int, optional
            The only rows that count, ascending.
        """
        if rows is not None and len(rows) * SPARSE < len(self.vectors):
            vectors, squares = self.vectors[rows], self.squares[rows]
            rough = _rough(vectors, squares, query)
            near = self._undecided(rough, query, count)
            near = rows[near]
        else:
            rough = _rough(self.vectors, self.squares, query)
            if rows is not None:
                left_out = np.ones(len(rough), dtype=bool)
                left_out[rows] = False
                rough[left_out] = np.inf
            near = self._undecided(rough, query, count)
        exact = exact_squared(self.vectors[near], query)
        order = np.lexsort((near, exact))[:count]
        return near[order], exact[order]

    def _undecided(self, rough: Vectors, query: Vectors, count: int) -> Rows:
        """Return the rows that may be among the nearest, whatever rounding did to `rough`."""
        if len(rough) <= count:
            return np.flatnonzero(np.isfinite(rough))
        limit = float(np.partition(rough, count - 1)[count - 1])
        if not np.isfinite(limit):
            return np.flatnonzero(np.isfinite(rough))
        # Sums of d products are off by at most d units in the last place of the sum of their sizes.
        unit = float(np.finfo(np.float32).eps)
        length = float(np.linalg.norm(query))
        error = 2 * (len(query) + 4) * unit * (self.longest + length) ** 2
        return np.flatnonzero(rough <= limit + 2 * error)


def exact_squared(vectors: Vectors, query: Vectors) -> Floats:
    """Return squared distances in double precision; a row's does not depend on the others."""
    offsets = vectors.astype(np.float64) - query.astype(np.float64)
    return np.asarray((offsets**2).sum(axis=1))


def nearest_of_batches(
    batches: Iterable[tuple[NDArray[np.str_], Vectors]], query: Vectors, count: int
) -> tuple[list[str], Floats]:
    """Return the keys nearest to a query over batches of vectors, in memory for one batch.

    Parameters
    ----------
    batches : iterable of (keys, vectors)
        Keys, shape (n,), and vectors, shape (n, d).
    query : ndarray of float32, shape (d,)
        The vector.
    count : int
        How many keys, at most.

    Returns
    -------
    tuple of list of str and ndarray
        Keys, nearest first, and exact squared distances; keys at equal distance in the order of batches.
    """
    keys: list[str] = []
    squared = np.empty(0)
    for names, vectors in batches:
        rows, distances = VectorIndex(vectors).nearest(query, count)
        keys += [str(names[row]) for row in rows]
        squared = np.concatenate([squared, distances])
        order = np.argsort(squared, kind="stable")[:count]
        keys, squared = [keys[i] for i in order], squared[order]
    return keys, squared


def _rough(vectors: Vectors, squares: Vectors, query: Vectors) -> Vectors:
    """Return squared distances to a query less its own square, in single precision."""
    rough = np.empty(len(vectors), dtype=np.float32)
    twice = (-2 * query).astype(np.float32)

    def fill(start: int) -> None:
        some = slice(start, start + BLOCK)
        np.matmul(vectors[some], twice, out=rough[some])
        rough[some] += squares[some]

    in_threads(fill, range(0, len(vectors), BLOCK))
    return rough
