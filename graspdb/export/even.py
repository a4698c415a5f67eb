"""A fixed number of points, evenly out of many."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]


def even_choice(points: Floats, count: int) -> NDArray[np.int64]:
    """Return the indices of so many points, spread evenly: each the furthest from those before.

    It begins with the point nearest to the middle, so that the choice depends on the points alone. Where
    there are fewer points than asked for, they are taken in turn again.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        The points; at least one.
    count : int
        How many.

    Returns
    -------
    ndarray of int, shape (count,)
    """
    n = len(points)
    if n <= count:
        return np.arange(count) % n
    chosen = np.empty(count, dtype=np.int64)
    centred = points - points.mean(axis=0)
    chosen[0] = np.argmin(np.einsum("ij,ij->i", centred, centred))
    nearest = np.full(n, np.inf)
    for i in range(1, count):
        step = points - points[chosen[i - 1]]
        np.minimum(nearest, np.einsum("ij,ij->i", step, step), out=nearest)
        chosen[i] = np.argmax(nearest)
    return chosen
