"""One frame of the filter, compiled: the prediction, and its correction by what was measured."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.tree import (
    Placed,
    Points,
    Tree,
    integrate,
    place,
    write_jacobian,
    write_points,
)
from graspdb_ingest.tracking.algebra import (
    copy_vector,
    corrected,
    normal_equations,
    predicted_covariance,
    predicted_mean,
    solve,
    solve_measured,
)

LIMIT_SD: Final = np.deg2rad(0.5)
"""Tightness with which an angle beyond its limit is pulled back to it [rad]."""
LARGE_STEP: Final = 0.05
"""Markers are linearised again where a joint turns further than this from the last time [rad]."""
MAXIMUM_LINEARISATIONS: Final = 5


class Setting(NamedTuple):
    """All that stays the same from frame to frame.

    Attributes
    ----------
    tree, markers : Tree, Points
        The hand.
    transition, noise : ndarray, shape (4, n_dof), (4, n_dof, n_dof)
        The step between frames; see `algebra`.
    mean, lowest, highest : ndarray, shape (n_hinges,)
        Where joints usually are, and their limits [rad].
    root_weight : ndarray, shape (n_markers,)
        One over each marker's standard deviation [1/m].
    gate, angle_gate : float
        Greatest squared Mahalanobis distance of a marker, and of a joint angle, that passes.
    """

    tree: Tree
    markers: Points
    transition: Floats
    noise: Floats
    mean: Floats
    lowest: Floats
    highest: Floats
    root_weight: Floats
    gate: float
    angle_gate: float


class JointReadings(NamedTuple):
    """Joint angles that were measured besides markers.

    Attributes
    ----------
    hinges : ndarray of int, shape (k,)
        Places among the hand's hinges.
    angles : ndarray, shape (n_frames, k)
        Angles in every frame [rad], NaN where not measured.
    variance : ndarray, shape (k,)
        Variances of their errors [rad2].
    """

    hinges: NDArray[np.int64]
    angles: Floats
    variance: Floats


NO_READINGS: Final = JointReadings(np.zeros(0, dtype=np.int64), np.zeros((0, 0)), np.zeros(0))


@compiled
def predict(
    setting: Setting, q: Floats, velocity: Floats, blocks: Floats, factors: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return configuration, velocity and covariance one step later.

    `factors` are those on the standard deviation of the process noise, shape (n_dof,).

    The free joint's own axes turn by the small angle of a step meanwhile; that second-order turn of its
    covariance is left out.
    """
    change, moved = predicted_mean(offset_of(q, setting.mean), velocity, setting.transition)
    return (
        integrate(q, change),
        moved,
        predicted_covariance(blocks, setting.transition, setting.noise, factors),
    )


@compiled
def offset_of(q: Floats, mean: Floats) -> Floats:
    """Return how far hinges are from their mean, zero for the free joint, shape (n_dof,)."""
    offset = np.zeros(len(q) - 1)
    for hinge in range(len(mean)):
        offset[6 + hinge] = q[7 + hinge] - mean[hinge]
    return offset


@compiled
def correct(
    setting: Setting,
    placed: Placed,
    q: Floats,
    velocity: Floats,
    blocks: Floats,
    observed: Floats,
    readings: JointReadings,
    frame: int,
    gated: bool,
) -> tuple[Floats, Floats, Floats, Bools, bool, Floats]:
    """Correct a prediction by a frame of markers, and of joint angles.

    Gauss-Newton steps from the prediction, until every marker is linearised near the corrected
    posture (iterated extended Kalman filter, Bell and Cathey 1993).

    Returns
    -------
    q, velocity, blocks : ndarray
        The corrected state.
    used : ndarray of bool, shape (n_markers,)
        Markers that were seen and passed the gate.
    at_limit : bool
        Whether a joint had to be held at its limit.
    solved : ndarray, shape (n_dof + 1, n_dof)
        J^T S^-1 J and, in the last row, J^T S^-1 y.
    """
    n = len(velocity)
    jacobian, innovation = np.empty((len(observed), 3, n)), np.empty((len(observed), 3))
    seen = _linearise(setting, placed, q, observed, jacobian, innovation)
    used = _passing(setting, blocks[2], jacobian, innovation, seen) if gated else seen
    information, score, measured = _read(setting, q, blocks[2], readings, frame)
    weight = np.zeros(len(observed))
    for marker in range(len(observed)):
        if used[marker]:
            weight[marker], measured = setting.root_weight[marker], True
    if not measured:
        return q, velocity, blocks, used, False, np.zeros((n + 1, n))
    last, at_limit = np.zeros(n), False
    change, faster = last, last
    solved: Floats = np.empty((n + 1, n))
    for _ in range(MAXIMUM_LINEARISATIONS):
        normal = normal_equations(jacobian, innovation, weight)
        moved = np.dot(normal[:n], last)  # as if the innovation were that of the prediction
        for i in range(n):
            normal[i, i] += information[i]
            normal[n, i] += score[i] + moved[i]
        at_limit, solved = _within_limits(setting, q, blocks[2], normal)
        change, faster = np.dot(blocks[2], solved[n]), np.dot(blocks[3], solved[n])
        if _close(change, last):
            break
        last = change
        _linearise(setting, placed, integrate(q, last), observed, jacobian, innovation)
    for i in range(n):
        faster[i] += velocity[i]
    return integrate(q, change), faster, corrected(blocks, solved[:n]), used, at_limit, solved


