"""Settling parts on a whole object: point-to-plane iterated closest points, many parts at once, one way.

All of a part should lie on the object; what else the object has does not matter.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb_queries.similar.align import TRIMMED
from graspdb_queries.similar.places import NewObject, Rows

Floats = NDArray[np.float64]

NEIGHBOURS: Final = 8
"""Points of the object among which one is looked for whose normal points the same way."""

REACH: Final = 0.010
"""Distance [m] that a point counts with where no surface that faces the same way is as near."""

STILL: Final = 1e-3
"""Share of the mean stiffness that holds a feature where its surface does not, as along a cylinder."""


def settled(new: NewObject, points: Floats, normals: Floats, poses: Floats, steps: int) -> Floats:
    """Return poses, shape (n, 4, 4), after steps in which the furthest points are left out.

    Parameters
    ----------
    new : NewObject
        The object.
    points, normals : ndarray, shape (n, m, 3)
        Points [m] and normals of the parts.
    poses : ndarray, shape (n, 4, 4)
        Where the parts start from, object_from_part.
    steps : int
        Number of steps.
    """
    kept = _kept(points.shape[1])
    for _ in range(steps):
        moved, turned = _moved(points, poses), normals @ poses[:, :3, :3].swapaxes(1, 2)
        apart, rows = facing(new, moved, turned)
        near = np.argsort(apart, axis=1, kind="stable")[:, :kept]
        found = np.take_along_axis(rows, near, axis=1)
        poses = _stepped(
            np.take_along_axis(moved, near[..., None], axis=1),
            new.cloud.points[found],
            new.cloud.normals[found],
            poses,
        )
    return poses


def best_starts(new: NewObject, points: Floats, normals: Floats, poses: Floats) -> Floats:
    """Return of each part's poses, shape (n, s, 4, 4), that which lies best, shape (n, 4, 4)."""
    n, n_starts = poses.shape[:2]
    flat = poses.reshape(-1, 4, 4)
    points, normals = np.repeat(points, n_starts, axis=0), np.repeat(normals, n_starts, axis=0)
    apart, _ = facing(new, _moved(points, flat), normals @ flat[:, :3, :3].swapaxes(1, 2))
    chosen = nearest_means(apart).reshape(n, n_starts).argmin(axis=1)
    return np.asarray(poses[np.arange(n), chosen])


def facing(new: NewObject, points: Floats, normals: Floats) -> tuple[Floats, Rows]:
    """Return distances to the nearest points that face the same way, at most `REACH`, and their rows.

    Parameters
    ----------
    new : NewObject
        The object.
    points, normals : ndarray, shape (..., 3)
        Points [m] and normals in its frame.
    """
    found = new.tree.query(points)
    apart, rows = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    alike = np.einsum("...i,...i->...", new.cloud.normals[rows], normals) > 0
    # Few points lie nearest to a surface that faces away, as across a thin wall; those look further.
    across = np.nonzero(~alike & (apart < REACH))
    if len(across[0]):
        k = min(NEIGHBOURS, len(new.cloud.points))
        more = new.tree.query(points[across], k=np.arange(1, k + 1))
        further, other = np.asarray(more[0]), np.asarray(more[1], dtype=np.int64)
        alike = np.einsum("nki,ni->nk", new.cloud.normals[other], normals[across]) > 0
        further = np.where(alike, further, REACH)
        best, every = further.argmin(axis=1), np.arange(len(further))
        apart[across], rows[across] = further[every, best], other[every, best]
    return np.minimum(apart, REACH), rows


def nearest_means(apart: Floats) -> Floats:
    """Return the means of the nearest share of distances, along the last axis."""
    return np.asarray(np.sort(apart, axis=-1)[..., : _kept(apart.shape[-1])].mean(axis=-1))


def _kept(n: int) -> int:
    return int(np.ceil(TRIMMED * n))


def _moved(points: Floats, poses: Floats) -> Floats:
    return np.asarray(points @ poses[:, :3, :3].swapaxes(1, 2) + poses[:, None, :3, 3])


def _stepped(points: Floats, found: Floats, planes: Floats, poses: Floats) -> Floats:
    """Return poses after the step that brings points, shape (n, k, 3), nearest to planes in least squares."""
    centres = points.mean(axis=1)
    arms = points - centres[:, None]
    off = np.einsum("nki,nki->nk", found - points, planes)
    reach = np.sqrt((arms**2).sum(axis=2).mean(axis=1)) + 1e-9  # so that turns and shifts weigh alike
    slopes = np.concatenate([np.cross(arms / reach[:, None, None], planes), planes], axis=2)
    stiffness = slopes.swapaxes(1, 2) @ slopes
    stiffness += (STILL / 6 * np.trace(stiffness, axis1=1, axis2=2))[:, None, None] * np.eye(6)
    step = np.linalg.solve(stiffness, slopes.swapaxes(1, 2) @ off[..., None])[..., 0]
    change = np.tile(np.eye(4), (len(points), 1, 1))
    change[:, :3, :3] = Rotation.from_rotvec(step[:, :3] / reach[:, None]).as_matrix()
    change[:, :3, 3] = centres - np.einsum("nij,nj->ni", change[:, :3, :3], centres) + step[:, 3:]
    return np.asarray(change @ poses)
