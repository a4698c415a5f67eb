"""One frame by itself: the configuration that best explains the markers, from no start at all."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.algebra import normal_equations

MAXIMUM_STEPS = 60
FREE = 6  # degrees of freedom of the free joint, before the hinges
SEVEN = 7  # numbers of the free joint in a configuration


@dataclass(frozen=True)
class FrameFit:
    """A configuration fitted to one frame.

    Attributes
    ----------
    q : ndarray, shape (n_q,)
        The configuration.
    cost : float
        Half the sum of squared normalised residuals, prior included.
    residuals : ndarray, shape (n_markers, 3)
        Observed minus model [m], NaN where a marker was not seen.
    """

    q: Floats
    cost: float
    residuals: Floats

    @property
    def rms(self) -> float:
        """Root mean square distance of the seen markers to the model [m]."""
        return float(np.sqrt(np.nanmean(np.sum(self.residuals**2, axis=1))))


def fit_frame(
    kinematics: Kinematics,
    observed: Floats,
    prior: PosturePrior,
    marker_sd: Floats,
    starts: tuple[Floats, ...] = (),
) -> FrameFit:
    """Fit one frame by least squares with a weak prior on the joint angles.

    Levenberg-Marquardt on the manifold, joint angles kept within their limits. The starts are
    those given and the mean posture laid rigidly onto the seen markers, that and turned by half a
    turn about each axis, so that it finds the hand from nowhere.

    Parameters
    ----------
    kinematics : Kinematics
        The hand.
    observed : ndarray, shape (n_markers, 3)
        Marker positions [m], NaN where not seen.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker about its place on the model [m].
    starts : tuple of ndarray, each of shape (n_q,)
        Configurations to start from besides.

    Returns
    -------
    FrameFit
        The best of the fits.
    """
    candidates = (*starts, *_rigid_starts(kinematics, observed, prior))
    fits = (refit_frame(kinematics, observed, prior, marker_sd, q) for q in candidates)
    return min(fits, key=lambda fit: fit.cost)


def refit_frame(
    kinematics: Kinematics, observed: Floats, prior: PosturePrior, marker_sd: Floats, start: Floats
) -> FrameFit:
    """Fit one frame as `fit_frame` does, from one start alone: a configuration near the answer."""
    precision = np.linalg.inv(prior.covariance)
    target = _Target(observed, visible(observed), marker_sd[:, None], prior.mean, precision)
    return _descend(kinematics, target, start)


def visible(observed: Floats) -> Bools:
    """Return which markers were seen, shape (..., n_markers), from positions (..., n_markers, 3)."""
    return np.asarray(np.isfinite(observed).all(axis=-1))


def _rigid_starts(kinematics: Kinematics, observed: Floats, prior: PosturePrior) -> tuple[Floats, ...]:
    q = kinematics.hand.neutral()
    q[SEVEN:] = prior.mean
    kinematics.move(q)
    seen = visible(observed)
    model, target = kinematics.markers[seen], observed[seen]
    from_model, to_target = model.mean(axis=0), target.mean(axis=0)
    turn, _ = Rotation.align_vectors(target - to_target, model - from_model)
    starts = []
    for half_turn in (None, "x", "y", "z"):
        rotation = turn if half_turn is None else turn * Rotation.from_euler(half_turn, np.pi)
        start = q.copy()
        start[:3] = to_target - rotation.apply(from_model - q[:3])
        start[3:SEVEN] = (rotation * Rotation.from_quat(q[3:SEVEN], scalar_first=True)).as_quat(
            scalar_first=True
        )
        starts.append(start)
    return tuple(starts)


@dataclass(frozen=True)
class _Target:
    observed: Floats
    seen: Bools
    sd: Floats
    mean: Floats
    precision: Floats


def _descend(kinematics: Kinematics, target: _Target, start: Floats) -> FrameFit:
    hand, limits, seen = kinematics.hand, kinematics.hand.joint_range, target.seen
    q, damping = start, 1e-3
    residuals, cost = _cost(kinematics, target, q)
    root_weight = np.where(seen, 1 / target.sd[:, 0], 0.0)
    for _ in range(MAXIMUM_STEPS):
        kinematics.move(q)
        equations = normal_equations(kinematics.marker_jacobian(), residuals, root_weight)
        normal, gradient = equations[:-1], equations[-1]
        normal[FREE:, FREE:] += target.precision
        gradient[FREE:] -= target.precision @ (q[SEVEN:] - target.mean)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), gradient)
        trial = hand.integrate(q, step)
        trial[SEVEN:] = np.clip(trial[SEVEN:], limits[:, 0], limits[:, 1])
        new_residuals, new_cost = _cost(kinematics, target, trial)
        if new_cost < cost:
            gained = cost - new_cost
            q, residuals, cost, damping = trial, new_residuals, new_cost, damping / 5
            if gained < 1e-6 * cost + 1e-9:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return FrameFit(q=q, cost=cost, residuals=residuals)


def _cost(kinematics: Kinematics, target: _Target, q: Floats) -> tuple[Floats, float]:
    kinematics.move(q)
    residuals = target.observed - kinematics.markers
    angles = q[SEVEN:] - target.mean
    squared = np.sum((residuals / target.sd)[target.seen] ** 2) + angles @ target.precision @ angles
    return residuals, float(squared) / 2
