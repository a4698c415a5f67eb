"""C3D, the exchange format of biomechanics, through ezc3d."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.readers.c3d_process import C3DContent, read_content
from graspdb_ingest.readers.c3d_structure import BLOCK, C3DStructure, check_structure, read_points
from graspdb_ingest.readers.registry import reader
from graspdb_ingest.readers.timing import check_frame_count, stated_rate
from graspdb_ingest.readers.trajectories import scale_of, trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError

_MODELLED: Final = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")
"""Parameters that list points which are no positions but outputs of a model."""


@reader("C3D", ".c3d")
def read_c3d(path: Path, default_scale: float) -> Recording:
    """Read a C3D file: rate from POINT:RATE, unit from POINT:UNITS.

    A point with a residual below zero, or at exactly 0, 0, 0, was not seen. The first frame's time
    is that of its number, since frames are counted from the start of the capture. Outputs of a
    model that share the section of points (angles, moments ...) are left out.
    """
    structure = check_structure(path)
    file = read_content(path)
    raw, residuals = _points(path, structure, file)
    raw[residuals < 0] = np.nan
    rates = file.values("POINT", "RATE")
    rate = stated_rate(path, rates[0] if len(rates) else file.rate, "POINT:RATE")
    units = file.values("POINT", "UNITS")
    return trajectories(
        path,
        _labels(file, raw.shape[1]),
        raw,
        scale_of(path, units[0] if len(units) else None, default_scale),
        rate,
        file.first_frame / rate,
    )


def _labels(file: C3DContent, n_markers: int) -> list[str]:
    """Return a label for each point, blank where it has none or is no position."""
    modelled = {str(label).strip() for name in _MODELLED for label in file.values("POINT", name)}
    labels = [str(label).strip() for label in file.values("POINT", "LABELS")]
    number = 2
    while f"LABELS{number}" in file.parameters.get("POINT", {}):  # a parameter holds 255 labels at most
        labels += [str(label).strip() for label in file.values("POINT", f"LABELS{number}")]
        number += 1
    labels = ["" if label in modelled else label for label in labels]
    return (labels + [""] * n_markers)[:n_markers]


def _points(
    path: Path, structure: C3DStructure, file: C3DContent
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions, shape (n_frames, n_markers, 3), and residuals, shape (n_frames, n_markers).

    The header counts to 65535 frames. Longer files say their length in POINT:LONG_FRAMES or TRIAL,
    or are as long as the file goes; of some of them ezc3d reads 65535 frames.
    """
    points, residuals = file.points, file.residuals
    if structure.open_ended:
        stated = _long_count(file)
        wanted = structure.present if stated is None else stated
        check_frame_count(path, str(wanted), structure.present)
        if len(points) < wanted:
            if not structure.plain_floats:
                found = f"it has {wanted} frames, of which its header lets {len(points)} be read"
                raise RecordingError(path, found, "Export it in parts of fewer than 65535 frames.")
            both = read_points(path, structure, wanted).astype(np.float64)
            points, residuals = both[..., :3], both[..., 3]
        if stated is None:
            wanted -= _padding(points[:wanted], structure)
        points, residuals = points[:wanted], residuals[:wanted]
    return np.array(points, dtype=np.float64), np.asarray(residuals)


def _padding(points: NDArray[np.float64], structure: C3DStructure) -> int:
    """Return how many frames at the end are the zeros that fill the file's last block."""
    most = BLOCK // (2 * structure.frame_values)
    tail = np.nan_to_num(points[max(0, len(points) - most) :]).any(axis=(1, 2))
    return int(tail.size - np.flatnonzero(tail).max(initial=-1) - 1)


def _long_count(file: C3DContent) -> int | None:
    long = file.values("POINT", "LONG_FRAMES")
    if len(long):
        return int(long[0])
    first, last = file.values("TRIAL", "ACTUAL_START_FIELD"), file.values("TRIAL", "ACTUAL_END_FIELD")
    if len(first) == len(last) == 2:  # low word, high word
        start, end = (int(low) % 65536 + 65536 * (int(high) % 65536) for low, high in (first, last))
        return end - start + 1
    return None
