"""Holds, lifts and snapshot frames of a trial: when a hand grasps an object.

The paper takes contacts, enclosing space and feature at the onset of lift, found from the object's
velocity (section III.B). A trial may have several holds, or one in which nothing is lifted.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening
from scipy.signal import butter, sosfiltfilt

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import EventParameters

SnapshotKind = Literal["lift_onset", "steadiest", "static"]
Mask = NDArray[np.bool_]

FILTER_ORDER = 2


@dataclass(frozen=True)
class Hold:
    """One hold of the object by the hand, in frames of the trial.

    Attributes
    ----------
    first, last : int
        First and last frame of the hold in which any sphere is in contact.
    released : bool
        Whether the end of contact was seen: False where the recording ends in contact, or where
        hand or object are lost from sight.
    lift_onset : int or None
        Frame in which the object begins to rise from rest in the hold's first lift; None where
        no lift from rest is seen.
    put_down : int or None
        First frame at rest after the hold's last lift, at most `minimum_gap` after `last`; None
        where the object is not put down.
    snapshot : int
        The frame that stands for the hold; hand and object are known in it.
    snapshot_kind : {'lift_onset', 'steadiest', 'static'}
        How the snapshot was chosen; static where the hand is known at one instant alone.
    """

    first: int
    last: int
    released: bool
    lift_onset: int | None
    put_down: int | None
    snapshot: int
    snapshot_kind: SnapshotKind


@dataclass(frozen=True)
class _Span:
    """Frames from first to last in contact, and whether its begin and end were seen."""

    first: int
    last: int
    begun: bool
    released: bool


@dataclass(frozen=True)
class _Rise:
    """The object's smoothed height [m], and by frame: at rest, four times as fast, raw data known."""

    height: Floats
    slow: Mask
    quick: Mask
    known: Mask


def find_holds(
    times: Floats,
    gap: Floats,
    positions: Floats,
    sites: Floats,
    up: Floats,
    threshold: float,
    parameters: EventParameters,
) -> tuple[Hold, ...]:
    """Find the holds of one object by one hand, with their lifts and snapshot frames.

    A sphere is in contact from where its gap falls below h until it exceeds h by the release
    margin. A hold is a time with at least `minimum_sites` spheres in contact, from the first to
    the last contact of any sphere around it. The snapshot is the onset of lift, or, in a hold
    without one, the frame in which the hand's mean speed relative to the object is least, among
    the frames with at least the share `steady_contacts` of the hold's largest number of touching
    sites.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Evenly spaced times [s].
    gap : ndarray, shape (n, 20)
        Signed gap of each sphere to the object [m]; NaN where hand or object are unknown.
    positions : ndarray, shape (n, 3)
        A point fixed in the object, best its centre, in the lab frame [m]; NaN where unknown.
    sites : ndarray, shape (n, 20, 3)
        Sphere centres in the lab frame [m]; NaN where unknown.
    up : ndarray, shape (3,)
        Unit vector against gravity, lab frame.
    threshold : float
        h of equation 3 [m].
    parameters : EventParameters
        Thresholds of time, height and speed.

    Returns
    -------
    tuple of Hold
        In order of time, without overlap; empty where there is none.
    """
    if len(times) < 2:
        return ()
    rate = (len(times) - 1) / float(times[-1] - times[0])
    spans = _contact_spans(gap, threshold, rate, parameters)
    if not spans:
        return ()
    rise = _rise(gap, positions @ up, rate, parameters)
    speeds = _relative_speed(sites - positions[:, None, :], rate, parameters)
    holds = []
    for span in spans:
        onset = _lift_onset(span, rise, rate, parameters)
        put_down = None if onset is None else _put_down(span, onset, rise, rate, parameters)
        steadiest = _steadiest(span, gap < threshold, speeds, parameters)
        holds.append(
            Hold(
                first=span.first,
                last=span.last,
                released=span.released,
                lift_onset=onset,
                put_down=put_down,
                snapshot=steadiest if onset is None else onset,
                snapshot_kind="steadiest" if onset is None else "lift_onset",
            )
        )
    return tuple(holds)


