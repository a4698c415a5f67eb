"""Principal curvatures of an object's cloud, at the scale of a finger pad."""

from typing import Final

import numpy as np

from graspdb_ingest.compiled import compiled
from graspdb_ingest.objects.grid import ROWS, Grid, make_grid, rows_around, squared_distance
from graspdb_ingest.rigid import Array

REACH: Final = 0.006
"""Neighbours within this distance say how the surface bends: half the breadth of a small finger's pad [m]."""
LEAST_FACING: Final = -0.3
"""Cosine between the normals of two neighbours below which they lie on two sides of a wall."""


def principal_curvatures(points: Array, normals: Array, spacing: float) -> Array:
    """Return the principal curvatures at every point of a cloud.

    Normals and positions of the neighbours are projected along their mean normal; the curvatures are the
    eigenvalues of the linear map that best carries the positions to the normals, the shape operator. On
    planes, spheres and cylinders of any radius this is exact, since both projections shrink alike. A sharp
    edge has the curvature of a bend that the reach can just not resolve.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Positions [m] and outward unit normals.
    spacing : float
        Distance of neighbouring points [m]; in a sparse cloud the reach is three times this.

    Returns
    -------
    ndarray, shape (n, 2)
        Curvatures, the one of greater magnitude first [1/m]; positive where the surface is convex, zero
        where too few neighbours tell.
    """
    radius = max(REACH, 3 * spacing)
    grid = make_grid(points, radius)
    sorted_normals = np.ascontiguousarray(normals[grid.order])
    mean_normals, centroids = _means(grid, sorted_normals, radius)
    spread, bend = _moments(grid, sorted_normals, _tangents(mean_normals), centroids, radius)
    curvatures = np.empty((len(points), 2))
    curvatures[grid.order] = _eigenvalues(spread, bend)
    return curvatures


@compiled
def _means(grid: Grid, normals: Array, radius: float) -> tuple[Array, Array]:
    """Return mean normal and mean position of each point and its neighbours, in the order of the grid."""
    mean_normals, centroids = np.zeros_like(normals), np.zeros_like(normals)
    rows = np.empty((ROWS, 2), np.int64)
    for i in range(len(normals)):
        count = 0
        for row in range(rows_around(grid, grid.points[i], rows)):
            for j in range(rows[row, 0], rows[row, 1]):
                if _beside(grid, normals, i, j, radius):
                    count += 1
                    for axis in range(3):
                        mean_normals[i, axis] += normals[j, axis]
                        centroids[i, axis] += grid.points[j, axis]
        mean_normals[i] /= count
        centroids[i] /= count
    return mean_normals, centroids


@compiled
def _moments(
    grid: Grid, normals: Array, frames: Array, centroids: Array, radius: float
) -> tuple[Array, Array]:
    """Return sums over neighbours of position and of normal times position, both across, shape (n, 2, 2)."""
    spread, bend = np.zeros((len(normals), 2, 2)), np.zeros((len(normals), 2, 2))
    rows, along, turned = np.empty((ROWS, 2), np.int64), np.empty(2), np.empty(2)
    for i in range(len(normals)):
        for row in range(rows_around(grid, grid.points[i], rows)):
            for j in range(rows[row, 0], rows[row, 1]):
                if not _beside(grid, normals, i, j, radius):
                    continue
                along[:], turned[:] = 0.0, 0.0
                for a in range(2):
                    for axis in range(3):
                        along[a] += frames[i, a, axis] * (grid.points[j, axis] - centroids[i, axis])
                        turned[a] += frames[i, a, axis] * normals[j, axis]
                for a in range(2):
                    for b in range(2):
                        spread[i, a, b] += along[a] * along[b]
                        bend[i, a, b] += turned[a] * along[b]
    return spread, bend


@compiled
def _beside(grid: Grid, normals: Array, i: int, j: int, radius: float) -> bool:
    """Return whether a point is near to another, on the same side of a wall, or is that point itself."""
    if i == j:
        return True
    if squared_distance(grid.points[i], grid.points[j]) > radius * radius:
        return False
    facing = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
    return bool(facing > LEAST_FACING)


def _tangents(normals: Array) -> Array:
    """Return two unit vectors across each normal, shape (n, 2, 3)."""
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit), axis=1)])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    return np.stack([first, np.cross(unit, first)], axis=1)


def _eigenvalues(spread: Array, bend: Array) -> Array:
    determined = np.linalg.det(spread) > 1e-6 * np.trace(spread, axis1=1, axis2=2) ** 2
    curvatures = np.zeros((len(spread), 2))
    if determined.any():
        operator = bend[determined] @ np.linalg.inv(spread[determined])
        values = np.linalg.eigvalsh((operator + np.swapaxes(operator, 1, 2)) / 2)
        order = np.argsort(-np.abs(values), axis=1)
        curvatures[determined] = np.take_along_axis(values, order, axis=1)
    return curvatures
