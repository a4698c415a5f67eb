"""The likelihood of the filter's innovations and its gradient by the scales of noise, compiled.

The gradient is exact and comes with the backward pass: that pass's adjoint vector and matrix are the
derivatives of the log likelihood by each prediction's mean and covariance.
"""

from typing import Final, NamedTuple

import numpy as np

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.tree import (
    Placed,
    integrate,
    place,
    write_jacobian,
    write_points,
)
from graspdb_ingest.tracking.algebra import (
    before_measurement,
    before_step,
    copy_matrix,
    copy_vector,
    log_determinant,
    predicted_covariance,
    predicted_mean,
    smoothed_covariance,
)
from graspdb_ingest.tracking.correction import JointReadings, Setting, correct, offset_of, predict

PERTURBATION: Final = 1e-4
"""By how much the logarithms of the scales of movement are moved for a process model's derivatives."""


class Perturbed(NamedTuple):
    """Process models with each scale of movement perturbed in turn, by `PERTURBATION`.

    Attributes
    ----------
    transitions, noises : ndarray, shape (n_scales, 4, n_dof), (n_scales, 4, n_dof, n_dof)
        As `MotionModel` has them.
    """

    transitions: Floats
    noises: Floats


class _Passed(NamedTuple):
    """Predictions and corrections of a window, a row a frame."""

    predicted_q: Floats
    predicted_blocks: Floats
    q: Floats
    velocity: Floats
    blocks: Floats
    used: Bools
    solved: Floats


@compiled
def likelihood(
    setting: Setting,
    placed: Placed,
    start: Floats,
    stationary: Floats,
    markers: Floats,
    nothing_read: JointReadings,
    perturbed: Perturbed,
) -> tuple[float, Floats]:
    """Return the log likelihood of a window and its derivatives by the logarithms of the scales.

    Parameters
    ----------
    setting, placed : Setting, Placed
        The filter; its markers all have one standard deviation.
    start : ndarray, shape (n_q,)
        Where the hand is in the first frame.
    stationary : ndarray, shape (4, n_dof, n_dof)
        Covariance that it starts with.
    markers : ndarray, shape (n_frames, n_markers, 3)
        The window [m], NaN where not seen; every marker counts.
    nothing_read : JointReadings
        No joint angles.
    perturbed : Perturbed
        Process models for the derivatives.

    Returns
    -------
    value : float
        The log likelihood, without the constant of the normal distribution.
    score : ndarray, shape (n_scales + 1,)
        Derivatives, that by the logarithm of the markers' standard deviation last.
    """
    passed = _forward(setting, placed, start, stationary, markers, nothing_read)
    n, n_scales = stationary.shape[1], len(perturbed.noises)
    value, score = 0.0, np.zeros(n_scales + 1)
    adjoint: Floats = np.zeros(2 * n)
    matrix: Floats = np.zeros((4, n, n))
    for i in range(len(markers) - 1, -1, -1):
        if i < len(markers) - 1:
            adjoint, matrix = before_step(adjoint, matrix, setting.transition)
        solved, blocks = passed.solved[i], passed.predicted_blocks[i]
        columns = blocks[2:].reshape(2 * n, n)
        adjoint, matrix = before_measurement(adjoint, matrix, columns, solved[:n], solved[n])
        if np.any(passed.used[i]):
            value += _log_density(setting, placed, passed, markers[i], i)
            step = np.dot(adjoint, columns)
            for dof in range(n):
                step[dof] = -step[dof]
            smoothed = integrate(passed.predicted_q[i], step)
            covariance = smoothed_covariance(matrix, columns)
            score[n_scales] += _noise_score(setting, placed, smoothed, covariance, markers[i], passed.used[i])
        if i:
            _add_motion_scores(setting, passed, perturbed, i, adjoint, matrix, score)
    return value, score


