"""OpenSim's text files: trajectories of points (TRC) and of coordinates (MOT)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb.export.items import Floats
from graspdb_schemas.vocabulary import JOINT_ANGLES

MILLIMETRES: Final = 1000.0
"""Millimetres in a metre: TRC files are written in millimetres, which every reader of them knows."""

DIGITS: Final = ".10g"
"""Ten significant digits: more than a float32 holds, so that reading gives the same float32 back."""


def write_trc(path: Path, labels: Sequence[str], positions: Floats, times: Floats, rate: float) -> None:
    """Write trajectories of points as TRC, in millimetres, with blank cells where a point is missing.

    Parameters
    ----------
    path : Path
        The file.
    labels : sequence of str
        Name of each point.
    positions : ndarray, shape (n_frames, n_points, 3)
        Positions [m], NaN where missing.
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    rate : float
        Frames per second [Hz].
    """
    n_frames, n_points, _ = positions.shape
    head = {
        "DataRate": format(rate, DIGITS),
        "CameraRate": format(rate, DIGITS),
        "NumFrames": str(n_frames),
        "NumMarkers": str(n_points),
        "Units": "mm",
        "OrigDataRate": format(rate, DIGITS),
        "OrigDataStartFrame": "1",
        "OrigNumFrames": str(n_frames),
    }
    axes = [f"{axis}{number}" for number in range(1, n_points + 1) for axis in "XYZ"]
    names = [cell for label in labels for cell in (label, "", "")]
    lines = [
        ["PathFileType", "4", "(X/Y/Z)", path.name],
        list(head),
        list(head.values()),
        ["Frame#", "Time", *names],
        ["", "", *axes],
        [],
    ]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines("\t".join(line) + "\n" for line in lines)
        for number, (time, row) in enumerate(zip(times, positions.reshape(n_frames, -1), strict=True), 1):
            cells = ["" if np.isnan(x) else format(x, DIGITS) for x in MILLIMETRES * row]
            # OpenSim does not count a blank cell at the end of a line, unless a tab stands behind it.
            end = "\t\n" if cells and not cells[-1] else "\n"
            file.write("\t".join([str(number), format(time, DIGITS), *cells]) + end)


def write_mot(path: Path, name: str, columns: Sequence[str], values: Floats, times: Floats) -> None:
    """Write trajectories of coordinates as MOT, in metres and radians; ``nan`` where one is missing.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What the motion is called.
    columns : sequence of str
        Name of each coordinate.
    values : ndarray, shape (n_frames, n_columns)
        Their values [m, rad].
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    """
    head = [
        " ".join(name.split()),
        "version=1",
        f"nRows={len(values)}",
        f"nColumns={len(columns) + 1}",
        "inDegrees=no",
        "endheader",
        "\t".join(["time", *columns]),
    ]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(line + "\n" for line in head)
        for time, row in zip(times, values, strict=True):
            file.write("\t".join(format(x, DIGITS) for x in (time, *row)) + "\n")


def free_body_columns(body: str) -> tuple[str, ...]:
    """Return the names of a free body's six coordinates, rotations first, as OpenSim's FreeJoint has them."""
    return tuple(f"{body}_{kind}{axis}" for kind in "rt" for axis in "xyz")


def free_body_coordinates(positions: Floats, quaternions: Floats) -> Floats:
    """Return a free body's coordinates: rotations about its own x, then y, then z, and its position.

    Parameters
    ----------
    positions : ndarray, shape (n, 3)
        Positions [m], NaN where not known.
    quaternions : ndarray, shape (n, 4)
        Rotations w x y z, NaN where not known.

    Returns
    -------
    ndarray, shape (n, 6)
        Angles without jumps of whole turns [rad], then the position [m].
    """
    coordinates = np.full((len(positions), 6), np.nan)
    known = np.isfinite(quaternions).all(axis=1) & np.isfinite(positions).all(axis=1)
    if known.any():
        angles = Rotation.from_quat(quaternions[known], scalar_first=True).as_euler("XYZ")
        coordinates[known, :3] = np.unwrap(angles, axis=0)
        coordinates[known, 3:] = positions[known]
    return coordinates


def hand_columns(n_hinges: int, prefix: str, joints: Sequence[str] = JOINT_ANGLES) -> tuple[str, ...]:
    """Return the names of a hand's coordinates: the forearm's six, then a hinge each."""
    names = joints if len(joints) == n_hinges else [f"joint_{i}" for i in range(n_hinges)]
    return (*free_body_columns(f"{prefix}forearm"), *(f"{prefix}{name}" for name in names))


def hand_coordinates(q: Floats) -> Floats:
    """Return a hand's coordinates for configurations of shape (n, n_q): forearm (6), then hinges [rad, m]."""
    return np.concatenate([free_body_coordinates(q[:, :3], q[:, 3:7]), q[:, 7:]], axis=1)
