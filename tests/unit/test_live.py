"""A hand followed live: the same numbers as the recording's forward pass, contacts of the same frame."""

import gc
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import graspdb
from graspdb_ingest.contact import signed_gaps
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.live import HandTracker
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject, prepare_object
from graspdb_ingest.tracking.following import follow, make_follower
from graspdb_ingest.tracking.motion import MotionNoise, motion_model
from graspdb_ingest.tracking.smoother import ForwardPass
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.manifest import SessionObject
from graspdb_schemas.vocabulary import SITES, Side

RATE, N = 120.0, 200
BALL = {"a": (0.03, 0.0, 0.0), "b": (0.0, 0.03, 0.0), "c": (0.0, 0.0, 0.03), "d": (-0.03, 0.0, 0.0)}


def recorded(hand, rng):
    """Return true sites and markers of a moving hand, some markers missing, some frames empty."""
    t = np.arange(N) / RATE
    low, high = hand.joint_range.T
    q = np.repeat(hand.neutral()[None], N, axis=0)
    q[:, 7:] = (low + high) / 2 + 0.2 * (high - low) * np.sin(4 * t[:, None] + np.arange(len(low)))
    q[:, 0] = 0.1 * np.sin(3 * t)
    true = hand.forward(q)
    markers = true.markers + rng.normal(0, 0.0005, true.markers.shape)
    markers[rng.random(markers.shape[:2]) < 0.1] = np.nan
    markers[90:95] = np.nan
    return true.sites, markers


@pytest.fixture(scope="module")
def ball(tmp_path_factory) -> PreparedObject:
    file = tmp_path_factory.mktemp("ball") / "ball.stl"
    trimesh.creation.icosphere(subdivisions=4, radius=0.03).export(file)
    return prepare_object(SessionObject("ball", file, 1.0, BALL), IngestParameters())


def forward(hand, markers):
    """Return configuration and standard deviations of the last frame of a recording's first forward pass.

    A smoother has nothing to add to the last frame.
    """
    tracking, prior = IngestParameters().tracking, default_prior(hand)
    noise = MotionNoise.assumed(tracking)
    motion = motion_model(hand, prior, noise, 1 / RATE)
    follower = make_follower(Kinematics(hand), motion, prior, tracking, RATE, noise)
    memory = ForwardPass(len(markers), hand.n_dof, len(hand.markers))
    for stretch in follow(follower, markers, None, memory):
        last = next(iter(stretch.forward.smooth(motion)))
        q = hand.integrate(memory.record.q[memory.length - 1], last.step[-1])
        used = memory.record.used[memory.length - 1].copy()
    q[7:] = np.clip(q[7:], *hand.joint_range.T)
    return q, np.sqrt(np.diagonal(last.covariance[-1])), used


@pytest.mark.parametrize("side", list(Side))
def test_each_step_is_the_last_frame_of_a_recordings_forward_pass(hands, side):
    hand = hands[side]
    _, markers = recorded(hand, np.random.default_rng(0))
    tracker = HandTracker(hand, RATE)
    estimates = [tracker.step(frame) for frame in markers]
    for last in (0, 1, 60, 92, 130, N - 1):
        q, q_sd, used = forward(hand, markers[: last + 1])
        assert np.allclose(estimates[last].q, q, atol=1e-9)
        assert np.allclose(estimates[last].q_sd, q_sd, rtol=1e-6)
        assert np.allclose(estimates[last].sites, hand.forward(q).sites, atol=1e-9)
        assert np.array_equal(estimates[last].used, used)


def test_standard_deviations_of_sites_say_how_far_off_they_are(hands):
    hand = hands[Side.RIGHT]
    true, markers = recorded(hand, np.random.default_rng(3))
    noise = replace(MotionNoise.assumed(IngestParameters().tracking), marker_sd=0.0005)
    tracker = HandTracker(hand, RATE, noise=noise)
    estimates = [tracker.step(frame) for frame in markers]
    errors = np.linalg.norm(np.array([e.sites for e in estimates]) - true, axis=2)[20:]
    sds = np.array([e.sites_sd for e in estimates])[20:]
    assert np.mean(errors < 2 * sds) > 0.93
    assert 0.5 < np.sqrt(np.median(errors**2 / sds**2)) < 1.1