def _frames(seconds: float, rate: float) -> int:
    """Return a duration in whole frames, at least one."""
    return max(1, round(seconds * rate))


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """Return the runs of true values as pairs of first frame and the frame after the last."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _joined_runs(mask: Mask, reach: int) -> list[tuple[int, int]]:
    """Return the runs of true values, those at most `reach` frames apart joined into one."""
    joined: list[tuple[int, int]] = []
    for start, stop in _runs(mask):
        if joined and start - joined[-1][1] <= reach:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return joined


def _touching(gap: Floats, threshold: float, margin: float, reach: int) -> Mask:
    """Return which spheres are in contact, with hysteresis, shape (n, 20).

    A sphere keeps its state while its gap is between the two thresholds, or unknown for no more
    than `reach` frames.
    """
    lost = binary_opening(np.isnan(gap), structure=np.ones((reach + 1, 1), dtype=np.bool_))
    on = gap < threshold
    decided = on | (gap > threshold + margin) | lost
    frames = np.arange(len(gap))[:, None]
    latest = np.maximum.accumulate(np.where(decided, frames, -1), axis=0)
    state = np.take_along_axis(on, np.maximum(latest, 0), axis=0)
    return np.asarray(state & (latest >= 0))


def _contact_spans(gap: Floats, threshold: float, rate: float, parameters: EventParameters) -> list[_Span]:
    """Return where the hand holds the object.

    A hold reaches outwards over the contact of single spheres; one that lasts from one hold to
    the next belongs to neither.
    """
    reach = _frames(parameters.minimum_gap, rate)
    unknown = _frames(parameters.maximum_unknown, rate)
    touching = _touching(gap, threshold, parameters.release_margin, unknown)
    cores = [
        core
        for core in _joined_runs(touching.sum(axis=1) >= parameters.minimum_sites, reach)
        if core[1] - core[0] >= _frames(parameters.minimum_hold, rate)
    ]
    below = np.asarray((gap < threshold).any(axis=1))
    known = np.asarray(np.isfinite(gap).any(axis=1))
    spans = []
    for start, stop in _joined_runs(np.asarray(touching.any(axis=1)), reach):
        inside = [core for core in cores if start <= core[0] and core[1] <= stop]
        for i, core in enumerate(inside):
            outer_start = start if i == 0 else core[0]
            outer_stop = stop if i == len(inside) - 1 else core[1]
            contact = outer_start + np.flatnonzero(below[outer_start:outer_stop])
            first, last = int(contact[0]), int(contact[-1])
            begun = bool(known[max(0, first - reach) : first].any())
            released = bool(known[last + 1 : last + 1 + reach].any())
            spans.append(_Span(first, last, begun, released))
    return spans


def _low_pass(rate: float, cut_off: float) -> Floats | None:
    """Return the filter's sections, or None where the recording has nothing above the cut-off."""
    if cut_off >= rate / 2:
        return None
    return np.asarray(butter(FILTER_ORDER, cut_off, fs=rate, output="sos"))


def _smooth(values: Floats, rate: float, parameters: EventParameters) -> Floats:
    """Return paths, shape (n, k), through a zero-phase low-pass filter.

    Missing stretches no longer than `minimum_gap` are bridged by straight lines, so that the
    filter runs on; longer ones stay NaN and part the path in pieces.
    """
    smooth = np.full(values.shape, np.nan)
    known = np.asarray(np.isfinite(values).all(axis=1))
    sections = _low_pass(rate, parameters.smoothing)
    for start, stop in _joined_runs(known, _frames(parameters.minimum_gap, rate)):
        frames = np.arange(start, stop)
        seen = frames[known[start:stop]]
        piece = np.column_stack([np.interp(frames, seen, column) for column in values[seen].T])
        if sections is not None:
            padding = min(len(piece) - 1, _frames(1 / parameters.smoothing, rate))
            piece = sosfiltfilt(sections, piece, axis=0, padlen=padding)
        smooth[start:stop] = piece
    return smooth


def _rise(gap: Floats, height: Floats, rate: float, parameters: EventParameters) -> _Rise:
    """Return the object's height and its rest; where the height is unknown there is no rest."""
    smooth = _smooth(height[:, None], rate, parameters)[:, 0]
    speed = np.abs(np.gradient(smooth, 1 / rate))
    return _Rise(
        height=smooth,
        slow=speed < parameters.rest_speed,
        quick=speed > 4 * parameters.rest_speed,
        known=np.asarray(np.isfinite(gap).any(axis=1)),
    )


