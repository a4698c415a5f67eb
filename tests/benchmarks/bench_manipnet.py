"""Contact over whole sequences of two hands: onsets and releases, lifts, and no contact from afar."""

import os
import sys
from pathlib import Path

import numpy as np
from harness import Result, benchmark

sys.path.append(str(Path(__file__).parents[1]))
from manipnet import Sequence, load_sequence, rises

from graspdb_ingest.contact_events import TOUCHES, contact_events, contact_states
from graspdb_ingest.events import find_holds
from graspdb_ingest.parameters import ContactParameters, EventParameters
from graspdb_ingest.rigid import transform_points
from graspdb_ingest.surface.touch import pose_hand

DATA = Path(os.environ.get("GRASPDB_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))
NAMES = ("mug1", "cup1", "wineglass3")
UP = np.array([0.0, 1.0, 0.0])


@benchmark("two hands over time")
def two_hands() -> list[Result]:
    """Find contacts and lifts in three sequences, and compare them with the object's height alone."""
    folder = DATA / "manipnet"
    if not folder.is_dir():
        return []
    found = [_sequence(load_sequence(folder / name)) for name in NAMES]
    events, whole, far, held, n_rises = (sum(values) for values in list(zip(*found, strict=True))[:5])
    late = max(values[5] for values in found)
    note = (
        f"{len(NAMES)} sequences of 33 s; {whole} of {events} contacts of single sites have onset and release"
    )
    return [
        Result("contacts where the hand's surface is 20 mm away", far, None, "", note="bar 0; " + note),
        Result(
            "rises of the object in a hold with a lift", held, n_rises, "", "more", "peer, and bar: all rises"
        ),
        Result("first lift against the first rise", late, None, "s", note="bar 0.35 s; the worst sequence"),
    ]


def _sequence(sequence: Sequence) -> tuple[int, int, int, int, int, float]:
    """Return contacts, those seen whole, those from afar, rises held and all, and the first lift's error."""
    timing, h = EventParameters(), ContactParameters().threshold
    n = len(sequence.object_positions)
    times = np.arange(n) / sequence.rate
    centre = sequence.target.cloud.points.mean(axis=0)
    middle = np.asarray(np.tile(centre, (n, 1, 1)), dtype=np.float64)
    positions = transform_points(sequence.object_rotations, sequence.object_positions, middle)[:, 0]
    lifts: list[tuple[float, float]] = []
    events, whole, far = 0, 0, 0
    for hand in sequence.hands.values():
        gap = pose_hand(hand, "spheres", sequence.target).gaps.gap
        states = contact_states(gap, None, h, timing.release_margin)
        own = contact_events(states, sequence.rate, timing)
        events += len(own)
        whole += sum(event.before == event.after == "free" for event in own)
        far += int((states[gap >= 0.02] == TOUCHES).sum())
        sites = np.asarray(hand.sites, dtype=np.float64)
        in_lab = transform_points(sequence.object_rotations, sequence.object_positions, sites)
        holds = find_holds(times, gap, positions, in_lab, UP, h, timing)
        lifts += [
            (float(times[x.lift_onset]), float(times[x.last])) for x in holds if x.lift_onset is not None
        ]
    up = rises(sequence)
    held = sum(any(lift - 0.35 < rise < end for lift, end in lifts) for rise in up)
    return events, whole, far, held, len(up), min(abs(lift - up[0]) for lift, _ in lifts)
