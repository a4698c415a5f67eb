"""The scale of the process noise in time: found again where it is known, and its counts true."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.activity import WINDOW, next_activity, noise_ratio, parts_of
from graspdb_ingest.tracking.algebra import disturbance, predicted_mean
from graspdb_ingest.tracking.following import follow, make_follower
from graspdb_ingest.tracking.motion import MotionModel, MotionNoise, from_blocks, motion_model
from graspdb_ingest.tracking.smoother import Disturbances, ForwardPass
from graspdb_schemas.vocabulary import Side

RATE, N_FRAMES = 60.0, 360
PARAMETERS = TrackingParameters()
NOISE = MotionNoise.assumed(PARAMETERS)
WILD = slice(150, 250)


@pytest.fixture(scope="module")
def hand(hands):
    return hands[Side.RIGHT]


@pytest.fixture(scope="module")
def motion(hand):
    return motion_model(hand, default_prior(hand), NOISE, 1 / RATE)


@pytest.fixture(scope="module")
def markers(hand, motion):
    """Return the markers of a hand that the motion model moves, five times as calmly but for a while."""
    rng, prior = np.random.default_rng(3), default_prior(hand)
    q, velocity, seen = hand.neutral(), np.zeros(hand.n_dof), []
    values, vectors = np.linalg.eigh(motion.noise)
    root = vectors * np.sqrt(np.maximum(values, 0))
    for frame in range(N_FRAMES):
        offset = np.concatenate([np.zeros(6), q[7:] - prior.mean])
        change, velocity = predicted_mean(offset, velocity, motion.transition)
        w = (root @ rng.normal(size=len(root))) * (1.0 if WILD.start <= frame < WILD.stop else 0.2)
        q = hand.integrate(q, change + w[: hand.n_dof])
        velocity = velocity + w[hand.n_dof :]
        seen.append(hand.forward(q).markers + rng.normal(0, 0.0005, (24, 3)))
    return np.array(seen)


def disturbances(hand, motion: MotionModel, markers, activity) -> Disturbances:
    noise = replace(NOISE, marker_sd=0.0005)
    follower = make_follower(Kinematics(hand), motion, default_prior(hand), PARAMETERS, RATE, noise)
    forward, found = (
        ForwardPass(len(markers), hand.n_dof, len(hand.markers)),
        Disturbances(*np.zeros((2, *activity.shape))),
    )
    for stretch in follow(follower, markers, None, forward, activity):
        for part in forward.smooth(motion, activity[stretch.rows]):
            rows = slice(stretch.first + part.frames.start, stretch.first + part.frames.stop)
            found.squared[rows] = part.disturbances.squared
            found.determined[rows] = part.disturbances.determined
    return found


@pytest.fixture(scope="module")
def rounds(hand, motion, markers):
    """Return factors and disturbances of four rounds."""
    activity, found = np.ones((N_FRAMES, hand.n_dof)), []
    for _ in range(4):
        seen = disturbances(hand, motion, markers, activity)
        found.append((activity, seen))
        activity = next_activity(seen, parts_of(hand), RATE, activity)
    return found


def test_a_wild_stretch_is_told_from_a_calm_one(rounds):
    activity = rounds[-1][0]
    calm = np.r_[30:130, 280:340]
    for dof in (0, 4, 6, 10, 16):
        wild = np.median(activity[165:235, dof])
        assert 0.6 < wild < 1.5
        assert np.median(activity[calm, dof]) < 0.5 * wild


def test_factors_come_to_rest(rounds):
    last = [np.log(activity[20:-20]) for activity, _ in rounds]
    changes = [np.abs(b - a).mean() for a, b in pairwise(last)]
    assert changes[2] < 0.5 * changes[0]


def test_disturbances_have_the_size_that_their_number_says_once_the_factors_fit(rounds, hand):
    _, seen = rounds[-1]
    for part in range(3):
        own = parts_of(hand) == part
        ratio = seen.squared[20:-20, own].sum() / seen.determined[20:-20, own].sum()
        assert 0.7 < ratio < 1.2


def test_data_tell_at_the_most_two_disturbances_a_degree_of_freedom(rounds):
    for _, seen in rounds:
        assert (seen.determined.sum(axis=1) > -1e-6).all()
        assert (seen.determined.sum(axis=1) < 58 + 1e-6).all()


def test_parts_share_out_what_the_whole_has(motion):
    rng = np.random.default_rng(0)
    adjoint, root = rng.normal(size=58), rng.normal(size=(58, 58))
    whole = root @ root.T
    blocks = np.array([whole[:29, 29:], whole[29:, 29:], whole[:29, :29], whole[29:, :29]])
    factors = rng.uniform(0.5, 2, 29)
    squared, determined = disturbance(adjoint, blocks, motion.noise_blocks, factors)
    scale = np.tile(factors, 2)
    noise = motion.noise * np.outer(scale, scale)
    assert squared.sum() == pytest.approx(adjoint @ noise @ adjoint)
    assert determined.sum() == pytest.approx(np.trace(noise @ whole))
    assert from_blocks(blocks) == pytest.approx(whole)


def test_a_hand_that_nobody_sees_keeps_its_factors(hand):
    unseen = Disturbances(np.zeros((50, 29)), np.zeros((50, 29)))
    before = np.random.default_rng(1).uniform(0.5, 2, (50, 29))
    assert next_activity(unseen, parts_of(hand), RATE, before) == pytest.approx(before)


@pytest.mark.parametrize(("noise", "slow"), [(0.3, False), (1.0, False), (0.5, True)])
def test_noise_is_measured_from_what_a_track_leaves(noise, slow):
    rng = np.random.default_rng(5)
    n, n_markers, taken = 6000, 24, 29
    errors = rng.normal(0, noise, (n // 60 if slow else n, 3 * n_markers))
    errors = np.repeat(errors, 60, axis=0) if slow else errors
    # a posture that takes up all of the noise in its own directions, or next to nothing of it
    space = np.linalg.qr(rng.normal(size=(3 * n_markers, taken)))[0]
    left = errors - errors @ space @ space.T if slow else errors
    told = Disturbances(*np.zeros((2, n, taken)))
    # white noise averages out over a window, slow noise is the same in all of its frames
    expected = noise**2 * (WINDOW * RATE if slow else 1)
    assert noise_ratio(left.reshape(n, n_markers, 3), told, RATE) == pytest.approx(expected, rel=0.25)
    assert noise_ratio(np.full((n, n_markers, 3), np.nan), told, RATE) == 1.0