def _lift_onset(span: _Span, rise: _Rise, rate: float, parameters: EventParameters) -> int | None:
    """Return the frame in which the object first begins to rise from rest within the hold.

    An onset a little before the first contact is moved there, for contact is found with the
    error of tracking; an object that rose earlier than that was lifted by something else. Where
    the hold's begin was not seen, the object may hang in the air already: then only a rest near
    the lowest height of the recording counts.
    """
    reach = _frames(parameters.minimum_gap, rate)
    shortest = _frames(parameters.minimum_rest, rate)
    begin, end = max(0, span.first - reach), span.last + 1
    highest = np.inf if span.begun else np.fmin.reduce(rise.height) + parameters.lift_height
    rests = [
        (max(start, begin), min(stop, end))
        for start, stop in _runs(rise.slow)
        if stop - start >= shortest and stop > begin and start < end
    ]
    for i, (start, stop) in enumerate(rests):
        base = float(np.median(rise.height[start:stop]))
        until = rests[i + 1][1] if i + 1 < len(rests) else end
        above = _runs(rise.height[stop:until] > base + parameters.lift_height)
        raised = [run[0] for run in above if run[1] - run[0] >= shortest]
        if base > highest or not raised:
            continue
        before = slice(start, stop + raised[0])
        low = rise.height[before] < base + parameters.lift_height / 2
        still = start + int(np.flatnonzero(rise.slow[before] & low)[-1])
        onset = max(span.first, _before_threshold(still, start, until, rise, reach))
        return span.first + int(np.flatnonzero(rise.known[span.first : onset + 1])[-1])
    return None


def _before_threshold(onset: int, start: int, until: int, rise: _Rise, longest: int) -> int:
    """Return where the rise began that passes the rest speed after frame `onset`.

    From there to four times the rest speed takes a time d. The rise began d/3 before `onset` if
    it has constant acceleration, and d if its speed grows with the square of time, as in a
    minimum-jerk movement; the low-pass filter has moved `onset` forward already. The step back
    is d/2, no longer than `longest` frames, and not beyond the rest's start.
    """
    quick = np.flatnonzero(rise.quick[onset:until])
    if not len(quick):
        return onset
    return max(start, onset - min(int(quick[0]) // 2, longest))


def _put_down(span: _Span, onset: int, rise: _Rise, rate: float, parameters: EventParameters) -> int | None:
    """Return the first frame at rest after the last time the object was away from its final height.

    An object that is not released has been put down only if it is back at the height it came from.
    """
    # The hand may let go just before the object lies still, so look a little further.
    end = span.last + 1 + _frames(parameters.minimum_gap, rate)
    heights = rise.height[onset:end]
    final = heights[np.isfinite(heights)][-1]
    if not span.released and abs(final - heights[0]) > parameters.lift_height:
        return None
    away = np.flatnonzero(np.abs(heights - final) > parameters.lift_height)
    if not len(away):
        return None
    after = onset + int(away[-1]) + 1
    still = np.flatnonzero(rise.slow[after:end] & rise.known[after:end])
    return after + int(still[0]) if len(still) else None


def _relative_speed(relative: Floats, rate: float, parameters: EventParameters) -> Floats:
    """Return the mean speed of the sites relative to the object [m/s], shape (n,); NaN if unknown."""
    n_frames, n_sites, _ = relative.shape
    smooth = _smooth(relative.reshape(n_frames, -1), rate, parameters)
    velocity = np.gradient(smooth, 1 / rate, axis=0).reshape(n_frames, n_sites, 3)
    speed = np.linalg.norm(velocity, axis=2).mean(axis=1)
    return np.where(np.isfinite(relative).all(axis=(1, 2)), speed, np.nan)


def _steadiest(span: _Span, below: Mask, speeds: Floats, parameters: EventParameters) -> int:
    """Return the frame of least speed among those with nearly the most contacts."""
    counts = below[span.first : span.last + 1].sum(axis=1)
    enough = counts >= max(1.0, parameters.steady_contacts * counts.max())
    speed = np.where(enough, speeds[span.first : span.last + 1], np.nan)
    if np.isfinite(speed).any():
        return span.first + int(np.nanargmin(speed))
    return span.first + int(np.argmax(counts))
