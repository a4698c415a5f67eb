"""Points sorted into cubes, so that compiled loops go through the neighbours of a place at once."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.rigid import Array

CUBES_PER_POINT: Final = 16
"""Cubes of scattered points grow until there are no more than these, to bound the memory."""

ROWS: Final = 9
"""Rows of three cubes around a place."""


class Grid(NamedTuple):
    """Points in the order of the cubes they lie in, those along x first.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Positions [m].
    order : ndarray of int, shape (n,)
        Which of the points that were sorted each one is.
    starts : ndarray of int32, shape (n_cubes + 1,)
        Place of each cube's first point.
    low : ndarray, shape (3,)
        Corner of the first cube [m].
    size : float
        Length of a cube's edge [m].
    counts : tuple of int
        Number of cubes along x, y and z.
    """

    points: Array
    order: NDArray[np.int64]
    starts: NDArray[np.int32]
    low: Array
    size: float
    counts: tuple[int, int, int]


def make_grid(points: Array, radius: float) -> Grid:
    """Sort points, shape (n, 3) [m], so that those within a radius [m] are found by `rows_around`."""
    low = points.min(axis=0) if len(points) else np.zeros(3)
    extent = points.max(axis=0) - low if len(points) else np.zeros(3)
    size = radius * (1 + 1e-9)  # what is just the radius away shall lie no two cubes on by rounding
    while np.prod(extent / size + 1) > CUBES_PER_POINT * len(points) + 27:
        size *= 1.25
    x, y, z = np.floor((points - low) / size).astype(np.int64).T
    n_x, n_y, n_z = (int(extent[i] / size) + 1 for i in range(3))
    cubes = (z * n_y + y) * n_x + x
    order = np.argsort(cubes, kind="stable")
    starts = np.zeros(n_x * n_y * n_z + 1, np.int32)
    np.cumsum(np.bincount(cubes, minlength=len(starts) - 1), out=starts[1:])
    return Grid(np.ascontiguousarray(points[order]), order, starts, low, float(size), (n_x, n_y, n_z))


@compiled
def rows_around(grid: Grid, place: Array, rows: NDArray[np.int64]) -> int:
    """Find all points within the grid's radius of a place, and some more, as a few runs of its points.

    Parameters
    ----------
    grid : Grid
        The points.
    place : ndarray, shape (3,)
        Where to look [m].
    rows : ndarray of int, shape (9, 2)
        Filled with the first of each run and the one after its last.

    Returns
    -------
    int
        Number of runs.
    """
    n_x, n_y, n_z = grid.counts
    x = int(np.floor((place[0] - grid.low[0]) / grid.size))
    y = int(np.floor((place[1] - grid.low[1]) / grid.size))
    z = int(np.floor((place[2] - grid.low[2]) / grid.size))
    found = 0
    left, right = max(x - 1, 0), min(x + 2, n_x)
    if left >= right:
        return found
    for k in range(max(z - 1, 0), min(z + 2, n_z)):
        for j in range(max(y - 1, 0), min(y + 2, n_y)):
            cube = (k * n_y + j) * n_x
            first, after = grid.starts[cube + left], grid.starts[cube + right]
            if first < after:
                rows[found, 0], rows[found, 1] = first, after
                found += 1
    return found


@compiled
def squared_distance(a: Array, b: Array) -> float:
    """Return the squared distance of two places, shape (3,) [m2]."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return float(x * x + y * y + z * z)
