"""Calibration of a subject's hand: its shape and marker offsets from the recordings themselves.

Regularised nonlinear least squares over chosen frames: the shape is common to all frames, each
frame has a posture of its own (bundle adjustment). The postures are eliminated frame by frame
with the Schur complement, so the cost grows linearly with the number of frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.fit import FREE, SEVEN, fit_frame, visible
from graspdb_ingest.tracking.geometry import HandGeometry
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.manifest import MarkerPlacement

N_FRAMES: Final = 60
"""Frames that a calibration uses."""
MINIMUM_FRAMES: Final = 8
MAXIMUM_STEPS: Final = 40
OUTLIER: Final = 3.0
"""Residuals above this many standard deviations lose weight (Cauchy)."""


@dataclass(frozen=True)
class Calibration:
    """A hand fitted to a subject.

    Attributes
    ----------
    hand : HandModel
        The calibrated hand.
    before, after : ndarray, shape (n_markers,)
        Rms distance of each marker to the model over the chosen frames, with the hand as
        anthropometry and manifest give it, and calibrated [m]; NaN for a marker never seen.
    n_frames : int
        Number of frames used.
    """

    hand: HandModel
    before: Floats
    after: Floats
    n_frames: int


def calibrate_hand(
    hand: HandModel,
    placements: Mapping[str, MarkerPlacement],
    recordings: Sequence[Floats],
    prior: PosturePrior,
    marker_sd: float,
) -> Calibration:
    """Fit a hand's shape and marker offsets to recordings of it.

    Parameters
    ----------
    hand : HandModel
        The hand to start from, markers where the manifest or its segment's middle puts them.
    placements : mapping of str to MarkerPlacement
        Where each marker sits.
    recordings : sequence of ndarray, each of shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : float
        Standard deviation of a marker about its place on the segment [m].

    Returns
    -------
    Calibration
        The fitted hand and its residuals.

    Raises
    ------
    TrackingError
        If too few frames show enough markers.
    """
    frames = choose_frames(np.concatenate(list(recordings)))
    geometry = HandGeometry(hand, placements)
    kinematics = Kinematics(hand)
    rough_sd = np.hypot(geometry.marker_sd, 0.003)
    fits = [fit_frame(kinematics, frame, prior, rough_sd) for frame in frames]
    before = _rms_by_marker(np.array([fit.residuals for fit in fits]))
    parameters = _first_offsets(geometry, kinematics, frames, [fit.q for fit in fits])
    # Chosen frames differ as much as they can, so they are no independent draws from the prior: it
    # counts once for all of them. Once for each, it would bend the shape to make postures usual.
    once = PosturePrior(prior.mean, len(frames) * prior.covariance)
    bundle = _Bundle(geometry, kinematics, frames, visible(frames), once, marker_sd)
    parameters, postures = bundle.solve(parameters, [fit.q for fit in fits])
    residuals = bundle.residuals(parameters, postures)
    return Calibration(
        hand=hand.reshaped(geometry.shape(parameters)),
        before=before,
        after=_rms_by_marker(residuals),
        n_frames=len(frames),
    )


def choose_frames(markers: Floats, n_frames: int = N_FRAMES) -> Floats:
    """Choose well-seen frames whose postures differ as much as possible.

    Farthest-point sampling on the distances between markers, which tell postures apart wherever
    the hand is.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    n_frames : int
        How many to choose at the most.

    Returns
    -------
    ndarray, shape (at most n_frames, n_markers, 3)
        The chosen frames.

    Raises
    ------
    TrackingError
        If fewer than eight frames show six markers or more.
    """
    counts = visible(markers).sum(axis=1)
    enough = max(6, int(np.quantile(counts, 0.5)) - 2)
    usable = np.flatnonzero(counts >= enough)
    if len(usable) < MINIMUM_FRAMES:
        raise TrackingError(
            f"only {len(usable)} frames show {enough} or more of the hand's {markers.shape[1]} markers; "
            f"calibration needs {MINIMUM_FRAMES}",
            "Give the subject a calibration recording in which the whole hand is seen.",
        )
    usable = usable[np.linspace(0, len(usable) - 1, min(len(usable), 1500)).astype(int)]
    upper = np.triu_indices(markers.shape[1], k=1)
    signatures = np.linalg.norm(markers[usable][:, upper[0]] - markers[usable][:, upper[1]], axis=2)
    known = np.isfinite(signatures)
    signatures = np.where(known, signatures, 0.0)
    chosen = [int(np.argmax(counts[usable]))]
    nearest = np.full(len(usable), np.inf)
    while len(chosen) < min(n_frames, len(usable)):
        both = known & known[chosen[-1]]
        squared = np.sum(both * (signatures - signatures[chosen[-1]]) ** 2, axis=1)
        nearest = np.minimum(nearest, squared / np.maximum(both.sum(axis=1), 1))
        nearest[chosen[-1]] = -1
        chosen.append(int(np.argmax(nearest)))
    return np.asarray(markers[usable[np.sort(chosen)]])


def _first_offsets(
    geometry: HandGeometry, kinematics: Kinematics, frames: Floats, postures: Sequence[Floats]
) -> Floats:
    """Return parameters with the offsets of the markers to be found at their median over the frames."""
    local = np.full(frames.shape, np.nan)
    bodies = [int(kinematics.model.site_bodyid[i]) for i in kinematics.hand.marker_ids]
    nominal = np.array([kinematics.model.site_pos[i] for i in kinematics.hand.marker_ids])
    for i, (frame, q) in enumerate(zip(frames, postures, strict=True)):
        kinematics.move(q)
        arms = frame - kinematics.body_positions[bodies]
        local[i] = np.einsum("mji,mj->mi", kinematics.body_rotations[bodies], arms)
    parameters = np.zeros(geometry.n_parameters)
    offsets = parameters[-3 * frames.shape[1] :].reshape(-1, 3)
    for m, label in enumerate(kinematics.hand.markers):
        seen = np.isfinite(local[:, m, 0])
        if geometry.placements[label].calibrated and seen.any():
            offsets[m] = np.median(local[seen, m], axis=0) - nominal[m]
    return parameters


def _rms_by_marker(residuals: Floats) -> Floats:
    squared = np.sum(residuals**2, axis=2)
    seen = np.isfinite(squared)
    total = np.where(seen, squared, 0).sum(axis=0)
    unseen = np.full(len(total), np.nan)
    mean: Floats = np.divide(total, seen.sum(axis=0), out=unseen, where=seen.any(axis=0))
    return np.sqrt(mean)


@dataclass(frozen=True)
class _Bundle:
    """All frames together: a common shape, a posture for each frame."""

    geometry: HandGeometry
    kinematics: Kinematics
    frames: Floats
    seen: Bools
    prior: PosturePrior
    marker_sd: float

    def solve(self, parameters: Floats, postures: Sequence[Floats]) -> tuple[Floats, list[Floats]]:
        """Levenberg-Marquardt over shape and postures."""
        postures, damping = list(postures), 1e-3
        cost = self._cost(parameters, postures)
        for _ in range(MAXIMUM_STEPS):
            change, steps = self._step(parameters, postures, damping)
            new_parameters = parameters + change
            new_postures = [self._limited(q, step) for q, step in zip(postures, steps, strict=True)]
            new_cost = self._cost(new_parameters, new_postures)
            if new_cost < cost:
                gained = cost - new_cost
                parameters, postures, cost = new_parameters, new_postures, new_cost
                damping /= 5
                if gained < 1e-5 * cost:
                    break
            else:
                damping *= 10
                if damping > 1e8:
                    break
        return parameters, postures

    def residuals(self, parameters: Floats, postures: Sequence[Floats]) -> Floats:
        """Observed minus model [m], shape (n_frames, n_markers, 3)."""
        self.geometry.apply(self.kinematics, parameters)
        model = np.empty_like(self.frames)
        for i, q in enumerate(postures):
            self.kinematics.move(q)
            model[i] = self.kinematics.markers
        return np.asarray(self.frames - model)

    def _limited(self, q: Floats, step: Floats) -> Floats:
        limits = self.kinematics.hand.joint_range
        moved = self.kinematics.hand.integrate(q, step)
        moved[SEVEN:] = np.clip(moved[SEVEN:], limits[:, 0], limits[:, 1])
        return moved

    def _cost(self, parameters: Floats, postures: Sequence[Floats]) -> float:
        squared = np.sum(self.residuals(parameters, postures) ** 2, axis=2) / self.marker_sd**2
        robust = OUTLIER**2 * np.log1p(np.where(self.seen, squared, 0) / OUTLIER**2)
        angles = np.array([q[SEVEN:] for q in postures]) - self.prior.mean
        posture = np.sum(angles * np.linalg.solve(self.prior.covariance, angles.T).T)
        shape = np.sum((parameters / self.geometry.prior_sd) ** 2)
        return float(robust.sum() + posture + shape) / 2

    def _step(
        self, parameters: Floats, postures: Sequence[Floats], damping: float
    ) -> tuple[Floats, list[Floats]]:
        """Solve the damped normal equations, postures eliminated frame by frame."""
        precision = np.linalg.inv(self.prior.covariance)
        shape_normal = np.diag(1 / self.geometry.prior_sd**2)
        shape_gradient = -parameters / self.geometry.prior_sd**2
        self.geometry.apply(self.kinematics, parameters)
        eliminated = []
        for frame, seen, q in zip(self.frames, self.seen, postures, strict=True):
            self.kinematics.move(q)
            residual = (frame - self.kinematics.markers)[seen] / self.marker_sd
            weight = np.sqrt(1 / (1 + np.sum(residual**2, axis=1) / OUTLIER**2))[:, None]
            residual = (weight * residual).ravel()
            weight = weight[..., None] / self.marker_sd
            by_q = (weight * self.kinematics.marker_jacobian()[seen]).reshape(len(residual), -1)
            by_shape = self.geometry.jacobian(self.kinematics, parameters)[seen]
            by_shape = (weight * by_shape).reshape(len(residual), -1)
            normal = by_q.T @ by_q
            normal[FREE:, FREE:] += precision
            gradient = by_q.T @ residual
            gradient[FREE:] -= precision @ (q[SEVEN:] - self.prior.mean)
            normal += damping * np.diag(np.diag(normal) + 1e-9)
            cross = by_q.T @ by_shape
            solved = np.linalg.solve(normal, np.column_stack([cross, gradient]))
            shape_normal += by_shape.T @ by_shape - cross.T @ solved[:, :-1]
            shape_gradient += by_shape.T @ residual - cross.T @ solved[:, -1]
            eliminated.append(solved)
        damped = shape_normal + damping * np.diag(1 / self.geometry.prior_sd**2)
        change = np.linalg.solve(damped, shape_gradient)
        return change, [solved[:, -1] - solved[:, :-1] @ change for solved in eliminated]
