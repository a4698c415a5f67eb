"""Paths over time at other times: rotations along the shortest arc, all else along straight lines."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from graspdb_ingest.rigid import continuous_signs

Floats = NDArray[np.float64]

_AT_FRAME: Final = 1e-3
"""A time as near to a frame's as this is that frame's, as a share of the way to the next frame."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Where new times lie among the frames of a recording.

    Attributes
    ----------
    before : ndarray of int, shape (n,)
        The frame at, or the last one before, each new time.
    share : ndarray, shape (n,)
        Share of the way to the next frame, 0 where the new time is the frame's.
    """

    before: NDArray[np.int64]
    share: Floats

    @property
    def nearest(self) -> NDArray[np.int64]:
        """The frame nearest to each new time."""
        return self.before + (self.share >= 0.5)

    @property
    def are_frames(self) -> bool:
        """Whether every new time is that of a frame."""
        return not self.share.any()


def sample(time: Floats, fps: int) -> Samples:
    """Return where the times of an even rate lie among frames, from the first to the last.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the frames, rising [s].
    fps : int
        The even rate [Hz].
    """
    passed = time - time[0]
    step = passed[-1] / max(len(time) - 1, 1)
    new = np.arange(int(passed[-1] * fps + _AT_FRAME * step * fps) + 1) / fps
    before = np.clip(np.searchsorted(passed, new, side="right") - 1, 0, max(len(time) - 2, 0))
    after = np.minimum(before + 1, len(time) - 1)
    width = passed[after] - passed[before]
    share = np.divide(new - passed[before], width, out=np.zeros(len(new)), where=width > 0)
    whole = share > 1 - _AT_FRAME
    share = np.where(whole | (share < _AT_FRAME), 0.0, share)
    return Samples(np.where(whole, after, before), share)


def straight(values: Floats, samples: Samples) -> Floats:
    """Return values at new times, along straight lines between frames.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        A value a frame, NaN where it is not known.
    samples : Samples
        The new times.

    Returns
    -------
    ndarray, shape (len(samples), ...)
        NaN where a frame beside the new time is not known.
    """
    if samples.are_frames:
        return values[samples.before]
    after = np.minimum(samples.before + 1, len(values) - 1)
    share = samples.share.reshape(-1, *[1] * (values.ndim - 1))
    # Where the new time is a frame's, what comes after does not matter, known or not.
    between = values[samples.before] * (1 - share) + values[after] * share
    return np.where(share == 0, values[samples.before], between)


def rotated(quaternions: Floats, samples: Samples) -> Floats:
    """Return rotations at new times, at a constant angular velocity between frames (slerp).

    The signs are such that neighbours lie on one side; the first is as it was.

    Parameters
    ----------
    quaternions : ndarray, shape (n, 4)
        Unit quaternions (w, x, y, z) of the frames, NaN where the rotation is not known.
    samples : Samples
        The new times.

    Returns
    -------
    ndarray, shape (len(samples), 4)
        NaN where a frame beside the new time is not known.
    """
    path = continuous_signs(quaternions)
    if samples.are_frames:
        return path[samples.before]
    line = straight(path, samples)
    known = np.isfinite(line).all(axis=1)
    frames = np.flatnonzero(np.isfinite(path).all(axis=1))
    if not known.any() or len(frames) < 2:
        return line
    turning = Slerp(frames, Rotation.from_quat(path[frames], scalar_first=True))
    turned = turning((samples.before + samples.share)[known]).as_quat(scalar_first=True)
    # The straight line between two quaternions lies on the side of the path's signs.
    turned *= np.where(np.sum(turned * line[known], axis=1) < 0, -1.0, 1.0)[:, None]
    line[known] = turned
    return line
