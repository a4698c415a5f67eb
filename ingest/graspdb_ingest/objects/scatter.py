"""Points spread evenly over a mesh: no two of one side nearer than a distance, and no room for one more.

Dart throwing (Cook 1986, ACM Trans. Graph. 5, 51) in rounds. Two points compete only if their normals do
not oppose each other, so both sides of a thin wall get all their points.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
        free = _uncovered(darts, directions[hit], points, normals, distance)
        new, new_normals = darts[free], directions[hit][free]
        kept = thin(new, new_normals, distance, rng)
        points, normals = np.concatenate((points, new[kept])), np.concatenate((normals, new_normals[kept]))
    darts, dart_normals = (np.concatenate(parts) for parts in zip(*thrown, strict=True))
    owners = _owners(darts, dart_normals, points, normals)
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
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    pairs = pairs[_same_side(normals[pairs[:, 0]], normals[pairs[:, 1]])]
    order = rng.permutation(len(points))
    later_first = order[pairs[:, 0]] > order[pairs[:, 1]]
    pairs[later_first] = pairs[later_first, ::-1]
    kept = np.zeros(len(points), dtype=bool)
    open_ = np.ones(len(points), dtype=bool)
    while open_.any():
        beaten = np.zeros(len(points), dtype=bool)
        beaten[pairs[:, 1]] = True
        won = open_ & ~beaten
        kept |= won
        open_ &= beaten
        open_[pairs[won[pairs[:, 0]], 1]] = False
        pairs = pairs[open_[pairs].all(axis=1)]
    return np.flatnonzero(kept)


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


def _same_side(normals: Array, others: Array) -> NDArray[np.bool_]:
    return np.asarray(np.einsum("...i,...i->...", normals, others) > _OPPOSED)


def _uncovered(
    darts: Array, dart_normals: Array, points: Array, normals: Array, distance: float
) -> NDArray[np.bool_]:
    """Return which darts have no point of their side within the distance."""
    if not len(points):
        return np.ones(len(darts), dtype=bool)
    tree = cKDTree(points)
    uncovered = np.ones(len(darts), dtype=bool)
    undecided = np.arange(len(darts))
    for n_nearest in (4, 16, 64):  # more only where all of the nearest lie on the other side
        near, index = tree.query(darts[undecided], k=range(1, n_nearest + 1), distance_upper_bound=distance)
        found = np.isfinite(near)
        same = _same_side(dart_normals[undecided, None], normals[np.where(found, index, 0)]) & found
        uncovered[undecided] = ~same.any(axis=1)
        undecided = undecided[found.all(axis=1) & ~same.any(axis=1)]
        if not len(undecided):
            break
    return uncovered


def _owners(darts: Array, dart_normals: Array, points: Array, normals: Array) -> NDArray[np.int64]:
    """Return for each dart the nearest point of its side, or the nearest of all where none is near."""
    tree = cKDTree(points)
    owners = np.asarray(tree.query(darts)[1], dtype=np.int64)
    crossed = np.flatnonzero(~_same_side(dart_normals, normals[owners]))
    if len(crossed):
        nearest = np.asarray(tree.query(darts[crossed], k=range(1, min(8, len(points)) + 1))[1])
        first = _same_side(dart_normals[crossed, None], normals[nearest]).argmax(axis=1)
        owners[crossed] = nearest[np.arange(len(crossed)), first]
    return owners
