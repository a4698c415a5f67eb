"""C3D: trajectories of points and the events of a trial, as motion-capture software reads them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]

MILLIMETRES: Final = 1000.0
"""Millimetres in a metre: the files are in millimetres, as nearly all C3D files are."""


@dataclass(frozen=True)
class Event:
    """Something that happens at an instant of a trial.

    Attributes
    ----------
    label : str
        What happens.
    context : str
        To what: right, left.
    time : float
        When [s].
    """

    label: str
    context: str
    time: float


def write_c3d(
    path: Path,
    labels: Sequence[str],
    descriptions: Sequence[str],
    positions: Floats,
    times: Floats,
    rate: float,
    events: Sequence[Event] = (),
) -> None:
    """Write trajectories of points as C3D, as 32-bit floats in millimetres.

    Parameters
    ----------
    path : Path
        The file.
    labels, descriptions : sequence of str
        Name of each point, and what it is.
    positions : ndarray, shape (n_frames, n_points, 3)
        Positions [m], NaN where missing, which the format says with a residual of -1.
    times : ndarray, shape (n_frames,)
        Time of each frame [s]; the file keeps the number of the first frame, and the rate.
    rate : float
        Frames per second [Hz].
    events : sequence of Event
        What happens in it.
    """
    import ezc3d

    n_frames, n_points, _ = positions.shape
    points = np.ones((4, n_points, n_frames))
    points[:3] = MILLIMETRES * positions.transpose(2, 1, 0)
    missing = np.isnan(points[:3]).any(axis=0)
    file = ezc3d.c3d()
    group = file["parameters"]["POINT"]
    group["UNITS"]["value"] = ["mm"]
    group["RATE"]["value"] = [rate]
    group["LABELS"]["value"] = list(labels)
    group["DESCRIPTIONS"]["value"] = list(descriptions)
    file["header"]["points"]["first_frame"] = round(float(times[0]) * rate) if n_frames else 0
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = np.where(missing, -1.0, 0.0)[None]
    if events:
        minutes = [[event.time // 60 for event in events], [event.time % 60 for event in events]]
        file.add_parameter("EVENT", "USED", [len(events)])
        file.add_parameter("EVENT", "LABELS", [event.label for event in events])
        file.add_parameter("EVENT", "CONTEXTS", [event.context for event in events])
        file.add_parameter("EVENT", "TIMES", np.array(minutes))
    file.write(str(path))
