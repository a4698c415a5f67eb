"""Contact over whole sequences of two hands with a mug, a cup and a wine glass."""

from pathlib import Path

import numpy as np
import pytest
from manipnet import Sequence, load_sequence, rises

from graspdb_ingest.contact_events import TOUCHES, contact_events, contact_states
from graspdb_ingest.events import find_holds
from graspdb_ingest.parameters import ContactParameters, EventParameters
from graspdb_ingest.rigid import transform_points
from graspdb_ingest.surface import HandPoints, hand_surface
from graspdb_ingest.surface.touch import pose_hand

EVENTS, H = EventParameters(), ContactParameters().threshold
UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module", params=["mug1", "cup1", "wineglass3"])
def sequence(request: pytest.FixtureRequest, shared_data: Path) -> Sequence:
    return load_sequence(shared_data / "manipnet" / request.param)


def test_contacts_and_lifts(sequence: Sequence) -> None:
    n = len(sequence.object_positions)
    times = np.arange(n) / sequence.rate
    lifts, n_seen = [], 0
    middle = sequence.target.cloud.points.mean(axis=0)
    positions = transform_points(
        sequence.object_rotations, sequence.object_positions, np.tile(middle, (n, 1, 1))
    )[:, 0]
    for hand in sequence.hands.values():
        gap = pose_hand(hand, "spheres", sequence.target).gaps.gap
        states = contact_states(gap, None, H, EVENTS.release_margin)
        for event in contact_events(states, sequence.rate, EVENTS):
            own = gap[event.first : event.last + 1, event.site]
            assert own[0] < H
            assert own.max() < 0.02, "contact is reported where the hand is 20 mm away"
            n_seen += event.before == event.after == "free"
        assert (states[gap >= 0.02] != TOUCHES).all()
        in_lab = transform_points(sequence.object_rotations, sequence.object_positions, hand.sites)
        holds = find_holds(times, gap, positions, in_lab, UP, H, EVENTS)
        assert holds
        lifts += [(times[hold.lift_onset], times[hold.last]) for hold in holds if hold.lift_onset is not None]
    assert n_seen > 50
    found = rises(sequence)
    assert min(abs(lift - found[0]) for lift, _ in lifts) < 0.35
    # A hold has one lift, its first; the object may be put down and raised again in the same hold.
    for rise in found:
        assert any(lift - 0.35 < rise < end for lift, end in lifts), f"nobody lifts at {rise:.2f} s"


def test_no_touching_site_is_far_from_any_surface_of_the_hand(sequence: Sequence) -> None:
    """The skin lies outside the spheres, so where a sphere touches the skin is nearer still."""
    for hand in sequence.hands.values():
        some = HandPoints(hand.key_points[::400], hand.radii, hand.side)
        spheres = pose_hand(some, "spheres", sequence.target).gaps.gap
        skin = pose_hand(some, "skin", sequence.target).gaps.gap
        assert (skin <= spheres + 1e-6).all()
        built = hand_surface(some, "skin")
        for frame in np.flatnonzero((spheres < H).any(axis=1))[:3]:
            gaps = built.frame(frame).distances(sequence.target.cloud.points).distance
            assert gaps.min() < 0.01
