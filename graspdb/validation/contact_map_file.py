"""Files of contact measured on an object's surface: NPZ, CSV and PLY."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
import trimesh

from graspdb.validation.contact_map import MeasuredMap
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.keypoints import dimensions_of
from graspdb_ingest.objects.normals import estimate_normals
from graspdb_ingest.surface import HandPoints
from graspdb_schemas.errors import MeasuredMapError
from graspdb_schemas.vocabulary import Side

ALIASES: Final = {"vertices_m": "positions", "contact01": "contact"}
"""Other names of arrays in an NPZ file."""
CONTACTPOSE_HANDS: Final = {"hand0_joints_m": Side.LEFT, "hand1_joints_m": Side.RIGHT}
"""Key points under the names of ContactPose, whose hand 0 is the left one."""


def read_measured_map(path: Path) -> tuple[MeasuredMap, tuple[HandPoints, ...]]:
    """Read measured contact, and the hands where the file has them.

    Positions are in metres in the object's frame, contact is 0 to 1.

    - NPZ: ``positions`` (n, 3) and ``contact`` (n,), if known ``normals`` (n, 3) or ``faces`` (m, 3), and
      the hands as ``key_points`` (k, 21, 3) with ``sides`` (k,) and, if measured, ``radii`` (k, 20). The
      names ``vertices_m``, ``contact01``, ``hand0_joints_m`` (left) and ``hand1_joints_m`` (right) do, too.
    - CSV: columns ``x``, ``y``, ``z``, ``contact``, and if known ``nx``, ``ny``, ``nz``.
    - PLY: vertices with a property ``contact``, and faces if known.

    Normals that are not given follow from the faces, or are estimated from the neighbouring points.

    Raises
    ------
    MeasuredMapError
        If the file cannot be read as this.
    """
    readers = {".npz": _read_npz, ".csv": _read_csv, ".ply": _read_ply}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise MeasuredMapError(path, f"its name ends in {path.suffix!r}", "Give an NPZ, CSV or PLY file.")
    if not path.is_file():
        raise MeasuredMapError(path, "there is no such file", "Check the path.")
    try:
        arrays = reader(path)
    except (ValueError, KeyError, OSError, EOFError, BadZipFile) as error:
        remedy = "graspdb validate contact-map --help describes the formats"
        raise MeasuredMapError(path, f"it cannot be read ({error})", f"{remedy}.") from error
    return _measured(path, arrays), _hands(path, arrays)


def _read_npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as file:
        return {ALIASES.get(name, name): file[name] for name in file.files}


def _read_csv(path: Path) -> dict[str, Any]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in (rows[0] if rows else ())}
    arrays: dict[str, Any] = {"contact": columns[name]} if (name := "contact") in columns else {}
    for key, names in (("positions", "x y z"), ("normals", "nx ny nz")):
        if all(name in columns for name in names.split()):
            arrays[key] = np.stack([columns[name] for name in names.split()], axis=1)
    return arrays


def _read_ply(path: Path) -> dict[str, Any]:
    mesh: Any = trimesh.load(path, process=False)
    arrays: dict[str, Any] = {"positions": np.asarray(mesh.vertices)}
    raw = mesh.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    if raw is not None and "contact" in (raw.dtype.names or ()):
        arrays["contact"] = np.asarray(raw["contact"], dtype=float).reshape(-1)
    if len(getattr(mesh, "faces", ())):
        arrays["faces"] = np.asarray(mesh.faces)
    return arrays


def _measured(path: Path, arrays: Mapping[str, Any]) -> MeasuredMap:
    for name in ("positions", "contact"):
        if name not in arrays:
            found = ", ".join(arrays) or "nothing"
            raise MeasuredMapError(path, f"{name} is missing; there is {found}", f"Add {name}.")
    positions, contact = (np.asarray(arrays[name], dtype=float) for name in ("positions", "contact"))
    if positions.shape != (len(contact), 3) or contact.ndim != 1:
        shapes = f"positions of shape {positions.shape} and contact of shape {contact.shape}"
        raise MeasuredMapError(path, shapes, "Give positions (n, 3) and contact (n,).")
    known = np.isfinite(positions).all(axis=1) & np.isfinite(contact)
    if known.sum() < 4:
        raise MeasuredMapError(path, f"{int(known.sum())} points have position and contact", "Give more.")
    if contact[known].min() < 0 or contact[known].max() > 1:
        found = f"contact reaches from {contact[known].min():g} to {contact[known].max():g}"
        raise MeasuredMapError(path, found, "Scale it to 0 (none) to 1.")
    if np.ptp(positions[known], axis=0).max() > 3.0:
        extent = float(np.ptp(positions[known], axis=0).max())
        raise MeasuredMapError(path, f"positions spread over {extent:.4g} m", "Give positions in metres.")
    normals = _normals(path, arrays, np.where(known[:, None], positions, 0.0))
    return MeasuredMap(positions[known], normals[known], contact[known])


def _normals(path: Path, arrays: Mapping[str, Any], positions: Floats) -> Floats:
    """Return normals as given, from the faces, or estimated."""
    if "normals" in arrays:
        normals = np.asarray(arrays["normals"], dtype=float)
        if normals.shape != positions.shape:
            raise MeasuredMapError(path, f"normals of shape {normals.shape}", f"Give {positions.shape}.")
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12))
    if "faces" in arrays:
        faces = np.asarray(arrays["faces"], dtype=np.int64)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.min() < 0 or faces.max() >= len(positions):
            raise MeasuredMapError(
                path, "faces do not index the positions", "Give triangles, counted from 0."
            )
        mesh = trimesh.Trimesh(positions, faces, process=False)
        return np.asarray(mesh.vertex_normals, dtype=np.float64)
    return np.asarray(estimate_normals(np.asarray(positions, dtype=np.float64)))


def _hands(path: Path, arrays: Mapping[str, Any]) -> tuple[HandPoints, ...]:
    """Return the hands that the file has."""
    named = [(arrays[name], side) for name, side in CONTACTPOSE_HANDS.items() if name in arrays]
    if "key_points" in arrays:
        sides = [str(side) for side in np.atleast_1d(arrays.get("sides", "right"))]
        points = np.asarray(arrays["key_points"], dtype=float)
        points = points[None] if points.ndim == 2 else points
        if len(sides) != len(points) or not set(sides) <= {"right", "left"}:
            found = f"sides {sides} for {len(points)} hands"
            raise MeasuredMapError(path, found, "Give right or left for each.")
        named += [(hand, Side(side)) for hand, side in zip(points, sides, strict=True)]
    if not named:
        return ()
    hands = np.array([hand for hand, _ in named], dtype=float)
    if "radii" in arrays:
        radii = np.broadcast_to(np.asarray(arrays["radii"], dtype=float), (len(hands), 20))
    else:
        radii = np.broadcast_to(dimensions_of(hands).radii, (len(hands), 20))
    return tuple(HandPoints(hand, r, side) for hand, r, (_, side) in zip(hands, radii, named, strict=True))
