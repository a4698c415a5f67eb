"""The skeleton of a C3D file, checked before a library reads it.

A file that was cut short, or whose parameters are damaged, can keep the library reading forever;
and a file of more than 65535 frames does not say its length where the header has room for it.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.readers.timing import check_frame_count, stated_rate
from graspdb_schemas.errors import RecordingError

BLOCK: Final = 512
"""Bytes of which files consist in whole numbers."""
_PROCESSORS: Final = {84: ("<", 3), 85: ("<", 1), 86: (">", 0)}
"""Byte order of integers, and the byte with a float's sign, by processor: Intel, DEC, MIPS."""
_TYPES: Final = {-1: 1, 1: 1, 2: 2, 4: 4}
"""Bytes of one value by parameter type: character, byte, integer, float."""
_LONGEST: Final = 65535
"""Frames that the header can count."""


@dataclass(frozen=True)
class C3DStructure:
    """How many frames a C3D file has room for, and promises.

    Attributes
    ----------
    promised : int
        Frames that POINT:FRAMES counts, or the header where that is missing; 65535 may stand for more.
    present : int
        Whole frames that the file has room for.
    n_points : int
        Points in a frame.
    start : int
        Byte where the frames start.
    frame_values : int
        Values in a frame: four for each point, then those of analogue channels.
    plain_floats : bool
        Whether values are 32-bit floats in the order of bytes that is usual today.
    """

    promised: int
    present: int
    n_points: int
    start: int
    frame_values: int
    plain_floats: bool

    @property
    def open_ended(self) -> bool:
        """Whether the header's count is at its limit, so that the file may have more frames."""
        return self.promised >= _LONGEST


def check_structure(path: Path) -> C3DStructure:
    """Check a C3D file's header, walk its parameters and count its frames.

    Raises
    ------
    RecordingError
        If it is no C3D file, is damaged, or is cut short.
    """
    data = np.memmap(path, dtype=np.uint8, mode="r")
    header = bytes(data[:BLOCK])
    if len(header) < 2 or header[1] != 0x50:
        raise RecordingError(path, "it does not start as a C3D file does", "Give the file its true ending.")
    start = (header[0] - 1) * BLOCK
    if len(header) < BLOCK or start < BLOCK or start + BLOCK > data.size:
        _cut_short(path, "in its header")
    section = bytes(data[start : start + 255 * BLOCK])
    processor = section[3]
    if processor not in _PROCESSORS:
        _damaged(path, f"its parameters are for an unknown processor ({processor})")
    order, sign = _PROCESSORS[processor]
    (rate,) = struct.unpack_from("<f", header, 20)
    if sign == 3 and not math.isfinite(rate):
        stated_rate(path, rate, "its header")
    frames = _frames_parameter(_walk(path, section, order), section, order)
    return _count_frames(path, header, processor, frames, data.size)


def _cut_short(path: Path, where: str) -> NoReturn:
    raise RecordingError(path, f"it breaks off {where}", "Export the recording again, or copy it again.")


def _damaged(path: Path, found: str) -> NoReturn:
    raise RecordingError(path, f"it is damaged: {found}", "Export the recording again, or copy it again.")


@dataclass(frozen=True)
class _Parameter:
    """Where a parameter's values lie in the section; a group has the negative number and no values."""

    group: int
    name: str
    kind: int = 0
    place: int = 0


def _walk(path: Path, section: bytes, order: str) -> list[_Parameter]:
    """Follow the chain of groups and parameters, each of which must lie inside its section."""
    found: list[_Parameter] = []
    place = 4
    while place + 2 <= len(section):
        size, group = struct.unpack_from("bb", section, place)
        body = place + 2 + abs(size)
        if size == 0:
            return found
        if body + 2 > len(section):
            break
        (step,) = struct.unpack_from(f"{order}H", section, body)
        name = section[place + 2 : body].decode("latin-1").strip().upper()
        if not name.isprintable() or not name.isascii():
            _damaged(path, f"its parameter number {len(found) + 1} has no readable name")
        end = body + step if step else len(section)
        if group > 0:
            entry, rest = _parameter(path, section, body + 2, end, group, name)
        else:
            entry, rest = _Parameter(group, name), body + 2
        if step and rest + 1 + section[min(rest, len(section) - 1)] > end:
            _damaged(path, f"its parameter {name!r} and the length of its record disagree")
        found.append(entry)
        if step == 0:
            return found
        if group == 0 or step < 3:
            _damaged(path, f"a parameter at byte {place} of its section")
        place = body + step
    _cut_short(path, "in its parameters")


def _parameter(
    path: Path, section: bytes, place: int, end: int, group: int, name: str
) -> tuple[_Parameter, int]:
    """Return a parameter and where its values end, after a check that they fit into its record."""
    if place + 2 > len(section):
        _cut_short(path, "in its parameters")
    kind, n_dimensions = struct.unpack_from("bB", section, place)
    values = place + 2 + n_dimensions
    if kind not in _TYPES or n_dimensions > 7 or values > len(section):
        _damaged(path, f"its parameter {name!r} is of type {kind} with {n_dimensions} dimensions")
    size = math.prod(section[place + 2 : values])
    if values + size * _TYPES[kind] > min(end, len(section)):
        _damaged(path, f"its parameter {name!r} is larger than its record")
    return _Parameter(group, name, kind, values), values + size * _TYPES[kind]


def _frames_parameter(parameters: Sequence[_Parameter], section: bytes, order: str) -> int | None:
    """Return POINT:FRAMES where it is a plain integer, without sign as long files need it."""
    point = next((entry.group for entry in parameters if entry.group < 0 and entry.name == "POINT"), 0)
    for entry in parameters:
        if entry.group == -point > 0 and entry.name == "FRAMES" and entry.kind == 2:
            return int(struct.unpack_from(f"{order}H", section, entry.place)[0])
    return None


def _count_frames(path: Path, header: bytes, processor: int, frames: int | None, size: int) -> C3DStructure:
    """Compare the frames that are promised with the bytes that follow."""
    order, sign = _PROCESSORS[processor]
    points, analog, first, last = struct.unpack_from(f"{order}4H", header, 2)
    (block,) = struct.unpack_from(f"{order}H", header, 16)
    is_float = bool(header[12 + sign] & 0x80)  # a negative scale means that coordinates are floats
    start = (block - 1) * BLOCK
    if points == 0:
        raise RecordingError(path, "it holds no markers", "Export it with its marker trajectories.")
    if block == 0 or start > size:
        _cut_short(path, "before its data")
    promised = max(last - first + 1, 0) if frames is None else frames
    values = 4 * points + analog
    present = (size - start) // (values * (4 if is_float else 2))
    check_frame_count(path, str(promised), present)
    plain = is_float and _PROCESSORS[processor] == ("<", 3)
    return C3DStructure(promised, present, points, start, values, plain)


def read_points(path: Path, structure: C3DStructure, n_frames: int) -> NDArray[np.float32]:
    """Read the points of a file of plain floats, shape (n_frames, n_points, 4): x, y, z, residual."""
    shape = (n_frames, structure.frame_values)
    values = np.memmap(path, dtype="<f4", mode="r", offset=structure.start, shape=shape)
    return np.array(values[:, : 4 * structure.n_points]).reshape(n_frames, structure.n_points, 4)
