"""Contact over time: when each site touches and lets go, and where that cannot be said.

A site is in contact, is not, or is unknown. Unknown is where hand or object are not known, and where the
hand is known so badly that the gap decides nothing: a digit out of sight drifts away from the object in
the tracker's estimate, and that is no release.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import EventParameters

States = NDArray[np.int8]

TOUCHES: Final = 1
FREE: Final = 0
UNKNOWN: Final = -1

SURE: Final = 2.0
"""Standard deviations by which a badly known gap must be too wide for the site to be free."""

Bound = Literal["free", "unknown", "trial"]


@dataclass(frozen=True)
class ContactEvent:
    """One contact of one site with the object, in frames of the trial.

    Attributes
    ----------
    site : int
        Place in `SITES`.
    first, last : int
        First and last frame in which the site touches.
    before, after : {'free', 'unknown', 'trial'}
        Whether the site is free before, and after; or it is unknown there; or the trial begins or ends
        there. Only from and to a free site are onset and release seen.
    """

    site: int
    first: int
    last: int
    before: Bound
    after: Bound


def contact_states(gap: Floats, gap_sd: Floats | None, threshold: float, margin: float) -> States:
    """Return in which frames each site touches, is free, or is unknown, shape (n, 20).

    A site touches from where its gap falls below h until it exceeds h by the margin.

    Parameters
    ----------
    gap : ndarray, shape (n, 20)
        Signed gaps [m], NaN where hand or object is not known.
    gap_sd : ndarray, shape (n, 20), or None
        Standard deviations of the gaps [m]; None where they are not known. A gap with one above h is
        too uncertain for h to decide; it is unknown unless it is too wide for contact by `SURE` of them.
    threshold : float
        h of equation 3 [m].
    margin : float
        How far above h the gap ends a contact [m].
    """
    unknown = np.isnan(gap)
    if gap_sd is not None:
        vague = ~(gap_sd <= threshold)
        with np.errstate(invalid="ignore"):
            unknown |= vague & ~(gap - SURE * gap_sd > threshold + margin)
    with np.errstate(invalid="ignore"):
        on, off = gap < threshold, gap > threshold + margin
    decided = on | off | unknown
    frames = np.arange(len(gap))[:, None]
    latest = np.maximum.accumulate(np.where(decided, frames, -1), axis=0)
    state = np.where(unknown, UNKNOWN, np.where(on, TOUCHES, FREE)).astype(np.int8)
    kept = np.take_along_axis(state, np.maximum(latest, 0), axis=0)
    # Between the two thresholds after a stretch that was unknown, or at the begin: below h it would touch.
    return np.where(decided, state, np.where((latest >= 0) & (kept == TOUCHES), TOUCHES, FREE)).astype(
        np.int8
    )


def contact_events(states: States, rate: float, parameters: EventParameters) -> tuple[ContactEvent, ...]:
    """Return the contacts of every site, in order of time.

    Contacts and breaks shorter than `minimum_contact` are noise, and left out. A contact outlasts an
    unknown stretch of up to `maximum_unknown` if the site touches after it.

    Parameters
    ----------
    states : ndarray, shape (n, 20)
        As `contact_states` returns them.
    rate : float
        Frames per second [Hz].
    parameters : EventParameters
        Durations.
    """
    shortest = max(1, round(parameters.minimum_contact * rate))
    longest = max(1, round(parameters.maximum_unknown * rate))
    events = [
        event
        for site in range(states.shape[1])
        for event in _events_of(states[:, site], site, shortest, longest)
    ]
    return tuple(sorted(events, key=lambda event: (event.first, event.site)))


def ranks(events: tuple[ContactEvent, ...]) -> list[int | None]:
    """Return the place of each event in the order of onsets, 1 for who touches first.

    Events of the same frame share a place; those whose onset was not seen have none, nor has any event
    after one of those, for it cannot be said how many touched before.
    """
    unseen = [event.first for event in events if event.before != "free"]
    onsets = [event.first for event in events]
    earliest = min(unseen, default=None)
    return [
        None
        if event.before != "free" or (earliest is not None and earliest <= event.first)
        else 1 + sum(other < event.first for other in onsets)
        for event in events
    ]


def _events_of(states: States, site: int, shortest: int, longest: int) -> list[ContactEvent]:
    """Return the contacts of one site."""
    runs = [run for run in _runs(states) if run.state != FREE or run.stop - run.start >= shortest]
    spans: list[tuple[int, int]] = []
    for number, run in enumerate(runs):
        if run.state != TOUCHES:
            continue
        between = {other.state for other in runs[spans[-1][1] + 1 : number]} if spans else {FREE}
        if FREE not in between and run.start - runs[spans[-1][1]].stop <= longest:
            spans[-1] = (spans[-1][0], number)
        else:
            spans.append((number, number))
    events = [
        ContactEvent(
            site, runs[i].start, runs[j].stop - 1, _bound(runs[i - 1 : i]), _bound(runs[j + 1 : j + 2])
        )
        for i, j in spans
    ]
    return [e for e in events if np.count_nonzero(states[e.first : e.last + 1] == TOUCHES) >= shortest]


@dataclass(frozen=True)
class _Run:
    """Frames from `start` to before `stop` in the same state."""

    start: int
    stop: int
    state: int


def _bound(neighbour: list[_Run]) -> Bound:
    """Return what is known of a site beside a contact, from the run there, if there is one."""
    if not neighbour:
        return "trial"
    return "unknown" if neighbour[0].state == UNKNOWN else "free"


def _runs(states: States) -> list[_Run]:
    """Return the runs of equal states."""
    edges = [0, *(np.flatnonzero(np.diff(states)) + 1).tolist(), len(states)]
    return [_Run(start, stop, int(states[start])) for start, stop in pairwise(edges) if stop > start]
