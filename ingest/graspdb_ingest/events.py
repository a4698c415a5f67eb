"""Holds, lifts and snapshot frames of a trial: when a hand grasps an object.

The paper takes contacts, enclosing space and feature at the onset of lift, found from the object's
velocity (section III.B). A trial may have several holds, or one in which nothing is lifted.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from graspdb_ingest.contact_spans import Span, contact_spans
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.lift import Rise, lift_onset, object_rise, put_down, smooth_path
from graspdb_ingest.parameters import EventParameters
from graspdb_ingest.runs import Mask

SnapshotKind = Literal["lift_onset", "steadiest", "static"]


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
    spans = contact_spans(gap, threshold, rate, parameters)
    if not spans:
        return ()
    rise = object_rise(gap, positions @ up, rate, parameters)
    speeds = _relative_speed(sites - positions[:, None, :], rate, parameters)
    return tuple(_hold(span, rise, gap < threshold, speeds, rate, parameters) for span in spans)


def _hold(
    span: Span, rise: Rise, below: Mask, speeds: Floats, rate: float, parameters: EventParameters
) -> Hold:
    """Return the hold of a span, with its lift and its snapshot."""
    onset = lift_onset(span, rise, rate, parameters)
    steadiest = _steadiest(span, below, speeds, parameters)
    return Hold(
        first=span.first,
        last=span.last,
        released=span.released,
        lift_onset=onset,
        put_down=None if onset is None else put_down(span, onset, rise, rate, parameters),
        snapshot=steadiest if onset is None else onset,
        snapshot_kind="steadiest" if onset is None else "lift_onset",
    )


def _relative_speed(relative: Floats, rate: float, parameters: EventParameters) -> Floats:
    """Return the mean speed of the sites relative to the object [m/s], shape (n,); NaN if unknown."""
    n_frames, n_sites, _ = relative.shape
    smooth = smooth_path(relative.reshape(n_frames, -1), rate, parameters)
    velocity = np.gradient(smooth, 1 / rate, axis=0).reshape(n_frames, n_sites, 3)
    speed = np.linalg.norm(velocity, axis=2).mean(axis=1)
    return np.where(np.isfinite(relative).all(axis=(1, 2)), speed, np.nan)


def _steadiest(span: Span, below: Mask, speeds: Floats, parameters: EventParameters) -> int:
    """Return the frame of least speed among those with nearly the most contacts."""
    counts = below[span.first : span.last + 1].sum(axis=1)
    enough = counts >= max(1.0, parameters.steady_contacts * counts.max())
    speed = np.where(enough, speeds[span.first : span.last + 1], np.nan)
    if np.isfinite(speed).any():
        return span.first + int(np.nanargmin(speed))
    return span.first + int(np.argmax(counts))
