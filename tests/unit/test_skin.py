"""A hidden marker is where the hand carries it, at the place on the skin where it was before and after."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.tracking.skin import SKIN_TIME, bridge, hidden_marker
from graspdb_schemas.vocabulary import Side

RATE = 100.0
TIMES = np.arange(100) / RATE
GAP = slice(30, 70)
KNOWN = np.ones(100, dtype=bool)
KNOWN[GAP] = False


def test_an_offset_that_never_changes_is_carried_through_the_gap():
    offset = np.tile([0.002, -0.001, 0.0005], (100, 1))
    carried = bridge(TIMES, np.where(KNOWN[:, None], offset, np.nan), KNOWN)
    assert carried == pytest.approx(offset, rel=0.15)


def test_an_offset_is_forgotten_far_from_where_it_was_known():
    times = np.array([0.0, 10 * SKIN_TIME])
    carried = bridge(times, np.array([[0.002, 0, 0], [np.nan] * 3]), np.array([True, False]))
    assert abs(carried[1]).max() < 1e-6


def test_an_offset_that_nothing_is_known_of_is_none():
    assert np.array_equal(
        bridge(TIMES, np.full((100, 3), np.nan), np.zeros(100, dtype=bool)), np.zeros((100, 3))
    )


def test_bridging_is_the_mean_of_a_process_of_that_correlation_given_its_ends():
    rng = np.random.default_rng(0)
    lag = np.abs(np.subtract.outer(TIMES, TIMES)) / SKIN_TIME
    draws = np.linalg.cholesky(np.exp(-lag) + 1e-12 * np.eye(100)) @ rng.normal(size=(100, 3 * 400))
    draws = draws.reshape(100, 400, 3)
    errors = {"bridged": 0.0, "ignored": 0.0, "before": 0.0}
    for k in range(400):
        truth = draws[:, k]
        carried = bridge(TIMES, np.where(KNOWN[:, None], truth, np.nan), KNOWN)
        errors["bridged"] += np.sum((carried - truth)[GAP] ** 2)
        errors["ignored"] += np.sum(truth[GAP] ** 2)
        errors["before"] += np.sum((truth[GAP.start - 1] - truth[GAP]) ** 2)
    assert errors["bridged"] < 0.75 * errors["before"]
    assert errors["bridged"] < 0.3 * errors["ignored"]


@pytest.mark.parametrize("side", [Side.RIGHT, Side.LEFT])
def test_a_marker_that_sits_askew_is_predicted_askew_however_the_hand_turns(hands, side):
    hand = hands[side]
    q = np.tile(hand.neutral(), (100, 1))
    q[:, :3] = np.linspace(0, 0.3, 100)[:, None]
    q[:, 3:7] = Rotation.from_rotvec(np.linspace(0, 2, 100)[:, None] * [0, 0.6, 0.8]).as_quat(
        scalar_first=True
    )
    turns = Rotation.from_quat(q[:, 3:7], scalar_first=True)
    marker = hand.markers.index("forearm_1")
    truth = hand.forward(q).markers
    truth[:, marker] += turns.apply([0.003, 0.001, -0.002])
    shown = truth.copy()
    shown[GAP, marker] = np.nan
    predicted = hidden_marker(hand, q, shown, marker, GAP, RATE)
    plain = np.linalg.norm(hand.forward(q[GAP]).markers[:, marker] - truth[GAP, marker], axis=1)
    assert predicted.shape == (40, 3)
    assert np.linalg.norm(predicted - truth[GAP, marker], axis=1).max() < 0.2 * plain.min()


def test_frames_without_the_hand_have_no_prediction(hands):
    hand = hands[Side.RIGHT]
    q = np.tile(hand.neutral(), (100, 1))
    q[40:50] = np.nan
    shown = hand.forward(np.tile(hand.neutral(), (100, 1))).markers
    predicted = hidden_marker(hand, q, shown, 3, GAP, RATE)
    assert np.isnan(predicted[10:20]).all()
    assert np.isfinite(np.delete(predicted, range(10, 20), axis=0)).all()
