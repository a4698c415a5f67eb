"""Arrays of key points: NPZ files, told by the names of their arrays."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_npz
from graspdb_ingest.importers.postures import Postures
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import KEY_POINTS, Side

ARRAY: Final = re.compile(
    r"(?:(?P<object>.+)\.)?(?:(?P<side>right|left)_)?(?:key_?points|joints)(?:_(?P<unit>m|dm|cm|mm))?"
)
"""Names of NPZ arrays of key points: ``key_points``, ``left_joints_mm``, ``mug.keypoints_m`` ..."""

TEXTS: Final = ("subject", "side", "task", "units", "order", "object")
ARRAYS: Final = ("identifiers", "poses", "up")
ABOUT: Final = (*TEXTS, *ARRAYS, "rate")
"""Names of the arrays that say more, of all key points in the file, or behind an object's name, of its."""


def read_arrays(path: Path) -> Iterator[Postures]:
    """Read an NPZ file of key points.

    Raises
    ------
    ImportSourceError
        If it cannot be read, or holds none; the message says what it holds.
    """
    yield from _from_arrays(path, _arrays(path))


def _arrays(path: Path) -> dict[str, Any]:
    arrays = read_npz(path)
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray) or array.dtype.hasobject:
            remedy = "Write arrays of numbers or text; arrays of objects are not read."
            raise ImportSourceError(path, f"{name} is an array of objects", remedy)
    return arrays


def _from_arrays(path: Path, arrays: Mapping[str, Any]) -> Iterator[Postures]:
    groups: dict[str | None, dict[Side | None, str]] = {}
    units: dict[str | None, str | None] = {}
    for name in arrays:
        match = ARRAY.fullmatch(name)
        if match:
            side = None if match["side"] is None else Side(match["side"])
            groups.setdefault(match["object"], {})[side] = name
            unit = units.setdefault(match["object"], match["unit"])
            if unit != match["unit"]:
                found = f"arrays {', '.join(groups[match['object']].values())} in different units"
                raise ImportSourceError(path, found, "Give both hands in one.")
    if not groups:
        found = f"none of its arrays holds key points: {', '.join(arrays) or 'there are none'}"
        raise ImportSourceError(path, found, "Name them key_points, or left_key_points; see docs/import.md.")
    for thing, named in groups.items():
        key_points = {side: _key_points(path, name, arrays[name]) for side, name in named.items()}
        if len({len(points) for points in key_points.values()}) != 1 or (None in named and len(named) > 1):
            found = f"arrays {', '.join(named.values())} do not belong together"
            raise ImportSourceError(
                path, found, "Give both hands the same number of frames, NaN where unseen."
            )
        about = {key: _said(path, arrays, thing, key) for key in ABOUT}
        yield _posture(path, key_points, thing, units[thing], about)


def _posture(
    path: Path,
    key_points: dict[Side | None, Floats],
    thing: str | None,
    unit: str | None,
    about: Mapping[str, Any],
) -> Postures:
    n_frames = len(next(iter(key_points.values())))
    if None in key_points and about["side"] is not None:
        key_points = {_side(path, str(about["side"])): key_points[None]}
    poses, identifiers = about["poses"], about["identifiers"]
    if poses is not None and poses.shape != (n_frames, 4, 4):
        found = f"poses of shape {poses.shape} for {n_frames} frames"
        raise ImportSourceError(path, found, f"Give object poses of shape ({n_frames}, 4, 4).")
    if identifiers is not None and len(np.atleast_1d(identifiers)) != n_frames:
        found = f"{len(np.atleast_1d(identifiers))} identifiers for {n_frames} frames"
        raise ImportSourceError(path, found, "Give one a frame.")
    said = {key: None if about[key] is None else str(about[key]) for key in TEXTS}
    return Postures(
        key_points=key_points,
        poses=None if poses is None else np.asarray(poses, dtype=np.float64),
        name=thing or "",
        object=thing or said["object"],
        subject=said["subject"],
        task=said["task"],
        units=unit or said["units"],
        order=said["order"],
        rate=None if about["rate"] is None else float(about["rate"]),
        up=None if about["up"] is None else _up(path, about["up"]),
        identifiers=() if identifiers is None else tuple(str(i) for i in np.atleast_1d(identifiers)),
    )


def _key_points(path: Path, name: str, values: Any) -> Floats:
    points = values[None] if values.ndim == 2 else values
    if points.shape[1:] != (len(KEY_POINTS), 3) or points.dtype.kind not in "fiu" or not len(points):
        found = f"array {name} of shape {values.shape} and type {values.dtype}"
        raise ImportSourceError(path, found, f"Give numbers of shape (n, {len(KEY_POINTS)}, 3).")
    return np.asarray(points, dtype=np.float64)


def _said(path: Path, arrays: Mapping[str, Any], thing: str | None, key: str) -> Any:
    """Return what the file says of an object's key points, or else of all; a scalar unless it is a list."""
    value = arrays.get(f"{thing}.{key}", arrays.get(key))
    if value is None or key in ARRAYS:
        return value
    if value.size != 1:
        raise ImportSourceError(path, f"array {key} of shape {value.shape}", "Give one value.")
    return value.item()


def _up(path: Path, value: Any) -> tuple[float, float, float]:
    length = float(np.linalg.norm(value)) if value.dtype.kind in "fiu" else 0.0
    if value.shape != (3,) or not (np.isfinite(length) and length > 0):
        raise ImportSourceError(path, f"up of shape {value.shape}", "Give a direction (3,), against gravity.")
    x, y, z = (float(part) / length for part in value)
    return x, y, z


def _side(path: Path, said: str) -> Side:
    if said not in tuple(Side):
        raise ImportSourceError(path, f"side {said!r}", "Give right or left.")
    return Side(said)
