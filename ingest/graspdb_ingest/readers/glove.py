"""Joint angles of a data glove: a plain table with a column for each joint."""

import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.readers.text import TextLines, number_block, read_lines
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.manifest import Glove

_TIME: Final = re.compile(r"(time|times|timestamp|t)[ _]*[(\[]?(s|sec|seconds)?[)\]]?$", re.IGNORECASE)
_FRAME: Final = re.compile(r"(frames?|samples?)[ _]*(#|no|number|index)?$", re.IGNORECASE)
_UNIT: Final = re.compile(
    r"(?P<name>.*?)\s*[(\[]\s*(?P<unit>deg|degrees?|°|rad|radians?)\s*[)\]]$", re.IGNORECASE
)
_ANGLES: Final = "Give it a row of titles: time, then the name of a joint for each sensor."
_TURN: Final = 2 * np.pi
"""No joint goes further than this [rad]; larger numbers are degrees."""


@dataclass(frozen=True)
class GloveRecording:
    """Joint angles of one trial as the glove gave them.

    Attributes
    ----------
    path : Path
        The file.
    sensors : tuple of str
        Names of the sensors, renamed as the manifest says.
    angles : ndarray, shape (n_samples, n_sensors)
        Angles [rad], NaN where missing.
    times : ndarray, shape (n_samples,)
        Time of each sample [s].
    own_clock : bool
        Whether the file has times; otherwise they are counted from its first sample.
    """

    path: Path
    sensors: tuple[str, ...]
    angles: NDArray[np.float64]
    times: NDArray[np.float64]
    own_clock: bool


def read_glove(path: Path, glove: Glove) -> GloveRecording:
    """Read the joint angles of a data glove from a plain table.

    Cells are separated by commas, semicolons (then decimal commas are taken) or tabs; lines that
    start with ``#`` above the titles are comments; blank cells are missing samples. A title is the
    name of a joint, and may have its unit behind it: ``index_pip_flexion [deg]``.

    Parameters
    ----------
    path : Path
        The file.
    glove : Glove
        What files do not say: unit, rate, and names that differ.

    Raises
    ------
    RecordingError
        If the table cannot be read, its unit or rate is not known, a sensor stands twice, its times do
        not grow, or its angles are none in the unit that is stated.
    """
    text = _read(path)
    first = next((i for i, line in enumerate(text.lines) if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise RecordingError(path, "it has no row of titles", _ANGLES)
    delimiter = max("\t;,", key=text.lines[first].count)
    titles = [title.strip() for title in next(csv.reader([text.lines[first]], delimiter=delimiter))]
    if delimiter == ";":
        text = TextLines(path, [row.replace(",", ".") for row in text.lines], text.ended)
    time = next((i for i, title in enumerate(titles) if _TIME.match(title)), None)
    used = [i for i, t in enumerate(titles) if t and i != time and not _FRAME.match(t) and not _TIME.match(t)]
    sensors, units = _sensors(path, [titles[i] for i in used], glove)
    columns = used if time is None else [time, *used]
    rows = number_block(text, first + 1, delimiter, titles, columns)
    if len(rows) < 2:
        raise RecordingError(path, f"it has {len(rows)} samples", "Export the whole recording.")
    times = _times(path, None if time is None else rows[:, 0], len(rows), glove)
    angles = rows if time is None else rows[:, 1:]
    _check_unit(path, angles, units)
    return GloveRecording(path, sensors, angles * np.where(units, np.pi / 180, 1.0), times, time is not None)


def _read(path: Path) -> TextLines:
    try:
        return read_lines(path)
    except OSError as error:
        raise RecordingError(
            path, f"it cannot be opened ({error.strerror})", "Check the path and its permissions."
        ) from error


def _sensors(path: Path, titles: list[str], glove: Glove) -> tuple[tuple[str, ...], NDArray[np.bool_]]:
    """Return the sensors' names and whether each is in degrees."""
    names, units = [], []
    for title in titles:
        match = _UNIT.match(title)
        bare, unit = (match["name"], match["unit"].lower()) if match else (title, glove.units)
        if unit is None:
            raise RecordingError(
                path,
                f"the unit of column {title!r} is not known",
                "Say `glove: {units: deg}` (or rad) in session.yaml, or write it behind the title: [deg].",
            )
        names.append(glove.names.get(title, glove.names.get(bare, bare)))
        units.append(unit in ("°",) or unit.startswith("deg"))
    if not names:
        raise RecordingError(path, "it has no column of angles", _ANGLES)
    for name, count in Counter(names).items():
        if count > 1:
            raise RecordingError(path, f"{count} columns stand for {name!r}", "Keep one of them.")
    return tuple(names), np.array(units)


def _times(
    path: Path, column: NDArray[np.float64] | None, n_samples: int, glove: Glove
) -> NDArray[np.float64]:
    if column is None:
        if glove.rate is None:
            raise RecordingError(
                path,
                "it has no column of times, so its rate is unknown",
                "Export it with times in seconds, or say `glove: {rate: 100}` in session.yaml.",
            )
        return np.arange(n_samples) / glove.rate
    if not np.isfinite(column).all():
        raise RecordingError(path, "its time column has blank cells", "Export the time of each sample.")
    back = np.flatnonzero(np.diff(column) <= 0)
    if len(back):
        i = int(back[0])
        raise RecordingError(
            path,
            f"its times do not grow: {column[i]:g} s is followed by {column[i + 1]:g} s",
            "Export the samples in the order of their times, each once.",
        )
    return column


def _check_unit(path: Path, angles: NDArray[np.float64], in_degrees: NDArray[np.bool_]) -> None:
    if np.isnan(angles).all():
        raise RecordingError(path, "it has no angle at all", "Export the recording again.")
    largest = np.nanmax(np.abs(angles), axis=0, initial=0.0)
    limits = np.where(in_degrees, np.rad2deg(_TURN), _TURN)
    beyond = np.flatnonzero(largest > limits)
    if len(beyond):
        i = int(beyond[0])
        unit, hint = ("deg", "Export calibrated angles.") if in_degrees[i] else ("rad", "Is it in degrees?")
        raise RecordingError(
            path,
            f"an angle of {largest[i]:g} {unit} stands in it, more than a whole turn",
            f"{hint} The unit stands in its titles or in `glove: units` of session.yaml.",
        )
