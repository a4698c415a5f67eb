"""Marker trajectories as every reader returns them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Recording:
    """Marker trajectories of one trial, in metres and seconds, with nothing filled in.

    Attributes
    ----------
    path : Path
        The file it was read from.
    labels : tuple of str
        Marker labels as the file has them, each once.
    positions : ndarray of float64, shape (n_frames, n_markers, 3)
        Positions in the lab frame [m]; NaN in all three where a marker was not seen.
    rate : float
        Frames per second [Hz].
    start_time : float
        Time of the first frame [s].
    """

    path: Path
    labels: tuple[str, ...]
    positions: NDArray[np.float64]
    rate: float
    start_time: float = 0.0

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.positions.shape[0])

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each frame [s], shape (n_frames,)."""
        return self.start_time + np.arange(self.n_frames) / self.rate

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Where a marker was seen, shape (n_frames, n_markers)."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))
