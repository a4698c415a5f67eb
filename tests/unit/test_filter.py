"""The Kalman filter against its dense form, its consistency, its gate and its limits."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.correction import LIMIT_SD
from graspdb_ingest.tracking.filter import HandFilter, State
from graspdb_ingest.tracking.motion import MotionNoise, motion_model, to_blocks
from graspdb_schemas.vocabulary import N_DOF, Side

RATE, NOISE = 120.0, 0.001


@pytest.fixture(scope="module")
def hand(hands):
    return hands[Side.RIGHT]


@pytest.fixture(scope="module")
def prior(hand):
    return default_prior(hand)


@pytest.fixture(scope="module")
def motion(hand, prior):
    return motion_model(hand, prior, MotionNoise.assumed(TrackingParameters()), 1 / RATE)


@pytest.fixture
def filter_(hand, prior, motion):
    return HandFilter(Kinematics(hand), motion, prior, np.full(24, NOISE), 0.9999)


def settled(filter_, hand, prior):
    """Return a state after a second of a still hand, and its configuration."""
    rng = np.random.default_rng(1)
    q = hand.neutral()
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = prior.mean
    state = filter_.start(q)
    for _ in range(120):
        observed = hand.forward(q).markers + rng.normal(0, NOISE, (24, 3))
        state = filter_.update(filter_.predict(state), observed).state
    return state, q


def test_update_is_the_dense_kalman_update(filter_, hand, prior):
    state, q = settled(filter_, hand, prior)
    state = filter_.predict(state)
    observed = hand.forward(q).markers + np.random.default_rng(2).normal(0, NOISE, (24, 3))
    observed[[3, 11]] = np.nan
    update = filter_.update(state, observed)
    seen = update.used
    assert np.array_equal(seen, np.isfinite(observed[:, 0]))
    h = np.hstack([hand.marker_jacobian(state.q)[seen].reshape(-1, N_DOF), np.zeros((3 * seen.sum(), N_DOF))])
    innovation = (observed - hand.forward(state.q).markers)[seen].ravel()
    p = state.covariance
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + NOISE**2 * np.eye(len(h)))
    step = gain @ innovation
    assert np.allclose(hand.difference(state.q, update.state.q), step[:N_DOF], atol=1e-9)
    assert np.allclose(update.state.velocity, state.velocity + step[N_DOF:], atol=1e-8)
    scale = np.sqrt(np.diagonal(p))
    dense = (p - gain @ h @ p) / np.outer(scale, scale)
    assert np.allclose(update.state.covariance / np.outer(scale, scale), dense, atol=1e-9)


def test_covariance_stays_symmetric_and_positive(filter_, hand, prior):
    covariance = settled(filter_, hand, prior)[0].covariance
    assert np.array_equal(covariance, covariance.T)
    scale = np.sqrt(np.diagonal(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 0


def test_normalised_estimation_error_squared_is_about_the_degrees_of_freedom(filter_, hand, prior, motion):
    rng = np.random.default_rng(3)
    truth = filter_.start(hand.neutral())
    truth = State(np.r_[truth.q[:7], prior.mean], truth.velocity, truth.blocks)
    root = np.linalg.cholesky(motion.noise)
    state, errors = truth, []
    for i in range(360):
        moved = filter_.predict(State(truth.q, truth.velocity, truth.blocks * 0))
        shock = root @ rng.normal(size=2 * N_DOF)
        q = hand.integrate(moved.q, shock[:N_DOF])
        q[7:] = np.clip(q[7:], *hand.joint_range.T)
        truth = State(q, moved.velocity + shock[N_DOF:], truth.blocks)
        observed = hand.forward(q).markers + rng.normal(0, NOISE, (24, 3))
        state = filter_.update(filter_.predict(state), observed).state
        if i >= 60:
            error = hand.difference(state.q, q)[6:]
            errors.append(error @ np.linalg.solve(state.covariance[6:N_DOF, 6:N_DOF], error))
    share = np.mean(errors) / (N_DOF - 6)
    print(f"normalised estimation error squared of the joint angles: {share:.2f} of their number")
    assert 0.3 < share < 3


def test_gate_passes_noise_and_stops_a_far_marker(filter_, hand, prior):
    state, q = settled(filter_, hand, prior)
    predicted = filter_.predict(state)
    observed = hand.forward(q).markers
    assert filter_.update(predicted, observed).used.all()
    observed[9] += (0.0, 0.05, 0.0)
    gated = filter_.update(predicted, observed)
    assert np.array_equal(np.flatnonzero(~gated.used), [9])
    assert filter_.update(predicted, observed, gated=False).used.all()


def test_frame_without_markers_changes_nothing(filter_, hand, prior):
    state, _ = settled(filter_, hand, prior)
    update = filter_.update(state, np.full((24, 3), np.nan))
    assert np.array_equal(update.state.q, state.q)
    assert np.array_equal(update.state.blocks, state.blocks)
    assert not update.used.any()
    assert not update.at_limit


def test_hand_left_alone_relaxes_to_the_mean_posture(filter_, hand, prior):
    q = hand.neutral()
    q[7:] = prior.mean + 0.2
    state = State(q, np.zeros(N_DOF), to_blocks(1e-6 * np.eye(2 * N_DOF)))
    for _ in range(4 * 120):
        state = filter_.predict(state)
    assert np.allclose(state.q[7:], prior.mean, atol=1e-4)
    assert np.allclose(np.diagonal(state.covariance)[6:N_DOF], np.diagonal(prior.covariance), rtol=1e-3)
    assert np.array_equal(state.q[:3], q[:3])


@pytest.mark.parametrize("end", [0, 1])
def test_angle_pulled_beyond_its_limit_is_held_there(filter_, hand, prior, end):
    dip = hand.joints.index("middle_dip_flexion")
    limit = hand.joint_range[dip, end]
    q = hand.neutral()
    q[7:] = prior.mean
    q[7 + dip] = limit
    beyond = q.copy()
    beyond[7 + dip] += (-1, 1)[end] * 0.3
    update = filter_.update(filter_.start(q), hand.forward(beyond).markers, gated=False)
    assert update.at_limit
    assert update.state.q[7 + dip] == pytest.approx(limit, abs=np.deg2rad(2))


def test_joint_held_at_its_limit_is_one_more_measurement_of_the_dense_update(filter_, hand, prior):
    state, _ = settled(filter_, hand, prior)
    dips = [hand.joints.index(f"{digit}_dip_flexion") for digit in ("index", "ring")]
    q = state.q.copy()
    q[[7 + dip for dip in dips]] = hand.joint_range[dips, 1]
    state = State(q, state.velocity, state.blocks)
    beyond = q.copy()
    beyond[[7 + dip for dip in dips]] += 0.02
    observed = hand.forward(beyond).markers
    update = filter_.update(state, observed, gated=False)
    assert update.at_limit
    h = np.hstack([hand.marker_jacobian(q).reshape(-1, N_DOF), np.zeros((72, N_DOF))])
    held = np.zeros((2, 2 * N_DOF))
    held[[0, 1], [6 + dip for dip in dips]] = 1
    h = np.vstack([h, held])
    noise = np.diag(np.r_[np.full(72, NOISE**2), np.full(2, LIMIT_SD**2)])
    innovation = np.r_[(observed - hand.forward(q).markers).ravel(), 0, 0]
    p = state.covariance
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + noise)
    assert np.allclose(hand.difference(q, update.state.q), (gain @ innovation)[:N_DOF], atol=1e-9)
    scale = np.sqrt(np.outer(np.diagonal(p), np.diagonal(p)))
    assert np.allclose(update.state.covariance / scale, (p - gain @ h @ p) / scale, atol=1e-9)
