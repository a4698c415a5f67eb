"""The last step of every reader: raw numbers to a checked `Recording`."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.units import METRES_PER, metres_per

_FARTHEST: Final = 100.0
"""Coordinates beyond this are a wrong unit or a damaged file [m]; no capture volume is so large."""


def scale_of(path: Path, unit: str | None, default_scale: float) -> float:
    """Return the metres in one of a file's length units.

    Parameters
    ----------
    path : Path
        The file, for the message.
    unit : str or None
        The unit as the file spells it; None or blank where it does not say.
    default_scale : float
        What to return where it does not say.

    Raises
    ------
    RecordingError
        If the unit is not a known one.
    """
    if unit is None or not unit.strip():
        return default_scale
    metres = metres_per(unit)
    if metres is None:
        known = ", ".join(METRES_PER)
        raise RecordingError(
            path, f"its length unit is {unit.strip()!r}", f"Export it in one of these: {known}."
        )
    return metres


def trajectories(
    path: Path,
    labels: Sequence[str],
    raw: NDArray[np.float64],
    scale: float,
    rate: float,
    start_time: float = 0.0,
) -> Recording:
    """Check trajectories and put them into metres.

    A point with a coordinate missing, or exactly at 0, 0, 0, was not seen. Columns without a label
    are left out. ``Set:name`` becomes ``name`` where that stays unique.

    Parameters
    ----------
    path : Path
        The file.
    labels : sequence of str
        Label of each marker, blank for none.
    raw : ndarray, shape (n_frames, n_markers, 3)
        Coordinates in the file's unit.
    scale : float
        Metres in that unit.
    rate : float
        Frames per second [Hz], already checked.
    start_time : float
        Time of the first frame [s].

    Returns
    -------
    Recording
        The trajectories.

    Raises
    ------
    RecordingError
        If there are no frames or no markers, labels that stand twice, or coordinates that are
        infinite or more than 100 m.
    """
    names = [label.strip() for label in labels]
    kept = [i for i, name in enumerate(names) if name]
    if not kept:
        raise RecordingError(path, "it holds no labelled markers", "Label the markers and export again.")
    if raw.shape[0] == 0:
        raise RecordingError(path, "it holds no frames", "Export the recording again with its frames.")
    names = [names[i] for i in kept]
    for name, count in Counter(names).items():
        if count > 1:
            raise RecordingError(
                path,
                f"{count} markers are labelled {name!r}",
                "Rename all but one of them in the capture software and export again.",
            )
    positions = raw[:, kept, :] * scale
    _check_coordinates(path, names, positions)
    unseen = np.isnan(positions).any(axis=2) | (positions == 0.0).all(axis=2)
    positions[unseen] = np.nan
    return Recording(path, tuple(_without_sets(names)), positions, rate, start_time)


def _check_coordinates(path: Path, names: Sequence[str], positions: NDArray[np.float64]) -> None:
    with np.errstate(invalid="ignore"):
        far = (np.abs(positions) > _FARTHEST).any(axis=2)
    if not far.any():
        return
    frame, marker = (int(i) for i in np.argwhere(far)[0])
    largest = float(np.nanmax(np.abs(positions[frame, marker])))
    where = f"{names[marker]!r} in frame {frame + 1}"
    if np.isinf(largest):
        raise RecordingError(
            path, f"{where} has an infinite coordinate", "Export it again with missing markers left blank."
        )
    raise RecordingError(
        path,
        f"{where} is {largest:.3g} m from the origin, and nobody captures beyond {_FARTHEST:g} m",
        "Check the length unit: the file's own, or `units` in session.yaml where the file has none.",
    )


def _without_sets(names: Sequence[str]) -> list[str]:
    """Return names without the marker set before a colon, where that leaves them unique."""
    short = [name.rpartition(":")[2].strip() for name in names]
    counts = Counter(short)
    return [brief if brief and counts[brief] == 1 else name for name, brief in zip(names, short, strict=True)]
