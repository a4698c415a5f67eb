"""Faulty markers of each kind are found where they are, and a clean recording has none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.faults import Fault, describe, find_frozen, without
from graspdb_ingest.tracking.tracker import track_hand
from graspdb_schemas.vocabulary import Side

RATE, N_FRAMES, NOISE = 120.0, 300, 0.001
FIRST, LAST = 120, 168


@pytest.fixture(scope="module")
def hand(hands):
    return hands[Side.RIGHT]


@pytest.fixture(scope="module")
def moving(hand):
    """Return the true sites and the noisy markers of a hand that turns, travels, opens and closes."""
    time, prior = np.arange(N_FRAMES) / RATE, default_prior(hand)
    q = np.empty((N_FRAMES, hand.n_q))
    q[:, :3] = 0.15 * np.sin(2 * np.pi * 0.4 * time)[:, None] * (1, 0.5, 0.2)
    q[:, 3:7] = Rotation.from_rotvec(np.outer(np.sin(time), (0.4, 0.2, 0.1))).as_quat(scalar_first=True)
    bend = 0.6 * np.sin(2 * np.pi * 0.5 * time)[:, None] * np.sqrt(np.diagonal(prior.covariance))
    q[:, 7:] = np.clip(prior.mean + bend, *hand.joint_range.T)
    pose = hand.forward(q)
    noise = np.random.default_rng(7).normal(0, NOISE, pose.markers.shape)
    return pose.sites, pose.markers + noise


def follow(hand, markers):
    return track_hand(hand, markers, RATE, default_prior(hand), TrackingParameters(marker_sd=NOISE))


def test_clean_recording_has_no_faults(hand, moving):
    track = follow(hand, moving[1])
    assert track.faults == ()
    assert track.used.mean() > 0.999


def test_exchanged_labels_are_put_right(hand, moving):
    sites, markers = moving[0], moving[1].copy()
    pair = [hand.markers.index("index_pip"), hand.markers.index("middle_pip")]
    markers[FIRST:LAST, pair] = markers[FIRST:LAST, pair[::-1]]
    track = follow(hand, markers)
    assert track.faults == (Fault("swapped", tuple(sorted(pair)), FIRST, LAST),)
    assert track.used[FIRST:LAST, pair].mean() > 0.99
    assert np.linalg.norm(track.sites - sites, axis=2).max() < 0.004


@pytest.mark.parametrize("label", ["ring_dip", "middle_mcp", "forearm_1"])
def test_jumping_marker_is_left_out(hand, moving, label):
    sites, markers = moving[0], moving[1].copy()
    marker = hand.markers.index(label)
    markers[FIRST:LAST, marker] += (0.02, 0.02, 0.02)
    track = follow(hand, markers)
    assert track.faults == (Fault("jumping", (marker,), FIRST, LAST),)
    assert np.linalg.norm(track.sites - sites, axis=2).max() < 0.006


def test_frozen_marker_is_left_out(hand, moving):
    sites, markers = moving[0], moving[1].copy()
    marker = hand.markers.index("little_pip")
    markers[FIRST:LAST, marker] = markers[FIRST, marker]
    track = follow(hand, markers)
    assert Fault("frozen", (marker,), FIRST + 1, LAST) in track.faults
    assert not track.used[FIRST + 1 : LAST, marker].any()
    assert np.linalg.norm(track.sites - sites, axis=2).max() < 0.006


def test_drifting_marker_is_left_out(hand, moving):
    markers, marker = moving[1].copy(), hand.markers.index("index_mcp")
    markers[60:240, marker] += np.linspace(0, 0.04, 180)[:, None] * (0.0, 0.6, 0.8)
    found = [fault for fault in follow(hand, markers).faults if fault.markers == (marker,)]
    assert {fault.kind for fault in found} <= {"drifting", "jumping"}
    assert sum(fault.stop - fault.start for fault in found) > 90


def test_outlier_in_the_first_frame_does_not_mislead(hand, moving):
    sites, markers = moving[0], moving[1].copy()
    marker = hand.markers.index("thumb_ip")
    markers[0, marker] += (0.05, 0.05, 0.0)
    track = follow(hand, markers)
    assert not track.used[0, marker]
    assert np.linalg.norm(track.sites - sites, axis=2).max() < 0.006


def test_hand_at_rest_with_no_noise_is_not_frozen():
    assert list(find_frozen(np.ones((100, 24, 3)), RATE)) == []


@pytest.mark.parametrize("shape", [(0, 4, 3), (1, 4, 3), (2, 4, 3)])
def test_shortest_recordings_have_no_frozen_markers(shape):
    assert list(find_frozen(np.zeros(shape), RATE)) == []


def test_one_frame_is_tracked(hand, moving):
    track = follow(hand, moving[1][:1])
    assert track.tracked.all()
    assert np.isfinite(track.sites_sd).all()


def test_taking_out_and_putting_right(moving):
    markers = moving[1]
    kept = without(markers, [Fault("swapped", (0, 1), 3, 5), Fault("frozen", (2,), 4, 6)])
    assert np.array_equal(kept[3:5, 0], markers[3:5, 1])
    assert np.isnan(kept[4:6, 2]).all()
    assert np.isnan(kept).sum() == 6


def test_faults_are_described_by_marker_and_time():
    faults = [Fault("jumping", (1,), 12, 24), Fault("jumping", (1,), 60, 72), Fault("swapped", (0, 1), 6, 12)]
    assert describe(faults, ("a", "b"), 120.0, 1.0) == [
        "b jumping 2 times, 0.20 s in all, first at 1.10 s: left out",
        "a and b swapped once, 0.05 s in all, first at 1.05 s: put right",
    ]
