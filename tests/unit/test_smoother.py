"""The backward pass against the textbook's Rauch-Tung-Striebel smoother, on a linear problem."""

from dataclasses import dataclass

import numpy as np
import pytest

from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.algebra import before_step, corrected, predicted_covariance, solve_measured
from graspdb_ingest.tracking.filter import State, Update
from graspdb_ingest.tracking.motion import MotionNoise, from_blocks, motion_model, to_blocks
from graspdb_ingest.tracking.smoother import ForwardPass
from graspdb_schemas.vocabulary import N_DOF, Side

N_FRAMES = 300
GAP = range(100, 180)
NOISE = 0.1


@dataclass(frozen=True)
class Linear:
    """A linear problem: random measurements of random combinations of the positions."""

    rows: list[np.ndarray]
    values: list[np.ndarray]


@pytest.fixture(scope="module")
def motion(hands):
    hand = hands[Side.RIGHT]
    return motion_model(hand, default_prior(hand), MotionNoise.assumed(TrackingParameters()), 1 / 120)


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(1)
    counts = [0 if i in GAP else 40 if i % 3 else 5 for i in range(N_FRAMES)]
    return Linear(
        [rng.normal(size=(count, N_DOF)) for count in counts],
        [rng.normal(0, NOISE, count) for count in counts],
    )


def transition(motion):
    return np.block(
        [
            [np.diag(motion.transition[0]), np.diag(motion.transition[1])],
            [np.diag(motion.transition[2]), np.diag(motion.transition[3])],
        ]
    )


def textbook(problem, motion):
    """Return means and covariances of the positions by the dense filter and the dense smoother."""
    a = transition(motion)
    x, p = np.zeros(2 * N_DOF), np.diag(np.repeat([0.1, 1.0], N_DOF))
    predicted, corrected = [], []
    for i, (rows, values) in enumerate(zip(problem.rows, problem.values, strict=True)):
        if i:
            x, p = a @ x, a @ p @ a.T + motion.noise
        predicted.append((x, p))
        h = np.hstack([rows, np.zeros_like(rows)])
        gain = np.linalg.solve(h @ p @ h.T + NOISE**2 * np.eye(len(h)), h @ p).T
        rest = np.eye(2 * N_DOF) - gain @ h
        x, p = x + gain @ (values - h @ x), rest @ p @ rest.T + NOISE**2 * gain @ gain.T
        corrected.append((x, p))
    smoothed = [corrected[-1]]
    for (x, p), (ahead_x, ahead_p) in zip(corrected[-2::-1], predicted[:0:-1], strict=True):
        gain = np.linalg.solve(ahead_p, a @ p).T
        after_x, after_p = smoothed[-1]
        smoothed.append((x + gain @ (after_x - ahead_x), p + gain @ (after_p - ahead_p) @ gain.T))
    return smoothed[::-1]


def ours(problem, motion):
    """Return means and covariances of the positions by the filter's solution and the backward pass."""
    forward = ForwardPass(N_FRAMES, N_DOF, 0)
    x, p = np.zeros(2 * N_DOF), np.diag(np.repeat([0.1, 1.0], N_DOF))
    predictions = np.empty((N_FRAMES, N_DOF))
    for i, (rows, values) in enumerate(zip(problem.rows, problem.values, strict=True)):
        if i:
            x, p = (
                transition(motion) @ x,
                from_blocks(
                    predicted_covariance(to_blocks(p), motion.transition, motion.noise_blocks, np.ones(N_DOF))
                ),
            )
        blocks, predictions[i] = to_blocks(p), x[:N_DOF]
        information, score = rows.T @ rows / NOISE**2, rows.T @ (values - rows @ x[:N_DOF]) / NOISE**2
        solved = solve_measured(blocks[2], np.vstack([information, score]))
        predicted = State(np.zeros(N_DOF + 1), x[N_DOF:], blocks)  # configurations play no part
        forward.append(predicted, Update(predicted, np.zeros(0, bool), False, solved[:-1], solved[-1]))
        x, p = x + p[:, :N_DOF] @ solved[-1], from_blocks(corrected(blocks, solved[:-1]))
    means, covariances = np.empty((N_FRAMES, N_DOF)), np.empty((N_FRAMES, N_DOF, N_DOF))
    for part in forward.smooth(motion):
        means[part.frames] = predictions[part.frames] + part.step
        covariances[part.frames] = part.covariance
    return means, covariances


def test_backward_pass_is_the_textbooks_smoother(problem, motion):
    means, covariances = ours(problem, motion)
    for i, (x, p) in enumerate(textbook(problem, motion)):
        spread = np.sqrt(np.diagonal(p)[:N_DOF])
        assert np.abs((means[i] - x[:N_DOF]) / spread).max() < 1e-6
        assert np.abs((covariances[i] - p[:N_DOF, :N_DOF]) / np.outer(spread, spread)).max() < 1e-6


def test_adjoint_steps_are_the_transposed_transition(motion):
    rng = np.random.default_rng(2)
    a, vector = transition(motion), rng.normal(size=2 * N_DOF)
    root = rng.normal(size=(2 * N_DOF, 2 * N_DOF))
    matrix = root + root.T
    earlier, carried = before_step(vector, to_blocks(matrix), motion.transition)
    assert np.allclose(earlier, a.T @ vector, atol=1e-12)
    assert np.allclose(from_blocks(carried), a.T @ matrix @ a, atol=1e-10)
