"""Markers that are not where their label says: swapped, jumping, frozen and drifting ones.

What breaks off in a marker's path is suspected and kept from the first pass; the hand that this pass
finds then tells whether two labels were exchanged, whether a marker was elsewhere, or whether it was
only fast. A marker that the hand's own movement can explain is never called faulty: one that drifts
as its joint might bend cannot be told from a joint that bends.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np
from scipy.ndimage import binary_closing, uniform_filter1d

from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.tracking.fit import visible

Kind = Literal["swapped", "jumping", "frozen", "drifting"]

BREAK: Final = 0.010
"""Second difference of a marker's path at 120 Hz and above that is no movement of a hand [m]."""
BREAK_SDS: Final = 15.0
"""The same in standard deviations of a marker: noise alone goes as far once in ten million times."""
FROZEN_TIME: Final = 0.1
"""Time for which a marker must stand still to the last digit, while others move, to be frozen [s]."""
ABSENCE: Final = 2.0
"""A marker that does not come back in this time was not away: its path broke off for another reason [s]."""
JUDGED_TIME: Final = 0.15
"""Time after a break in which the hand's movement still tells where the marker should be [s]."""
ELSEWHERE: Final = 0.006
"""A marker that is no further than this from where the hand has it has not jumped [m]."""
CLEARLY: Final = 0.25
"""Two labels are exchanged if that leaves at most this share of their squared distances to the hand."""
DRIFT_TIME: Final = 0.15
"""Time over which a marker must stay away from the hand to have drifted [s]."""
BRIDGED_TIME: Final = 0.05
"""A marker that fits for no longer than this in between is away all the time [s]."""
DRIFT: Final = 0.010
DRIFT_SDS: Final = 6.0
"""Mean distance to the hand over that time, in metres and in standard deviations of a marker."""


@dataclass(frozen=True)
class Fault:
    """A stretch in which a label was not on its marker.

    Attributes
    ----------
    kind : {'swapped', 'jumping', 'frozen', 'drifting'}
        What was wrong.
    markers : tuple of int
        Places of the markers among the hand's; two where their labels were exchanged.
    start, stop : int
        Frames from `start` to `stop`, which is excluded.
    """

    kind: Kind
    markers: tuple[int, ...]
    start: int
    stop: int


def find_frozen(markers: Floats, rate: float) -> Iterator[Fault]:
    """Yield stretches in which a marker stands still to the last digit while most others do not.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    rate : float
        Frames per second [Hz].
    """
    still = (np.diff(markers, axis=0) == 0).all(axis=2)
    moving = (~still & visible(markers)[1:] & visible(markers)[:-1]).sum(axis=1)
    alone = still & (moving > visible(markers)[1:].sum(axis=1) / 2)[:, None]
    for marker in np.flatnonzero(alone.any(axis=0)):
        for start, stop in _runs(alone[:, marker]):
            if stop - start >= FROZEN_TIME * rate:
                yield Fault("frozen", (int(marker),), start + 1, stop + 1)


def find_breaks(markers: Floats, rate: float, marker_sd: float) -> list[Fault]:
    """Return stretches that begin with a break in a marker's path, as jumping or, two together, swapped.

    They are suspicions: a stretch lasts until the next break of the same marker, or until it is hidden.
    """
    threshold = max(BREAK * max(1.0, 120 / rate) ** 2, BREAK_SDS * marker_sd)
    breaks = np.zeros(markers.shape[:2], dtype=bool)
    if len(markers) > 2:
        bend = np.linalg.norm(np.diff(markers, n=2, axis=0), axis=2)
        sudden = np.linalg.norm(np.diff(markers, axis=0), axis=2)[1:] > threshold / 2
        breaks[2:] = (bend > threshold) & sudden
        breaks[2:] &= ~breaks[1:-1]  # a step bends the path twice
    seen, suspects = visible(markers), []
    for frame in np.flatnonzero(breaks.any(axis=1)).tolist():
        broken = [int(m) for m in np.flatnonzero(breaks[frame])]
        for pair in combinations(broken, 2):
            if _crosses(markers, frame, pair):
                stop = min(_until(breaks[:, m], seen[:, m], frame) for m in pair)
                suspects.append(Fault("swapped", pair, frame, stop))
                broken = [m for m in broken if m not in pair]
        jumps = [Fault("jumping", (m,), frame, _until(breaks[:, m], seen[:, m], frame)) for m in broken]
        suspects += [jump for jump in jumps if jump.stop - jump.start <= ABSENCE * rate]
    return suspects


def judge(suspects: Iterable[Fault], markers: Floats, modelled: Floats, rate: float) -> Iterator[Fault]:
    """Yield the suspicions that a hand found without these markers confirms.

    Parameters
    ----------
    suspects : iterable of Fault
        What `find_breaks` found.
    markers, modelled : ndarray, shape (n_frames, n_markers, 3)
        As recorded, and where the hand has them [m].
    rate : float
        Frames per second [Hz].
    """
    for fault in suspects:
        frames = slice(fault.start, min(fault.stop, fault.start + max(1, round(JUDGED_TIME * rate))))
        direct, crossed = _distances(markers, modelled, fault.markers, frames)
        if not np.isfinite(direct):
            continue
        if fault.kind == "swapped":
            if crossed < CLEARLY * direct:
                yield fault
            continue
        before = markers[fault.start - 1, fault.markers[0]]
        step = np.sum((markers[fault.start, fault.markers[0]] - before) ** 2)
        if direct > max(CLEARLY * step, ELSEWHERE**2):
            yield fault


