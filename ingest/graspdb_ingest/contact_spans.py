"""Times in which a hand holds an object, from its gaps alone."""

from dataclasses import dataclass

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import EventParameters
from graspdb_ingest.runs import Mask, frames_of, joined_runs, lasting


@dataclass(frozen=True)
class Span:
    """Frames from first to last in contact, and whether its begin and end were seen."""

    first: int
    last: int
    begun: bool
    released: bool


def _touching(gap: Floats, threshold: float, margin: float, reach: int) -> Mask:
    """Return which spheres are in contact, with hysteresis, shape (n, 20).

    A sphere keeps its state while its gap is between the two thresholds, or unknown for no more
    than `reach` frames.
    """
    lost = lasting(np.isnan(gap), reach + 1)
    on = gap < threshold
    decided = on | (gap > threshold + margin) | lost
    frames = np.arange(len(gap))[:, None]
    latest = np.maximum.accumulate(np.where(decided, frames, -1), axis=0)
    state = np.take_along_axis(on, np.maximum(latest, 0), axis=0)
    return np.asarray(state & (latest >= 0))


def contact_spans(gap: Floats, threshold: float, rate: float, parameters: EventParameters) -> list[Span]:
    """Return where the hand holds the object.

    A hold reaches outwards over the contact of single spheres; one that lasts from one hold to
    the next belongs to neither.
    """
    reach = frames_of(parameters.minimum_gap, rate)
    unknown = frames_of(parameters.maximum_unknown, rate)
    touching = _touching(gap, threshold, parameters.release_margin, unknown)
    cores = [
        core
        for core in joined_runs(touching.sum(axis=1) >= parameters.minimum_sites, reach)
        if core[1] - core[0] >= frames_of(parameters.minimum_hold, rate)
    ]
    below = np.asarray((gap < threshold).any(axis=1))
    known = np.asarray(np.isfinite(gap).any(axis=1))
    spans = []
    for start, stop in joined_runs(np.asarray(touching.any(axis=1)), reach):
        inside = [core for core in cores if start <= core[0] and core[1] <= stop]
        for i, core in enumerate(inside):
            outer_start = start if i == 0 else core[0]
            outer_stop = stop if i == len(inside) - 1 else core[1]
            contact = outer_start + np.flatnonzero(below[outer_start:outer_stop])
            first, last = int(contact[0]), int(contact[-1])
            begun = bool(known[max(0, first - reach) : first].any())
            released = bool(known[last + 1 : last + 1 + reach].any())
            spans.append(Span(first, last, begun, released))
    return spans
