"""Points spread evenly over a mesh: no two of one side nearer than a distance, and no room for one more.

Dart throwing (Cook 1986, ACM Trans. Graph. 5, 51) in rounds. Two points compete only if their normals do
not oppose each other, so both sides of a thin wall get all their points.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.objects.grid import ROWS, Grid, make_grid, rows_around, squared_distance
from graspdb_ingest.rigid import Array

ROUNDS: Final = 4
DARTS_PER_ROUND: Final = 3.0
"""Darts of each round per square of the distance; more would fill the last gaps, at some cost."""

_OPPOSED: Final = -0.5
"""Cosine between normals of points that lie on different sides: they differ by more than 120 degrees."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """Points on a mesh, and the part of its area that is nearest to each.

    Attributes
    ----------
    points, normals : ndarray, shape (n, 3)
        Positions [m] and unit normals of the faces they lie on.
    areas : ndarray, shape (n,)
        Area [m2] whose nearest point this is; they sum to the area of the mesh.
    """

    points: Array
    normals: Array
    areas: Array


def scatter(vertices: Array, faces: NDArray[np.int64], distance: float, seed: int) -> Scatter:
    """Spread points over a mesh so that neighbours are at least a distance apart, as dense as may be.

    Parameters
    ----------
    vertices : ndarray, shape (v, 3)
        Vertices [m].
    faces : ndarray of int, shape (f, 3)
        Triangles; at least one has an area.
    distance : float
        Least distance between neighbours [m].
    seed : int
        Seed; the same one gives the same points, bit for bit.

    Returns
    -------
    Scatter
        The points. No spot that was tried is further than `distance` from a point.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(cross, axis=1)
    directions = cross / np.where(doubled > 0, doubled, 1)[:, None]
    running = np.cumsum(doubled / 2)
    rng = np.random.default_rng(seed)
    n_darts = max(64, int(np.ceil(DARTS_PER_ROUND * running[-1] / distance**2)))
    points, normals = np.empty((0, 3)), np.empty((0, 3))
    thrown = []
    for _ in range(ROUNDS):
        darts, hit = _throw(corners, running, n_darts, rng)
        thrown.append((darts, directions[hit]))
        free = _owners(darts, directions[hit], points, normals, distance) < 0
        new, new_normals = darts[free], directions[hit][free]
        kept = thin(new, new_normals, distance, rng)
        points, normals = np.concatenate((points, new[kept])), np.concatenate((normals, new_normals[kept]))
    darts, dart_normals = (np.concatenate(parts) for parts in zip(*thrown, strict=True))
    owners = _owners(darts, dart_normals, points, normals, distance)
    counts = np.bincount(owners, minlength=len(points))
    return Scatter(points, normals, counts * (running[-1] / len(darts)))


def thin(points: Array, normals: Array, distance: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Choose points, none nearer to another of its side than a distance, until no more can be added.

    Every point gets a place in a random order; of two that compete, the earlier one stays.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Positions [m] and unit normals; with normals of zero all points compete.
    distance : float
        Least distance between chosen points [m].
    rng : Generator
        Source of the order.

    Returns
    -------
    ndarray of int
        Indices of the chosen points, ascending.
    """
    grid = make_grid(points, distance)
    sorted_normals = np.ascontiguousarray(normals[grid.order])
    turns = np.argsort(rng.permutation(len(points))[grid.order])
    return np.sort(grid.order[_first_come(grid, sorted_normals, turns, distance)])


@compiled
def _first_come(grid: Grid, normals: Array, turns: NDArray[np.int64], distance: float) -> NDArray[np.bool_]:
    """Return which points stay, where each that still stands when its turn comes removes its rivals."""
    kept, stands = np.zeros(len(turns), np.bool_), np.ones(len(turns), np.bool_)
    rows = np.empty((ROWS, 2), np.int64)
    for i in turns:
        if not stands[i]:
            continue
        kept[i] = True
        for row in range(rows_around(grid, grid.points[i], rows)):
            for j in range(rows[row, 0], rows[row, 1]):
                near = squared_distance(grid.points[i], grid.points[j]) <= distance * distance
                if near and _same_side(normals[i], normals[j]):
                    stands[j] = False
    return kept


def _throw(
    corners: Array, running: Array, n: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64]]:
    """Return n points evenly likely over the triangles, one in each n-th of the area, and their faces."""
    where = (np.arange(n) + rng.random(n)) / n * running[-1]
    hit = np.minimum(np.searchsorted(running, where, side="right"), len(running) - 1)
    first, second = rng.random((2, n))
    # Osada et al. (2002), ACM Trans. Graph. 21, equation 1: even over a triangle.
    root = np.sqrt(first)
    weights = np.stack((1 - root, root * (1 - second), root * second), axis=1)
    return np.einsum("nk,nki->ni", weights, corners[hit]), hit


def _owners(
    darts: Array, dart_normals: Array, points: Array, normals: Array, distance: float
) -> NDArray[np.int64]:
    """Return for each dart the nearest point of its side within the distance, or -1."""
    grid = make_grid(points, distance)
    places = _nearest_of_side(darts, dart_normals, grid, normals[grid.order], distance)
    return np.append(grid.order, -1)[places]


@compiled
def _same_side(normal: Array, other: Array) -> bool:
    return bool(normal[0] * other[0] + normal[1] * other[1] + normal[2] * other[2] > _OPPOSED)


@compiled
def _nearest_of_side(
    darts: Array, dart_normals: Array, grid: Grid, normals: Array, distance: float
) -> NDArray[np.int64]:
    """Return the place in a grid of the nearest point of each dart's side within a distance, or -1."""
    nearest = np.full(len(darts), -1)
    rows = np.empty((ROWS, 2), np.int64)
    for i in range(len(darts)):
        least = distance * distance
        for row in range(rows_around(grid, darts[i], rows)):
            for j in range(rows[row, 0], rows[row, 1]):
                squared = squared_distance(darts[i], grid.points[j])
                if squared <= least and _same_side(dart_normals[i], normals[j]):
                    nearest[i], least = j, squared
    return nearest
