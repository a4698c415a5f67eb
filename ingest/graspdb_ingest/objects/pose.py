"""The pose of an object in every frame, from its markers; no pose where they do not fix one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.parameters import PoseParameters
from graspdb_ingest.rigid import (
    Array,
    RigidFit,
    continuous_signs,
    fit_rigid,
    quaternions_from_rotations,
)
from graspdb_schemas.errors import ParameterError

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ObjectTrack:
    """The pose world_from_object over time; NaN where the seen markers do not fix it.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, 3)
        Origin of the object frame in the lab frame [m].
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotation matrices.
    quaternions : ndarray, shape (n_frames, 4)
        The same as unit quaternions (w, x, y, z), without jumps of sign.
    residuals : ndarray, shape (n_frames,)
        Root mean square distance of the used markers to their fitted places [m]; NaN without a fit.
    n_markers : ndarray of int, shape (n_frames,)
        Markers that the fit used, or that were seen where there is none.
    left_out : ndarray of bool, shape (n_frames, m)
        Markers that were seen and left out, since the others agree without them.
    """

    positions: Array
    rotations: Array
    quaternions: Array
    residuals: Array
    n_markers: NDArray[np.int64]
    left_out: Mask

    @property
    def known(self) -> Mask:
        """Frames that have a pose, shape (n_frames,)."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))


def track_object(markers: Array, model: Array, parameters: PoseParameters | None = None) -> ObjectTrack:
    """Find the object's pose in every frame by a rigid fit to the markers seen in it.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, m, 3)
        Marker positions in the lab frame [m]; NaN where not seen.
    model : ndarray, shape (m, 3)
        The same markers in the object frame [m].
    parameters : PoseParameters, optional
        When markers fix a pose, and when one of them is left out.

    Returns
    -------
    ObjectTrack
        The pose; NaN where fewer than three markers are seen, where those seen lie on a line, or where
        they are too far from their fitted places to be the object's markers.

    Raises
    ------
    ParameterError
        If the shapes do not belong together or the model is not finite.
    """
    parameters = parameters or PoseParameters()
    if markers.ndim != 3 or markers.shape[1:] != model.shape or markers.shape[2] != 3:
        raise ParameterError(
            "markers", markers.shape, f"(n_frames, {len(model)}, 3), one for each of the model"
        )
    if not np.isfinite(model).all():
        raise ParameterError("model", model.tolist(), "finite marker positions in the object frame")
    seen: Mask = np.asarray(np.isfinite(markers).all(axis=2))
    used = seen.copy()
    fit = fit_rigid(model, markers, used.astype(float), parameters.minimum_spread)
    while (dropped := _outliers(model, markers, used, fit, parameters)).any():
        used = np.logical_and(used, ~dropped)
        fit = fit_rigid(model, markers, used.astype(float), parameters.minimum_spread)
    return _as_track(fit, used, np.logical_and(seen, ~used), parameters.maximum_residual)


def _outliers(model: Array, markers: Array, used: Mask, fit: RigidFit, parameters: PoseParameters) -> Mask:
    """Return the one marker of each frame without which all others agree, shape (n_frames, m)."""
    worst = _worst(fit.distances, used)
    frames = np.flatnonzero((used.sum(axis=1) >= 4) & (worst > parameters.outlier_distance))
    outliers = np.zeros_like(used)
    if not len(frames):
        return outliers
    worst_without = np.full((len(frames), len(model)), np.inf)
    for marker in range(len(model)):
        others = used[frames].copy()
        others[:, marker] = False
        without = fit_rigid(model, markers[frames], others.astype(float), parameters.minimum_spread)
        agreement = _worst(without.distances, others)
        tried = used[frames, marker] & np.isfinite(agreement)
        worst_without[tried, marker] = agreement[tried]
    best = worst_without.argmin(axis=1)
    first, second = np.sort(worst_without, axis=1)[:, :2].T
    # Where leaving out another marker explains the frame nearly as well, it cannot be told which one jumped.
    clear = (first * parameters.outlier_ratio < worst[frames]) & (first * 2 < second)
    outliers[frames[clear], best[clear]] = True
    return outliers


def _worst(distances: Array, used: Mask) -> Array:
    """Return the largest distance of the used markers in each frame; NaN where there is no fit."""
    return np.asarray(np.where(used, distances, 0.0).max(axis=1, initial=0.0))


def _as_track(fit: RigidFit, used: Mask, left_out: Mask, maximum_residual: float) -> ObjectTrack:
    n_markers = used.sum(axis=1)
    squares = np.where(used, fit.distances, 0.0) ** 2
    residuals = np.sqrt(squares.sum(axis=1) / np.maximum(n_markers, 1))
    residuals[~np.isfinite(fit.positions).all(axis=1)] = np.nan
    trusted = residuals <= maximum_residual
    positions = np.where(trusted[:, None], fit.positions, np.nan)
    rotations = np.where(trusted[:, None, None], fit.rotations, np.nan)
    quaternions = continuous_signs(quaternions_from_rotations(rotations))
    return ObjectTrack(positions, rotations, quaternions, residuals, n_markers, left_out)
