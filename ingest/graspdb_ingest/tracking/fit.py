"""One frame by itself: the configuration that best explains the markers, from no start at all."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.hand.tree import (
    Placed,
    Points,
    Tree,
    integrate,
    memory_of,
    place,
    write_jacobian,
    write_points,
)
from graspdb_ingest.tracking.algebra import normal_equations, solve

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
    hand = kinematics.hand
    seen = visible(observed)
    q, cost, residuals = _descend(
        kinematics.tree,
        kinematics.marker_points,
        hand.joint_range,
        np.ascontiguousarray(observed, dtype=float),
        np.where(seen, 1 / marker_sd, 0.0),
        np.asarray(prior.mean, dtype=float),
        np.linalg.inv(prior.covariance),
        start,
    )
    return FrameFit(q=q, cost=cost, residuals=residuals)


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


@compiled
def _descend(
    tree: Tree,
    markers: Points,
    limits: Floats,
    observed: Floats,
    root_weight: Floats,
    mean: Floats,
    precision: Floats,
    start: Floats,
) -> tuple[Floats, float, Floats]:
    """Return configuration, cost and residuals, shape (n_markers, 3), at the end of the descent."""
    n, placed = len(start) - 1, memory_of(tree)
    jacobian, system = np.empty((len(observed), 3, n)), np.empty((n, n + 1))
    q, damping = start, 1e-3
    residuals, cost = _cost(tree, markers, placed, observed, root_weight, mean, precision, q)
    for _ in range(MAXIMUM_STEPS):
        place(tree, q, placed)
        write_jacobian(tree, markers, placed, observed - residuals, jacobian)
        normal = normal_equations(jacobian, residuals, root_weight)
        pull = np.dot(precision, q[SEVEN:] - mean)
        for i in range(n):
            for j in range(n):
                system[i, j] = normal[i, j]
                if i >= FREE and j >= FREE:
                    system[i, j] += precision[i - FREE, j - FREE]
            system[i, i] += damping * (system[i, i] + 1e-9)
            system[i, n] = normal[n, i] - (pull[i - FREE] if i >= FREE else 0.0)
        solve(system)
        trial = integrate(q, system[:, n])
        for hinge in range(len(limits)):
            trial[SEVEN + hinge] = min(max(trial[SEVEN + hinge], limits[hinge, 0]), limits[hinge, 1])
        new_residuals, new_cost = _cost(tree, markers, placed, observed, root_weight, mean, precision, trial)
        if new_cost < cost:
            gained = cost - new_cost
            q, residuals, cost, damping = trial, new_residuals, new_cost, damping / 5
            if gained < 1e-6 * cost + 1e-9:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return q, cost, residuals


@compiled
def _cost(
    tree: Tree,
    markers: Points,
    placed: Placed,
    observed: Floats,
    root_weight: Floats,
    mean: Floats,
    precision: Floats,
    q: Floats,
) -> tuple[Floats, float]:
    """Return the residuals of a configuration, shape (n_markers, 3), and its cost."""
    positions = np.empty((len(observed), 3))
    place(tree, q, placed)
    write_points(markers, placed, positions)
    residuals, angles = observed - positions, q[SEVEN:] - mean
    squared = np.dot(angles, np.dot(precision, angles))
    for i in range(len(residuals)):
        if root_weight[i] > 0:
            for axis in range(3):
                squared += (root_weight[i] * residuals[i, axis]) ** 2
    return residuals, squared / 2
