"""Principal curvatures of an object's cloud, at the scale of a finger pad."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
    pairs = cKDTree(points).query_pairs(max(REACH, 3 * spacing), output_type="ndarray")
    facing = np.einsum("ei,ei->e", normals[pairs[:, 0]], normals[pairs[:, 1]]) > LEAST_FACING
    kept, own = pairs[facing], np.arange(len(points))
    here = np.concatenate([kept[:, 0], kept[:, 1], own])
    there = np.concatenate([kept[:, 1], kept[:, 0], own])
    count = np.bincount(here, minlength=len(points))[:, None]
    mean_normal = _sums(here, normals[there], len(points)) / count
    centroid = _sums(here, points[there], len(points)) / count
    frames = _tangents(mean_normal)[here]
    along = np.einsum("eij,ej->ei", frames, points[there] - centroid[here])
    turned = np.einsum("eij,ej->ei", frames, normals[there])
    spread = _sums(here, (along[:, :, None] * along[:, None, :]).reshape(-1, 4), len(points)).reshape(
        -1, 2, 2
    )
    bend = _sums(here, (turned[:, :, None] * along[:, None, :]).reshape(-1, 4), len(points)).reshape(-1, 2, 2)
    return _eigenvalues(spread, bend)


def _sums(groups: NDArray[np.int64], values: Array, n: int) -> Array:
    """Return the sums of rows of values by group, shape (n, columns)."""
    return np.column_stack([np.bincount(groups, column, minlength=n) for column in values.T])


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