@compiled
def _forward(
    setting: Setting,
    placed: Placed,
    start: Floats,
    stationary: Floats,
    markers: Floats,
    nothing_read: JointReadings,
) -> _Passed:
    """Return prediction and correction of every frame."""
    m, n = len(markers), stationary.shape[1]
    passed = _Passed(
        np.empty((m, n + 1)),
        np.empty((m, 4, n, n)),
        np.empty((m, n + 1)),
        np.empty((m, n)),
        np.empty((m, 4, n, n)),
        np.empty((m, markers.shape[1]), dtype=np.bool_),
        np.empty((m, n + 1, n)),
    )
    velocity: Floats = np.zeros(n)
    q, blocks, usual, gated = start, stationary, np.ones(n), m < 0  # no literal, which is a type of its own
    for i in range(m):
        if i:
            q, velocity, blocks = predict(setting, q, velocity, blocks, usual)
        copy_vector(q, passed.predicted_q[i])
        for block in range(4):
            copy_matrix(blocks[block], passed.predicted_blocks[i, block])
        q, velocity, blocks, used, _, solved = correct(
            setting, placed, q, velocity, blocks, markers[i], nothing_read, i, gated
        )
        copy_vector(q, passed.q[i])
        copy_vector(velocity, passed.velocity[i])
        for block in range(4):
            copy_matrix(blocks[block], passed.blocks[i, block])
        copy_matrix(solved, passed.solved[i])
        for marker in range(len(used)):
            passed.used[i, marker] = used[marker]
    return passed


@compiled
def _log_density(setting: Setting, placed: Placed, passed: _Passed, observed: Floats, i: int) -> float:
    """Return the log density of a frame's innovation y.

    With S the innovation's covariance, det S follows from the matrix determinant lemma, and
    y^T S^-1 y is what the correction leaves of the markers' residuals and what it costs itself.
    """
    n = passed.solved.shape[2]
    covariance, weighted = passed.predicted_blocks[i, 2], passed.solved[i, n]
    rest = np.dot(passed.solved[i, :n], covariance)
    for row in range(n):
        for dof in range(n):
            rest[row, dof] = (1.0 if row == dof else 0.0) - rest[row, dof]
    place(setting.tree, passed.q[i], placed)
    positions = np.empty(observed.shape)
    write_points(setting.markers, placed, positions)
    squared = np.dot(weighted, np.dot(covariance, weighted))
    scale = 0.0
    for marker in range(len(observed)):
        if passed.used[i, marker]:
            weight = setting.root_weight[marker]
            for axis in range(3):
                squared += (weight * (observed[marker, axis] - positions[marker, axis])) ** 2
            scale += 3 * np.log(weight)
    return float((log_determinant(rest) - squared) / 2 + scale)


@compiled
def _noise_score(
    setting: Setting, placed: Placed, smoothed: Floats, covariance: Floats, observed: Floats, used: Bools
) -> float:
    """Return the derivative of the log likelihood by the logarithm of the markers' standard deviation.

    By Fisher's identity: the expected squared residuals, smoothed, against what they should be.
    """
    place(setting.tree, smoothed, placed)
    positions, n = np.empty(observed.shape), len(covariance)
    jacobian = np.empty((len(observed), 3, n))
    write_points(setting.markers, placed, positions)
    write_jacobian(setting.tree, setting.markers, placed, positions, jacobian)
    rows = jacobian.reshape(3 * len(observed), n)
    told, score = np.dot(rows, covariance), 0.0
    for marker in range(len(observed)):
        if used[marker]:
            for axis in range(3):
                row = 3 * marker + axis
                expected = (observed[marker, axis] - positions[marker, axis]) ** 2
                for dof in range(n):
                    expected += told[row, dof] * rows[row, dof]
                score += expected * setting.root_weight[marker] ** 2 - 1.0
    return score


@compiled
def _add_motion_scores(
    setting: Setting,
    passed: _Passed,
    perturbed: Perturbed,
    i: int,
    adjoint: Floats,
    matrix: Floats,
    score: Floats,
) -> None:
    """Add the derivatives of the log likelihood by the logarithms of the scales of one step's movement."""
    n = matrix.shape[1]
    rows, columns = (0, n, 0, n), (n, n, 0, 0)
    usual, blocks = np.ones(n), passed.predicted_blocks[i]
    offset, velocity = offset_of(passed.q[i - 1], setting.mean), passed.velocity[i - 1]
    change, moved = predicted_mean(offset, velocity, setting.transition)
    for k in range(len(perturbed.noises)):
        transition, slope = perturbed.transitions[k], 0.0
        other = predicted_covariance(passed.blocks[i - 1], transition, perturbed.noises[k], usual)
        for block in range(4):
            for a in range(n):
                left = adjoint[rows[block] + a]
                for b in range(n):
                    by_covariance = left * adjoint[columns[block] + b] - matrix[block, a, b]
                    slope += by_covariance * (other[block, a, b] - blocks[block, a, b]) / 2
        other_change, other_moved = predicted_mean(offset, velocity, transition)
        for dof in range(n):
            slope -= adjoint[dof] * (other_change[dof] - change[dof])
            slope -= adjoint[n + dof] * (other_moved[dof] - moved[dof])
        score[k] += slope / PERTURBATION
