"""Runs of frames in which something holds."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

Mask = NDArray[np.bool_]


def frames_of(seconds: float, rate: float) -> int:
    """Return a duration in whole frames, at least one."""
    return max(1, round(seconds * rate))


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Return the runs of true values as pairs of first frame and the frame after the last."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def joined_runs(mask: Mask, reach: int) -> list[tuple[int, int]]:
    """Return the runs of true values, those at most `reach` frames apart joined into one."""
    joined: list[tuple[int, int]] = []
    for start, stop in runs(mask):
        if joined and start - joined[-1][1] <= reach:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return joined


def lasting(mask: Mask, shortest: int) -> Mask:
    """Return the frames of runs of at least so many frames, in each column of shape (n, k)."""
    begun = minimum_filter1d(mask, shortest, axis=0, mode="constant", origin=-(shortest // 2))
    return np.asarray(maximum_filter1d(begun, shortest, axis=0, mode="constant", origin=(shortest - 1) // 2))
