"""Tables of key points, CSV or Parquet: a row is one hand in one frame."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.postures import Postures
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import KEY_POINTS, Side

GROUP: Final = ("clip", "subject", "object", "task")
"""Columns whose values tell clips apart; each may be left out."""

POSE: Final = ("object_x", "object_y", "object_z", "object_qw", "object_qx", "object_qy", "object_qz")
"""Columns of the object's pose: position in the file's unit, unit quaternion (w, x, y, z)."""

COORDINATE: Final = re.compile(rf"({'|'.join(KEY_POINTS)})_([xyz])(?:_(m|dm|cm|mm))?")


def read_table(path: Path) -> Iterator[Postures]:
    """Read a table of key points.

    Columns are ``<key point>_x``, ``_y`` and ``_z``, with ``_mm`` or another unit behind them if wanted, and
    as far as they are known ``clip``, ``subject``, ``side``, ``object``, ``task``, ``frame``, ``time`` [s],
    ``identifier`` and the object's pose (`POSE`).

    Raises
    ------
    ImportSourceError
        If it cannot be read, or a column is missing.
    """
    try:
        table = (
            pyarrow.csv.read_csv(path)
            if path.suffix.lower() == ".csv"
            else pyarrow.parquet.read_table(path, partitioning=None)
        )
    except (pa.ArrowException, OSError) as error:
        found = f"it cannot be read ({str(error).splitlines()[0]})"
        raise ImportSourceError(path, found, "Copy or download it again.") from error
    columns, unit = _coordinates(path, table)
    if not table.num_rows:
        raise ImportSourceError(path, "it has no rows", "Copy or download it again.")
    keys = [name for name in GROUP if name in table.column_names]
    table = table.append_column("_row", pa.array(np.arange(table.num_rows)))
    groups = table.group_by(keys, use_threads=False).aggregate([("_row", "list")]) if keys else None
    if groups is None:
        yield _postures(path, table, columns, unit, {})
        return
    for group in groups.to_pylist():
        rows = table.take(pa.array(group.pop("_row_list")))
        yield _postures(path, rows, columns, unit, {key: _text(value) for key, value in group.items()})


def _coordinates(path: Path, table: pa.Table) -> tuple[list[str], str | None]:
    """Return the 63 columns of coordinates in order, and the unit that their names end in."""
    found = {(m[1], m[2]): (name, m[3]) for name in table.column_names if (m := COORDINATE.fullmatch(name))}
    wanted = [(point, axis) for point in KEY_POINTS for axis in "xyz"]
    missing = [f"{point}_{axis}" for point, axis in wanted if (point, axis) not in found]
    if missing:
        seen = ", ".join(table.column_names[:8])
        remedy = "Name the coordinates wrist_x, wrist_y, ... little_tip_z; see docs/import.md."
        raise ImportSourceError(path, f"no column {missing[0]}; its columns begin {seen}", remedy)
    units = {unit for _, unit in found.values()}
    if len(units) != 1:
        spelt = ", ".join(sorted(unit or "none" for unit in units))
        raise ImportSourceError(path, f"columns of different units: {spelt}", "Give all in one unit.")
    return [found[place][0] for place in wanted], units.pop()


def _postures(
    path: Path, rows: pa.Table, columns: Sequence[str], unit: str | None, about: dict[str, str | None]
) -> Postures:
    """Return the rows of one clip as arrays, one frame for both hands."""
    sides = _sides(path, rows)
    frames, index = np.unique(_frame_keys(path, rows, sides), return_inverse=True)
    values = np.stack([_numbers(path, rows, name) for name in columns], axis=1).reshape(
        -1, len(KEY_POINTS), 3
    )
    key_points: dict[Side | None, Floats] = {}
    for side in dict.fromkeys(sides):
        own = np.array([other == side for other in sides])
        if len(np.unique(index[own])) != np.count_nonzero(own):
            raise ImportSourceError(
                path, "two rows of one hand and frame", "Tell the frames apart, or the clips."
            )
        key_points[side] = np.full((len(frames), len(KEY_POINTS), 3), np.nan)
        key_points[side][index[own]] = values[own]
    first = np.unique(index, return_index=True)[1]
    return Postures(
        key_points=key_points,
        poses=_poses(path, rows.take(pa.array(first))),
        name="_".join(value for value in about.values() if value),
        object=about.get("object"),
        subject=about.get("subject"),
        task=about.get("task"),
        units=unit,
        rate=_rate(path, frames) if "time" in rows.column_names else None,
        identifiers=_identifiers(rows, first),
    )


def _sides(path: Path, rows: pa.Table) -> list[Side | None]:
    if "side" not in rows.column_names:
        return [None] * rows.num_rows
    said = rows["side"].to_pylist()
    strange = [value for value in said if value not in tuple(Side)]
    if strange:
        raise ImportSourceError(path, f"side {strange[0]!r}", "Give right or left in each row.")
    return [Side(value) for value in said]


def _frame_keys(path: Path, rows: pa.Table, sides: Sequence[Side | None]) -> Floats:
    """Return what tells the frames of a clip apart: time, else frame, else the order of the rows."""
    for name in ("time", "frame"):
        if name in rows.column_names:
            return _numbers(path, rows, name)
    counts: dict[Side | None, int] = {}
    keys = []
    for side in sides:
        keys.append(counts.get(side, 0))
        counts[side] = keys[-1] + 1
    return np.array(keys, dtype=np.float64)


def _rate(path: Path, times: Floats) -> float | None:
    """Return frames per second of evenly spaced times; None for a single one."""
    if len(times) < 2:
        return None
    steps = np.diff(times)
    step = float(np.median(steps))
    if not np.all(np.abs(steps / step - np.round(steps / step)) < 0.1):
        found = f"times that are not evenly spaced: steps of {steps.min():.4g} to {steps.max():.4g} s"
        raise ImportSourceError(path, found, "Resample to one rate; frames may be missing, not shifted.")
    if not np.all(np.round(steps / step) == 1):
        found = f"a gap of {steps.max():.4g} s between frames {step:.4g} s apart"
        raise ImportSourceError(path, found, "Add rows with empty coordinates for the frames left out.")
    return 1 / step


def _poses(path: Path, rows: pa.Table) -> Floats | None:
    there = [name for name in POSE if name in rows.column_names]
    if not there:
        return None
    if len(there) != len(POSE):
        missing = next(name for name in POSE if name not in there)
        raise ImportSourceError(path, f"a pose without column {missing}", f"Give all of {', '.join(POSE)}.")
    numbers = np.stack([_numbers(path, rows, name) for name in POSE], axis=1)
    quaternions = np.asarray(numbers[:, 3:], dtype=np.float64)
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    poses[:, :3, 3], poses[:, :3, :3] = numbers[:, :3], rotations_from_quaternions(quaternions)
    return poses


def _identifiers(rows: pa.Table, first: Any) -> tuple[str, ...]:
    if "identifier" not in rows.column_names:
        return ()
    return tuple(str(value) for value in rows["identifier"].take(pa.array(first)).to_pylist())


def _numbers(path: Path, rows: pa.Table, name: str) -> Floats:
    try:
        column = pc.cast(rows[name], pa.float64())
    except pa.ArrowException as error:
        raise ImportSourceError(path, f"column {name} is not of numbers ({error})", "Mend it.") from error
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _text(value: Any) -> str | None:
    return None if value is None else str(value)
