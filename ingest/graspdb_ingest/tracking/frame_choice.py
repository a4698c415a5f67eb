"""Which frames of a subject's recordings a hand is calibrated from."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.tracking.fit import visible
from graspdb_schemas.errors import TrackingError

SAMPLE: Final = 3000
"""Frames of all recordings together that are held in memory at the most."""
N_FRAMES: Final = 60
"""Frames that a calibration uses."""
MINIMUM_FRAMES: Final = 8
MINIMUM_MARKERS: Final = 6


def sample_frames(recordings: Iterable[Floats], limit: int = SAMPLE) -> Floats:
    """Sample frames evenly from recordings that are read one after the other.

    Every frame is kept until there are too many, then every second, every fourth and so on, so one
    recording and the sample are all that is ever in memory.

    Parameters
    ----------
    recordings : iterable of ndarray, each of shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    limit : int
        How many frames to keep at the most.

    Returns
    -------
    ndarray, shape (at most limit, n_markers, 3)
        The sample, recordings in their order; frames that show no marker are left out.
    """
    kept: list[Floats] = []
    stride = 1
    for recording in recordings:
        kept.append(np.asarray(recording[visible(recording).any(axis=1)][::stride].copy()))
        while sum(map(len, kept)) > limit:
            stride *= 2
            kept = [part[::2].copy() for part in kept]
    return np.concatenate(kept) if kept else np.empty((0, 0, 3))


def choose_frames(markers: Floats, n_frames: int = N_FRAMES) -> Floats:
    """Choose well-seen frames that span the movement.

    Half of them are spread evenly over the recordings. The others are found by farthest-point
    sampling on the distances between markers, which tell postures apart wherever the hand is. That
    finds the ends of the movement, but wrong labels too, so it must not have all the say.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    n_frames : int
        How many to choose at the most.

    Returns
    -------
    ndarray, shape (at most n_frames, n_markers, 3)
        The chosen frames.

    Raises
    ------
    TrackingError
        If fewer than eight frames show six markers or more.
    """
    counts = visible(markers).sum(axis=1)
    enough = max(MINIMUM_MARKERS, int(np.quantile(counts, 0.5)) - 2) if len(counts) else MINIMUM_MARKERS
    usable = np.flatnonzero(counts >= enough)
    if len(usable) < MINIMUM_FRAMES:
        raise TrackingError(
            f"only {len(usable)} frames show {enough} or more of the hand's {markers.shape[1]} markers; "
            f"calibration needs {MINIMUM_FRAMES}",
            "Give the subject a calibration recording in which the whole hand is seen.",
        )
    return np.asarray(markers[usable[np.sort(_farthest(marker_distances(markers[usable]), n_frames))]])


def marker_distances(markers: Floats) -> Floats:
    """Return the distances between all pairs of markers [m], NaN where not known, (n_frames, n_pairs)."""
    first, second = np.triu_indices(markers.shape[1], k=1)
    return np.asarray(np.linalg.norm(markers[:, first] - markers[:, second], axis=2))


def _farthest(signatures: Floats, n_frames: int) -> list[int]:
    """Return frames spread evenly, then such as are far from all earlier ones over the pairs both show."""
    known = np.isfinite(signatures)
    signatures = np.where(known, signatures, 0.0)
    n_frames = min(n_frames, len(signatures))
    chosen = [int(i) for i in np.linspace(0, len(signatures) - 1, (n_frames + 1) // 2)]
    nearest = np.full(len(signatures), np.inf)
    for i in range(n_frames):
        both = known & known[chosen[i]]
        squared = np.sum(both * (signatures - signatures[chosen[i]]) ** 2, axis=1)
        nearest = np.minimum(nearest, squared / np.maximum(both.sum(axis=1), 1))
        nearest[chosen] = -1
        if len(chosen) == i + 1 < n_frames:
            chosen.append(int(np.argmax(nearest)))
    return chosen