def test_contacts_are_those_of_the_same_frame(hands, ball):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(1)
    _, markers = recorded(hand, rng)
    places = np.array(list(BALL.values()))
    tracker = HandTracker(hand, RATE, ball)
    shift = np.array([0.11, -0.02, -0.045])
    touched = set()
    for frame in markers:
        estimate = tracker.step(frame, places + shift)
        gaps = signed_gaps(estimate.sites - shift, hand.radii, ball.cloud).gap
        assert np.allclose(estimate.gap, gaps, atol=1e-9)
        touched |= set(estimate.contact_sites)
        expected = {site for site, gap in zip(SITES, gaps, strict=True) if gap < 0.004}
        assert set(estimate.contact_sites) == expected
    assert touched


def test_without_a_pose_of_the_object_there_are_no_gaps_and_no_contacts(hands, ball):
    hand = hands[Side.RIGHT]
    tracker = HandTracker(hand, RATE, ball)
    markers = hand.forward(hand.neutral()).markers
    hidden = np.array(list(BALL.values()))
    hidden[2:] = np.nan
    for object_markers in (None, hidden):
        estimate = tracker.step(markers, object_markers)
        assert estimate.tracked
        assert np.isnan(estimate.gap).all()
        assert estimate.contact_sites == ()


def test_a_jumping_object_marker_is_left_out_as_in_a_recording(hands, ball):
    hand = hands[Side.RIGHT]
    tracker = HandTracker(hand, RATE, ball)
    markers = hand.forward(hand.neutral()).markers
    places = np.array(list(BALL.values()))
    truth = tracker.step(markers, places).gap
    places[1] += (0.0, 0.05, 0.0)
    assert np.allclose(tracker.step(markers, places).gap, truth, atol=0.002)


def test_the_hand_is_unknown_until_seen_and_again_after_a_restart(hands):
    hand = hands[Side.RIGHT]
    markers = hand.forward(hand.neutral()).markers
    tracker = HandTracker(hand, RATE)
    empty = np.full_like(markers, np.nan)
    assert not tracker.step(empty).tracked
    assert np.isnan(tracker.step(empty).sites).all()
    assert tracker.step(markers).tracked
    assert tracker.step(empty).tracked
    tracker.restart()
    assert not tracker.step(empty).tracked


def test_an_estimate_stays_as_it_was_and_the_markers_are_not_written_to(hands):
    hand = hands[Side.RIGHT]
    _, markers = recorded(hand, np.random.default_rng(2))
    tracker = HandTracker(hand, RATE)
    before = markers.copy()
    first = tracker.step(markers[0])
    kept = {name: np.copy(getattr(first, name)) for name in ("q", "q_sd", "sites", "sites_sd", "used", "gap")}
    for frame in markers[1:30]:
        tracker.step(frame)
    assert np.array_equal(markers, before, equal_nan=True)
    assert all(np.array_equal(getattr(first, name), value, equal_nan=True) for name, value in kept.items())


def test_a_partly_missing_coordinate_is_a_missing_marker(hands):
    hand = hands[Side.RIGHT]
    markers = hand.forward(hand.neutral()).markers
    markers[3, 1] = np.inf
    estimate = HandTracker(hand, RATE).step(markers)
    assert estimate.tracked
    assert not estimate.used[3]
    assert estimate.used.sum() == len(markers) - 1


def test_a_loop_leaves_the_interpreter_as_it_found_it(hands):
    gc.unfreeze()
    with HandTracker(hands[Side.RIGHT], RATE) as tracker:
        assert gc.get_freeze_count() > 0
        assert tracker.marker_labels == hands[Side.RIGHT].markers
    assert gc.get_freeze_count() == 0


@pytest.mark.parametrize("rate", [0, -1, np.nan, np.inf, 1e6])
def test_a_rate_that_is_none_is_refused(hands, rate):
    with pytest.raises(ParameterError, match="rate"):
        HandTracker(hands[Side.RIGHT], rate)


def test_markers_of_another_number_are_refused(hands, ball):
    tracker = HandTracker(hands[Side.RIGHT], RATE, ball)
    with pytest.raises(ParameterError, match=r"\(24, 3\)"):
        tracker.step(np.zeros((23, 3)))
    with pytest.raises(ParameterError, match=r"object_markers.*\(4, 3\)"):
        tracker.step(hands[Side.RIGHT].forward(hands[Side.RIGHT].neutral()).markers, np.zeros((3, 3)))


def test_the_tracker_is_public():
    assert graspdb.HandTracker is HandTracker
