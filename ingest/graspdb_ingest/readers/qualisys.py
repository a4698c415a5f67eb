"""Qualisys Track Manager's motion data as tab-separated text (TSV)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
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
from graspdb_ingest.readers.trajectories import trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError

_KEY: Final = re.compile(r"[A-Z][A-Z_0-9]+$")
_AXIS: Final = re.compile(r" [XYZ]$")
_EXPORT: Final = "Export it from QTM again as TSV, 3D data with header."


def _is_qualisys(head: bytes) -> bool:
    return re.search(rb"^(\xef\xbb\xbf)?(NO_OF_FRAMES|MARKER_NAMES)\t", head, re.MULTILINE) is not None


@dataclass(frozen=True)
class _Header:
    """What stands before the data rows."""

    values: dict[str, tuple[str, ...]]
    columns: tuple[str, ...]
    first_row: int

    def value(self, key: str) -> str:
        """Return the first value of a key, empty where there is none."""
        return (self.values.get(key) or ("",))[0]


@reader("Qualisys TSV", ".tsv", ".txt", sniff=_is_qualisys)
def read_qualisys(path: Path, default_scale: float) -> Recording:
    """Read a QTM export: rate from FREQUENCY, zeros, blanks or null for missing markers.

    The file does not say its unit; QTM writes millimetres.
    """
    text = read_lines(path)
    header = _header_of(text)
    included = header.values.get("DATA_INCLUDED", ("3D",))
    if included[:1] != ("3D",):
        raise RecordingError(path, f"it holds {' '.join(included)} data, not marker positions", _EXPORT)
    labels = _labels(path, header)
    leading = _leading_columns(text, header, len(labels))
    names = [*leading, *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    rows = number_block(text, header.first_row, "\t", names, range(len(names)))
    check_frame_count(path, header.value("NO_OF_FRAMES"), len(rows))
    if "Frame" in leading:
        check_frame_numbers(path, rows[:, leading.index("Frame")])
    times = rows[:, leading.index("Time")] if "Time" in leading else None
    frequency = header.value("FREQUENCY")
    if frequency in ("", "EXT") and times is not None:
        rate, start = rate_from_times(path, times), float(times[0])
    else:
        rate = stated_rate(path, frequency, "FREQUENCY")
        start = 0.0 if times is None else start_of(path, times, rate, "FREQUENCY")
    raw = rows[:, len(leading) :].reshape(len(rows), len(labels), 3)
    return trajectories(path, labels, raw, default_scale, rate, start)


def _header_of(text: TextLines) -> _Header:
    values: dict[str, tuple[str, ...]] = {}
    for index, line in enumerate(text.lines):
        cells = [cell.strip() for cell in line.split("\t")]
        if _KEY.match(cells[0]):
            values.setdefault(cells[0], tuple(cells[1:]))
        elif line.strip():
            is_names = not _is_number(cells[0])
            columns = tuple(cell for cell in cells if cell) if is_names else ()
            return _Header(values, columns, index + 1 if is_names else index)
    return _Header(values, (), len(text.lines))


_DIGITS = 6
"""Digits of a number of markers, at most."""


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell.lower() in ("", "null")
    return True


def _labels(path: Path, header: _Header) -> tuple[str, ...]:
    """Return the labels, blank ones included where a trajectory has none."""
    named = header.values.get("MARKER_NAMES")
    if named is None:
        axes = [column for column in header.columns if _AXIS.search(column)]
        if not axes:
            raise RecordingError(path, "its header has no MARKER_NAMES", _EXPORT)
        return tuple(_AXIS.sub("", column) for column in axes[::3])
    count = header.value("NO_OF_MARKERS")
    if not count.isdecimal():
        return tuple(name for name in named if name)
    if len(count) > _DIGITS:
        raise RecordingError(path, f"its header counts {count[:20]}... markers", _EXPORT)
    if len([name for name in named if name]) > int(count):
        raise RecordingError(
            path, f"its header counts {count} markers and names {len(named)}: {', '.join(named)}", _EXPORT
        )
    return (*named, *[""] * int(count))[: int(count)]


def _leading_columns(text: TextLines, header: _Header, n_markers: int) -> Sequence[str]:
    """Return which of Frame and Time stand before the coordinates."""
    if header.columns:
        return [name for name in header.columns[:2] if name in ("Frame", "Time")]
    cells = text.line(header.first_row).split("\t")
    while len(cells) > 3 * n_markers and not cells[-1].strip():
        cells.pop()
    extra = len(cells) - 3 * n_markers
    if extra not in (0, 1, 2) and text.line(header.first_row):
        raise RecordingError(
            text.path,
            f"line {header.first_row + 1} has {len(cells)} cells for {n_markers} markers",
            _EXPORT,
        )
    return ("Frame", "Time")[: max(extra, 0)]
