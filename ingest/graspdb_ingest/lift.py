"""When a held object begins to rise from rest, and when it is put down."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from scipy.signal import butter, sosfiltfilt

from graspdb_ingest.contact_spans import Span
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import EventParameters
from graspdb_ingest.runs import Mask, frames_of, joined_runs, runs

FILTER_ORDER: Final = 2


@dataclass(frozen=True)
class Rise:
    """The object's smoothed height [m], and by frame: at rest, four times as fast, raw data known."""

    height: Floats
    slow: Mask
    quick: Mask
    known: Mask


@cache
def _low_pass(rate: float, cut_off: float) -> Floats | None:
    """Return the filter's sections, or None where the recording has nothing above the cut-off."""
    if cut_off >= rate / 2:
        return None
    return np.asarray(butter(FILTER_ORDER, cut_off, fs=rate, output="sos"))


def smooth_path(values: Floats, rate: float, parameters: EventParameters) -> Floats:
    """Return paths, shape (n, k), through a zero-phase low-pass filter.

    Missing stretches no longer than `minimum_gap` are bridged by straight lines, so that the
    filter runs on; longer ones stay NaN and part the path in pieces.
    """
    smooth = np.full(values.shape, np.nan)
    known = np.asarray(np.isfinite(values).all(axis=1))
    sections = _low_pass(rate, parameters.smoothing)
    for start, stop in joined_runs(known, frames_of(parameters.minimum_gap, rate)):
        frames = np.arange(start, stop)
        seen = frames[known[start:stop]]
        piece = np.column_stack([np.interp(frames, seen, column) for column in values[seen].T])
        if sections is not None:
            padding = min(len(piece) - 1, frames_of(1 / parameters.smoothing, rate))
            piece = sosfiltfilt(sections, piece, axis=0, padlen=padding)
        smooth[start:stop] = piece
    return smooth


def object_rise(gap: Floats, height: Floats, rate: float, parameters: EventParameters) -> Rise:
    """Return the object's height and its rest; where the height is unknown there is no rest."""
    smooth = smooth_path(height[:, None], rate, parameters)[:, 0]
    speed = np.abs(np.gradient(smooth, 1 / rate))
    return Rise(
        height=smooth,
        slow=speed < parameters.rest_speed,
        quick=speed > 4 * parameters.rest_speed,
        known=np.asarray(np.isfinite(gap).any(axis=1)),
    )


def lift_onset(span: Span, rise: Rise, rate: float, parameters: EventParameters) -> int | None:
    """Return the frame in which the object first begins to rise from rest within the hold.

    An onset a little before the first contact is moved there, for contact is found with the
    error of tracking; an object that rose earlier than that was lifted by something else. Where
    the hold's begin was not seen, the object may hang in the air already: then only a rest near
    the lowest height of the recording counts.
    """
    reach = frames_of(parameters.minimum_gap, rate)
    shortest = frames_of(parameters.minimum_rest, rate)
    begin, end = max(0, span.first - reach), span.last + 1
    highest = np.inf if span.begun else np.fmin.reduce(rise.height) + parameters.lift_height
    rests = [
        (max(start, begin), min(stop, end))
        for start, stop in runs(rise.slow)
        if stop - start >= shortest and stop > begin and start < end
    ]
    for i, (start, stop) in enumerate(rests):
        base = float(np.median(rise.height[start:stop]))
        until = rests[i + 1][1] if i + 1 < len(rests) else end
        above = runs(rise.height[stop:until] > base + parameters.lift_height)
        raised = [run[0] for run in above if run[1] - run[0] >= shortest]
        if base > highest or not raised:
            continue
        before = slice(start, stop + raised[0])
        low = rise.height[before] < base + parameters.lift_height / 2
        still = start + int(np.flatnonzero(rise.slow[before] & low)[-1])
        onset = max(span.first, _before_threshold(still, start, until, rise, reach))
        return span.first + int(np.flatnonzero(rise.known[span.first : onset + 1])[-1])
    return None


def _before_threshold(onset: int, start: int, until: int, rise: Rise, longest: int) -> int:
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


def put_down(span: Span, onset: int, rise: Rise, rate: float, parameters: EventParameters) -> int | None:
    """Return the first frame at rest after the last time the object was away from its final height.

    An object that is not released has been put down only if it is back at the height it came from.
    """
    # The hand may let go just before the object lies still, so look a little further.
    end = span.last + 1 + frames_of(parameters.minimum_gap, rate)
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
