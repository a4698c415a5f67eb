"""Rigid transforms over many frames: equation 1 and its inverse, and quaternions (w, x, y, z).

A transform `<target>_from_<source>` is a rotation and a position, with the frames in front:
``rotations (..., 3, 3)`` and ``positions (..., 3)``. NaN in a transform means that it is not known, and
everything computed from it is NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def transform_points(rotations: Array, positions: Array, points: Array) -> Array:
    """Return ``R p + P``: points of the source frame in the target frame (equation 1).

    Parameters
    ----------
    rotations : ndarray, shape (..., 3, 3)
        Rotations R of target_from_source.
    positions : ndarray, shape (..., 3)
        Positions P of the source's origin in the target frame [m].
    points : ndarray, shape (..., n, 3)
        Points in the source frame [m]; leading axes broadcast against those of the transform.

    Returns
    -------
    ndarray, shape (..., n, 3)
        The points in the target frame [m].
    """
    return np.asarray(points @ np.swapaxes(rotations, -1, -2) + positions[..., None, :])


def inverse_transform_points(rotations: Array, positions: Array, points: Array) -> Array:
    """Return ``R' (p - P)``: points of the target frame in the source frame.

    Parameters
    ----------
    rotations : ndarray, shape (..., 3, 3)
        Rotations R of target_from_source.
    positions : ndarray, shape (..., 3)
        Positions P of the source's origin in the target frame [m].
    points : ndarray, shape (..., n, 3)
        Points in the target frame [m].

    Returns
    -------
    ndarray, shape (..., n, 3)
        The points in the source frame [m].
    """
    return np.asarray((points - positions[..., None, :]) @ rotations)


def quaternions_from_rotations(rotations: Array) -> Array:
    """Return unit quaternions (w, x, y, z) of rotation matrices, with w not negative.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Rotation matrices; NaN where not known.

    Returns
    -------
    ndarray, shape (n, 4)
        Quaternions; NaN where the rotation is.
    """
    quaternions = np.full((len(rotations), 4), np.nan)
    known = np.isfinite(rotations).all(axis=(1, 2))
    if known.any():
        quaternions[known] = Rotation.from_matrix(rotations[known]).as_quat(canonical=True, scalar_first=True)
    return quaternions


def rotations_from_quaternions(quaternions: Array) -> Array:
    """Return rotation matrices of quaternions (w, x, y, z), which need not be of unit length.

    Parameters
    ----------
    quaternions : ndarray, shape (n, 4)
        Quaternions; NaN where not known.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Rotation matrices; NaN where the quaternion is.
    """
    rotations = np.full((len(quaternions), 3, 3), np.nan)
    known = np.isfinite(quaternions).all(axis=1)
    if known.any():
        rotations[known] = Rotation.from_quat(quaternions[known], scalar_first=True).as_matrix()
    return rotations


def continuous_signs(quaternions: Array) -> Array:
    """Return the same rotations with signs chosen so that neighbours in time lie on one side.

    A quaternion and its negative are the same rotation; a path that jumps between them cannot be
    interpolated or filtered. Frames that are not known are passed over.

    Parameters
    ----------
    quaternions : ndarray, shape (n, 4)
        Quaternions over time; NaN where not known.

    Returns
    -------
    ndarray, shape (n, 4)
        Quaternions whose product with the last known one before is not negative.
    """
    continuous = quaternions.copy()
    known = np.isfinite(quaternions).all(axis=1)
    path = quaternions[known]
    if len(path) > 1:
        turns = np.where(np.sum(path[1:] * path[:-1], axis=1) < 0, -1.0, 1.0)
        continuous[known] = path * np.concatenate(([1.0], np.cumprod(turns)))[:, None]
    return continuous


@dataclass(frozen=True, eq=False)
class RigidFit:
    """Rigid transforms that carry one set of points onto others.

    Attributes
    ----------
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotations; NaN where the points do not fix one.
    positions : ndarray, shape (n_frames, 3)
        Positions of the source's origin in the target frame [m].
    distances : ndarray, shape (n_frames, m)
        Distance of every target point, weighted or not, to its fitted place [m].
    """

    rotations: Array
    positions: Array
    distances: Array


def fit_rigid(source: Array, target: Array, weights: Array, minimum_spread: float = 0.0) -> RigidFit:
    """Fit the rigid transform from source to target, frame by frame, by weighted least squares.

    The rotation is that of Kabsch (1976, Acta Cryst. A32, 922): from the singular value decomposition of
    the weighted covariance, never a reflection.

    Parameters
    ----------
    source : ndarray, shape (m, 3)
        Points in the source frame [m].
    target : ndarray, shape (n_frames, m, 3)
        The same points in the target frame [m]; may be NaN where the weight is zero.
    weights : ndarray, shape (n_frames, m)
        Weight of each point in each frame, not negative.
    minimum_spread : float
        Points with weight whose root mean square distance from their common line is not more than this
        fix no rotation [m].

    Returns
    -------
    RigidFit
        The transforms; NaN in frames with fewer than three weighted points, or with collinear ones.
    """
    n_frames = len(target)
    total = weights.sum(axis=1)
    enough = (weights > 0).sum(axis=1) >= 3
    rotations = np.full((n_frames, 3, 3), np.nan)
    positions = np.full((n_frames, 3), np.nan)
    if enough.any():
        share = weights[enough] / total[enough, None]
        seen = np.where(share[..., None] > 0, target[enough], 0.0)
        source_centre = share @ source
        target_centre = np.einsum("fm,fmi->fi", share, seen)
        from_source = source - source_centre[:, None]
        from_target = seen - target_centre[:, None]
        covariance = np.einsum("fm,fmi,fmj->fij", share, from_target, from_source)
        left, spread, right = np.linalg.svd(covariance)
        # Where the best orthogonal matrix is a reflection, the last axis is turned over.
        left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        rotation = left @ right
        # The second singular value is the product of both sets' spreads across their longest axes; on a
        # line it is zero, and what rounding leaves of it is nothing to go by.
        rounding = 1e-12 * spread[:, 0]
        fixed = spread[:, 1] > np.maximum(minimum_spread**2, rounding)
        rotation[~fixed] = np.nan
        rotations[enough] = rotation
        positions[enough] = target_centre - np.einsum("fij,fj->fi", rotation, source_centre)
    fitted = transform_points(rotations, positions, source)
    return RigidFit(rotations, positions, np.linalg.norm(target - fitted, axis=2))
