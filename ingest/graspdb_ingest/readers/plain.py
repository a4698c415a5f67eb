"""Plain tables: a column of times and three columns for each marker, as CSV or tab-separated text."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.readers.registry import reader
from graspdb_ingest.readers.text import TextLines, number_block, read_lines
from graspdb_ingest.readers.timing import check_frame_numbers, rate_from_times
from graspdb_ingest.readers.trajectories import trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError

_COORDINATE: Final = re.compile(r"(?P<label>.*\S)\s*[_. ]\s*(?P<axis>[xyzXYZ])$")
_TIME: Final = re.compile(r"(time|times|timestamp|t)[ _]*[(\[]?(s|sec|seconds)?[)\]]?$", re.IGNORECASE)
_FRAME: Final = re.compile(r"frames?[ _]*(#|no|number|index)?$", re.IGNORECASE)
_COLUMNS: Final = (
    "Give it a row of titles: time, then <label>_x, <label>_y and <label>_z (or .x or ' X') for each marker."
)


@dataclass(frozen=True)
class Columns:
    """What the columns of a plain table are.

    Attributes
    ----------
    time : int
        Column of times [s].
    frame : int or None
        Column of frame numbers.
    markers : mapping of str to tuple of int
        Columns of x, y and z by label.
    """

    time: int
    frame: int | None
    markers: Mapping[str, tuple[int, int, int]]

    @property
    def used(self) -> list[int]:
        """The columns of the coordinates, marker by marker."""
        return [column for axes in self.markers.values() for column in axes]


def find_columns(path: Path, titles: Sequence[str]) -> Columns:
    """Tell the columns of a plain table by their titles; others are left alone.

    Raises
    ------
    RecordingError
        If there are no markers or no times, a title stands twice, or a marker lacks an axis.
    """
    time = frame = None
    markers: dict[str, dict[str, int]] = {}
    for column, title in enumerate(titles):
        bare = title.strip()
        coordinate = _COORDINATE.match(bare)
        if _TIME.match(bare):
            time = column if time is None else time
        elif _FRAME.match(bare):
            frame = column if frame is None else frame
        elif coordinate:
            axes = markers.setdefault(coordinate["label"], {})
            axis = coordinate["axis"].lower()
            if axis in axes:
                raise RecordingError(
                    path, f"its column {bare!r} stands twice", "Rename one of the two markers."
                )
            axes[axis] = column
    for label, axes in markers.items():
        for axis in "xyz":
            if axis not in axes:
                raise RecordingError(path, f"marker {label!r} has no column of {axis}", _COLUMNS)
    if not markers:
        shown = ", ".join(repr(title.strip()[:30]) for title in titles[:8])
        raise RecordingError(path, f"its titles name no markers: {shown}", _COLUMNS)
    if time is None:
        raise RecordingError(path, "it has no column of times, so its rate is unknown", _COLUMNS)
    found = {label: (axes["x"], axes["y"], axes["z"]) for label, axes in markers.items()}
    return Columns(time, frame, found)


@reader("plain CSV", ".csv", ".tsv", ".txt")
def read_plain(path: Path, default_scale: float) -> Recording:
    """Read a plain table: rate from its times, which must be evenly spaced; zeros or blanks are missing.

    Cells are separated by commas, semicolons (then decimal commas are taken) or tabs; lines that
    start with ``#`` above the titles are comments. The file does not say its unit.
    """
    text = read_lines(path)
    first = next((i for i, line in enumerate(text.lines) if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise RecordingError(path, "it has no row of titles", _COLUMNS)
    line = text.lines[first]
    delimiter = max("\t;,", key=line.count)
    titles = next(csv.reader([line], delimiter=delimiter))
    columns = find_columns(path, titles)
    if delimiter == ";":
        text = TextLines(path, [row.replace(",", ".") for row in text.lines], text.ended)
    extra = [columns.time] if columns.frame is None else [columns.time, columns.frame]
    rows = number_block(text, first + 1, delimiter, titles, [*extra, *columns.used])
    frames = rows[:, 1] if columns.frame is not None else None
    return plain_recording(path, columns, rows[:, 0], frames, rows[:, len(extra) :], default_scale)


def plain_recording(
    path: Path,
    columns: Columns,
    times: NDArray[np.float64],
    frames: NDArray[np.float64] | None,
    coordinates: NDArray[np.float64],
    scale: float,
) -> Recording:
    """Return the recording that the columns of a plain table hold.

    Parameters
    ----------
    path : Path
        The file.
    columns : Columns
        What its columns are.
    times : ndarray, shape (n_frames,)
        Times [s].
    frames : ndarray, shape (n_frames,), or None
        Frame numbers.
    coordinates : ndarray, shape (n_frames, 3 * n_markers)
        Coordinates, marker by marker.
    scale : float
        Metres in the coordinates' unit.
    """
    if frames is not None:
        check_frame_numbers(path, frames)
    raw = coordinates.reshape(len(coordinates), len(columns.markers), 3)
    rate = rate_from_times(path, times)
    return trajectories(path, list(columns.markers), raw, scale, rate, float(times[0]))