def find_swaps(markers: Floats, modelled: Floats, rejected: Bools) -> Iterator[Fault]:
    """Yield stretches in which two rejected markers lie where each other should be."""
    for pair in _pairs(rejected):
        both = rejected[:, pair[0]] & rejected[:, pair[1]]
        direct = np.sum((markers[:, pair] - modelled[:, pair]) ** 2, axis=(1, 2))
        crossed = np.sum((markers[:, pair[::-1]] - modelled[:, pair]) ** 2, axis=(1, 2))
        with np.errstate(invalid="ignore"):
            better = both & (crossed < CLEARLY * direct)
        for start, stop in _runs(better):
            yield Fault("swapped", pair, start, stop)


def find_drifts(residuals: Floats, rejected: Bools, rate: float, marker_sd: Floats) -> Iterator[Fault]:
    """Yield stretches in which a marker stays where the hand's own movement cannot have brought it.

    Parameters
    ----------
    residuals : ndarray, shape (n_frames, n_markers, 3)
        Observed minus modelled positions [m], NaN where not seen.
    rejected : ndarray of bool, shape (n_frames, n_markers)
        Seen markers that did not pass the filter's gate.
    rate : float
        Frames per second [Hz].
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker [m].
    """
    width = max(1, round(DRIFT_TIME * rate))
    seen = np.isfinite(residuals[..., 0])
    share = uniform_filter1d(seen.astype(float), width, axis=0)
    mean = uniform_filter1d(np.where(seen[..., None], residuals, 0.0), width, axis=0)
    distance = np.linalg.norm(mean, axis=2) / np.maximum(share, 1 / width)
    beyond = distance > np.maximum(DRIFT, DRIFT_SDS * marker_sd)
    away = beyond & (share > 0.5)
    worst = away & (distance >= np.where(away, distance, 0.0).max(axis=1, keepdims=True))
    bridge = max(1, round(BRIDGED_TIME * rate))
    padded = np.pad(rejected, ((bridge, bridge), (0, 0)))
    stays = binary_closing(padded, np.ones((bridge, 1), dtype=bool))[bridge:-bridge] & beyond & seen
    for marker in np.flatnonzero((worst | stays).any(axis=0)):
        for start, stop in _runs(worst[:, marker] | stays[:, marker]):
            if stop - start >= width:
                yield Fault("drifting", (int(marker),), start, stop)


def without(markers: Floats, faults: Iterable[Fault]) -> Floats:
    """Return the recording with faulty markers taken out; exchanged labels are put right instead."""
    kept = markers.copy()
    for fault in faults:
        frames, columns = slice(fault.start, fault.stop), list(fault.markers)
        if fault.kind == "swapped":
            kept[frames, columns] = kept[frames, columns[::-1]]
        else:
            kept[frames, columns] = np.nan
    return kept


def describe(faults: Sequence[Fault], labels: Sequence[str], rate: float, first_time: float) -> list[str]:
    """Return a sentence for each kind of fault and marker: how often, how long, and when first."""
    groups: dict[tuple[Kind, tuple[int, ...]], list[Fault]] = {}
    for fault in faults:
        groups.setdefault((fault.kind, fault.markers), []).append(fault)
    sentences = []
    for (kind, markers), group in groups.items():
        names = " and ".join(labels[m] for m in markers)
        total = sum(f.stop - f.start for f in group) / rate
        first = first_time + group[0].start / rate
        done = "put right" if kind == "swapped" else "left out"
        times = "once" if len(group) == 1 else f"{len(group)} times"
        sentences.append(f"{names} {kind} {times}, {total:.2f} s in all, first at {first:.2f} s: {done}")
    return sentences


def _crosses(markers: Floats, frame: int, pair: tuple[int, int]) -> bool:
    """Say whether each of two markers goes on where the other one was."""
    before, after = markers[frame - 1, pair], markers[frame, pair]
    direct = np.sum((after - before) ** 2)
    return bool(np.sum((after[::-1] - before) ** 2) < CLEARLY * direct)


def _until(breaks: Bools, seen: Bools, frame: int) -> int:
    """Return the frame of a marker's next break, or of its being hidden, or the number of frames."""
    ends = np.flatnonzero(breaks[frame + 1 :] | ~seen[frame + 1 :])
    return frame + 1 + int(ends[0]) if len(ends) else len(breaks)


def _distances(
    markers: Floats, modelled: Floats, chosen: tuple[int, ...], frames: slice
) -> tuple[float, float]:
    """Return the mean squared distance of markers to their own places, and to each other's [m2]."""
    observed, expected = markers[frames][:, chosen], modelled[frames][:, chosen]
    usable = np.isfinite(observed).all(axis=(1, 2)) & np.isfinite(expected).all(axis=(1, 2))
    if not usable.any():
        return np.nan, np.nan
    observed, expected = observed[usable], expected[usable]
    direct = np.sum((observed - expected) ** 2) / len(observed)
    return float(direct), float(np.sum((observed[:, ::-1] - expected) ** 2) / len(observed))


def _pairs(rejected: Bools) -> list[tuple[int, int]]:
    """Return the pairs of markers that are rejected at the same time somewhere."""
    together = rejected.T.astype(np.int64) @ rejected.astype(np.int64)
    first, second = np.nonzero(np.triu(together, k=1))
    return list(zip(first.tolist(), second.tolist(), strict=True))


def _runs(mask: Bools) -> list[tuple[int, int]]:
    """Return start and stop of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