@compiled
def _close(change: Floats, last: Floats) -> bool:
    """Return whether no joint turns further than `LARGE_STEP` from the last linearisation."""
    furthest = 0.0
    for i in range(3, len(change)):
        furthest = max(furthest, abs(change[i] - last[i]))
    return furthest < LARGE_STEP


@compiled
def _linearise(
    setting: Setting, placed: Placed, q: Floats, observed: Floats, jacobian: Floats, innovation: Floats
) -> Bools:
    """Return which markers are seen; write their Jacobian, and how far they are off (0 where unseen)."""
    place(setting.tree, q, placed)
    positions = np.empty((len(observed), 3))
    write_points(setting.markers, placed, positions)
    write_jacobian(setting.tree, setting.markers, placed, positions, jacobian)
    seen = np.empty(len(observed), dtype=np.bool_)
    for i in range(len(observed)):
        seen[i] = np.isfinite(observed[i, 0] + observed[i, 1] + observed[i, 2])
        for axis in range(3):
            innovation[i, axis] = observed[i, axis] - positions[i, axis] if seen[i] else 0.0
    return seen


@compiled
def _passing(
    setting: Setting, covariance: Floats, jacobian: Floats, innovation: Floats, seen: Bools
) -> Bools:
    """Gate each marker by the Mahalanobis distance of its innovation.

    A marker's own noise alone never gives a shorter distance than the whole spread does, so
    the spread is needed only where the noise alone does not explain the innovation.
    """
    passing = seen.copy()
    for i in range(len(seen)):
        distance = innovation[i]
        variance = 1 / setting.root_weight[i] ** 2
        if np.dot(distance, distance) > setting.gate * variance:
            system, spread = np.empty((3, 4)), np.dot(np.dot(jacobian[i], covariance), jacobian[i].T)
            for axis in range(3):
                copy_vector(spread[axis], system[axis, :3])
                system[axis, axis] += variance
                system[axis, 3] = distance[axis]
            solve(system)
            squared = 0.0
            for axis in range(3):
                squared += distance[axis] * system[axis, 3]
            passing[i] = squared <= setting.gate
    return passing


@compiled
def _read(
    setting: Setting, q: Floats, covariance: Floats, readings: JointReadings, frame: int
) -> tuple[Floats, Floats, bool]:
    """Return the precision, and the precision times the innovation, of each degree of freedom's reading.

    Both are zero where there is none, or it does not pass the gate. The last value says whether any does.
    """
    information, score, measured = np.zeros(len(covariance)), np.zeros(len(covariance)), False
    for k in range(len(readings.hinges)):
        dof = readings.hinges[k] + 6
        innovation = readings.angles[frame, k] - q[dof + 1]
        spread = covariance[dof, dof] + readings.variance[k]
        if innovation**2 <= setting.angle_gate * spread:  # false for NaN
            information[dof] = 1 / readings.variance[k]
            score[dof] = innovation / readings.variance[k]
            measured = True
    return information, score, measured


@compiled
def _within_limits(setting: Setting, q: Floats, covariance: Floats, normal: Floats) -> tuple[bool, Floats]:
    """Return whether a joint is held at its limit, and J^T S^-1 [J, y] transposed.

    Angles that leave their limits are measured to be there.
    """
    n = len(covariance)
    solved = solve_measured(covariance, normal)
    change = np.dot(covariance, solved[n])
    dofs, distances = np.empty(n, dtype=np.int64), np.empty(n)
    count = 0
    for i in range(6, n):
        angle = q[i + 1] + change[i]
        nearest = min(max(angle, setting.lowest[i - 6]), setting.highest[i - 6])
        if nearest != angle:
            dofs[count], distances[count] = i, nearest - angle
            count += 1
    if not count:
        return False, solved
    return True, _measured_besides(covariance, solved, dofs[:count], distances[:count])


@compiled
def _measured_besides(
    covariance: Floats, solved: Floats, dofs: NDArray[np.int64], innovation: Floats
) -> Floats:
    """Return what `solve_measured` gives if some degrees of freedom are then measured with `LIMIT_SD`.

    The correction by a second measurement E after a first: J^T S^-1 J grows by W E^T V^-1 E W^T with
    W = I - J^T S^-1 J P, V the covariance of the second innovation.
    """
    n, count = len(covariance), len(dofs)
    columns = np.empty((count, n))
    for k in range(count):
        copy_vector(covariance[dofs[k]], columns[k])  # a column too, of a symmetric matrix
    rest = np.dot(columns, solved[:n])
    for k in range(count):  # rows of W^T
        for j in range(n):
            rest[k, j] = (1.0 if j == dofs[k] else 0.0) - rest[k, j]
    system, spread = np.empty((count, count + n + 1)), np.dot(rest, columns.T)
    for k in range(count):
        copy_vector(spread[k], system[k, :count])
        system[k, k] += LIMIT_SD**2
        system[k, count + n] = innovation[k]
        copy_vector(rest[k], system[k, count : count + n])
    solve(system)
    besides = solved.copy()
    for k in range(count):
        for i in range(n):
            besides[n, i] += system[k, count + n] * rest[k, i]
            for j in range(n):
                besides[i, j] += rest[k, i] * system[k, count + j]
    return besides
