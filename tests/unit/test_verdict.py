"""A track that is not to be believed is refused with its reasons."""

from dataclasses import replace

import numpy as np
import pytest

from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.tracker import track_hand
from graspdb_ingest.verdict import check_track
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.vocabulary import Side

RATE = 120.0
PARAMETERS = TrackingParameters(marker_sd=0.001)


@pytest.fixture(scope="module")
def still(hands):
    """Return a right hand, its markers at rest with noise, and its track."""
    hand = hands[Side.RIGHT]
    q = hand.neutral()
    q[7:] = default_prior(hand).mean
    markers = hand.forward(q).markers + np.random.default_rng(1).normal(0, 0.001, (40, 24, 3))
    return hand, markers, track_hand(hand, markers, RATE, default_prior(hand), PARAMETERS)


def check(hand, markers, track, side=Side.RIGHT, parameters=PARAMETERS):
    check_track(track, hand, markers, default_prior(hand), side, parameters)


def test_good_track_passes(still):
    check(*still)


def test_hand_that_is_seldom_known_is_refused(still):
    hand, markers, track = still
    q = track.q.copy()
    q[:30] = np.nan
    with pytest.raises(TrackingError, match="is known in 25% of the frames, less than 50%"):
        check(hand, markers, replace(track, q=q))


def test_hand_that_is_badly_known_is_refused(still):
    hand, markers, track = still
    with pytest.raises(TrackingError, match="known to no better than 20 mm in 100% of these frames"):
        check(hand, markers, replace(track, sites_sd=np.full((40, 20), 0.03)))


def test_hand_whose_markers_are_left_out_is_refused(still):
    hand, markers, track = still
    used = track.used.copy()
    used[:, :12] = False
    with pytest.raises(TrackingError, match="do without 50% of its seen markers"):
        check(hand, markers, replace(track, used=used))


def test_other_hand_is_refused(hands, still):
    _, markers, _ = still
    left = hands[Side.LEFT]
    track = track_hand(left, markers, RATE, default_prior(left), TrackingParameters(gate=1 - 1e-12))
    with pytest.raises(TrackingError, match=r"it is the other hand|do without"):
        check(left, markers, track, Side.LEFT)
