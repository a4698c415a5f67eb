"""OptiTrack Motive's CSV export, versions 1.2x: marker columns only."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from graspdb_ingest.readers.registry import reader
from graspdb_ingest.readers.text import TextLines, number_block, read_lines
from graspdb_ingest.readers.timing import (
    check_frame_count,
    check_frame_numbers,
    rate_from_times,
    start_of,
    stated_rate,
)
from graspdb_ingest.readers.trajectories import scale_of, trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError

_MEASURED: Final = "Marker"
_SOLVED: Final = ("Rigid Body Marker", "Bone Marker", "Marker Constraint")
"""Where the software expects a marker on its own body, seen or not."""
_EXPORT: Final = "Export it from Motive again as CSV with header, markers and global coordinates."
_HEADER_ROWS: Final = 20


def _is_optitrack(head: bytes) -> bool:
    return head.removeprefix(b"\xef\xbb\xbf").lstrip(b'"').startswith(b"Format Version")


@reader("OptiTrack CSV", ".csv", sniff=_is_optitrack)
def read_optitrack(path: Path, default_scale: float) -> Recording:
    """Read a Motive export: rate and unit from its first line, blank cells for missing markers.

    ``Marker`` columns are what the cameras saw. Columns of solved markers (``Rigid Body Marker``)
    are taken only for names that have no measured column, since Motive fills them where the marker
    was hidden.
    """
    text = read_lines(path)
    first = next(csv.reader(text.lines[:1]))
    header = dict(zip(first[::2], (cell.strip() for cell in first[1::2]), strict=False))
    space = header.get("Coordinate Space", "Global")
    if space != "Global":
        raise RecordingError(path, f"its coordinates are {space}, not those of the lab", _EXPORT)
    row = _frame_row(text)
    titles = next(csv.reader([text.lines[row]]))
    markers = _marker_columns(text, row, titles)
    columns = [0, 1, *(column for axes in markers.values() for column in axes)]
    names = [
        f"{name} {title}".strip() for name, title in zip(_names(text, row, len(titles)), titles, strict=True)
    ]
    rows = number_block(text, row + 1, ",", names, columns)
    check_frame_count(path, header.get("Total Exported Frames", ""), len(rows))
    check_frame_numbers(path, rows[:, 0])
    key = "Export Frame Rate" if "Export Frame Rate" in header else "Capture Frame Rate"
    times = rows[:, 1]
    if key in header:
        rate = stated_rate(path, header[key], key)
        start = start_of(path, times, rate, key)
    else:
        rate, start = rate_from_times(path, times), float(times[0])
    scale = scale_of(path, header.get("Length Units"), default_scale)
    raw = rows[:, 2:].reshape(len(rows), len(markers), 3)
    return trajectories(path, list(markers), raw, scale, rate, start)


def _frame_row(text: TextLines) -> int:
    """Return the index of the row of column titles, which starts with Frame."""
    for index, line in enumerate(text.lines[:_HEADER_ROWS]):
        if line.lstrip('" ').startswith("Frame") and "Time" in line:
            return index
    raise RecordingError(text.path, "it has no row of titles that starts with Frame, Time", _EXPORT)


def _labelled_rows(text: TextLines, row: int) -> Mapping[str, Sequence[str]]:
    """Return the rows above the titles by their label in the second cell; the unlabelled one by ''."""
    cells = [next(csv.reader([line]), []) for line in text.lines[1:row]]
    return {entry[1].strip(): entry for entry in cells if len(entry) > 2}


def _names(text: TextLines, row: int, n_columns: int) -> Sequence[str]:
    entry = _labelled_rows(text, row).get("Name", [])
    return ["", "", *(cell.strip() for cell in [*entry, *[""] * n_columns][2:n_columns])]


def _marker_columns(text: TextLines, row: int, titles: Sequence[str]) -> Mapping[str, tuple[int, int, int]]:
    """Return the columns of x, y and z of each marker by its name."""
    rows = _labelled_rows(text, row)
    if "Type" not in rows or "Name" not in rows:
        raise RecordingError(text.path, "its header has no rows Type and Name", _EXPORT)
    kinds, names = rows["Type"], _names(text, row, len(titles))
    quantities = rows.get("", [])
    found: dict[str, dict[str, dict[str, int]]] = {_MEASURED: {}, "solved": {}}
    for column in range(2, min(len(titles), len(kinds))):
        kind = kinds[column].strip()
        group = _MEASURED if kind == _MEASURED else "solved" if kind in _SOLVED else None
        quantity = quantities[column].strip() if column < len(quantities) else "Position"
        title = titles[column].strip()
        if group is None or quantity != "Position" or title not in ("X", "Y", "Z"):
            continue
        axes = found[group].setdefault(names[column], {})
        if title in axes:
            raise RecordingError(
                text.path,
                f"two markers are named {names[column]!r}",
                "Rename one in Motive and export again.",
            )
        axes[title] = column
    markers = {**found["solved"], **found[_MEASURED]}
    if not markers:
        kinds_found = ", ".join(sorted({kind.strip() for kind in kinds[2:] if kind.strip()})) or "nothing"
        raise RecordingError(text.path, f"it holds {kinds_found} and no markers", _EXPORT)
    return {name: _three(text.path, name, axes) for name, axes in markers.items()}


def _three(path: Path, name: str, axes: Mapping[str, int]) -> tuple[int, int, int]:
    if len(axes) != 3:
        missing = ", ".join(axis for axis in "XYZ" if axis not in axes)
        raise RecordingError(path, f"marker {name!r} lacks {missing}", _EXPORT)
    return axes["X"], axes["Y"], axes["Z"]
