"""Vertices and faces as they stand in a file: STL, OBJ, PLY, GLB, OFF and PCD.

A file is read into memory and parsed from there, without its materials and textures, so no file that it
refers to is ever opened.
"""

import hashlib
import io
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh
from numpy.typing import NDArray

from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ObjectError

MESH_FORMATS: Final = (".stl", ".obj", ".ply", ".glb", ".off")
CLOUD_FORMATS: Final = (".ply", ".pcd")

_HEADER_LENGTH: Final = 10_000
_CLAIMED_POINTS: Final = re.compile(rb"^POINTS[ \t]+(\d{1,12})\s*$", re.MULTILINE)
_MOST_POINTS_PER_BYTE: Final = 100  # binary_compressed PCD of a cloud whose points are all alike


@dataclass(frozen=True, eq=False)
class Geometry:
    """What a file holds, in its own units.

    Attributes
    ----------
    vertices : ndarray, shape (v, 3)
        Vertices, or the points of a cloud.
    faces : ndarray of int, shape (f, 3), or None
        Triangles; None for a cloud.
    normals : ndarray, shape (v, 3), or None
        Normals of a cloud's points, where the file has them.
    sha256 : str
        Of the file.
    """

    vertices: Array
    faces: NDArray[np.int64] | None
    normals: Array | None
    sha256: str


def read_geometry(path: Path) -> Geometry:
    """Read a mesh, with its scene graph flattened, or a point cloud.

    Parameters
    ----------
    path : Path
        File whose ending names its format.

    Returns
    -------
    Geometry
        All triangles of the file, or all its points.

    Raises
    ------
    ObjectError
        If the file is missing, empty, of another format, damaged, or a mesh format without faces.
    MissingLibraryError
        If Open3D is needed to read a cloud and cannot be loaded.
    """
    suffix = path.suffix.lower()
    allowed = sorted({*MESH_FORMATS, *CLOUD_FORMATS})
    if suffix not in allowed:
        raise ObjectError(
            path, f"unknown format {suffix or '(no ending)'!r}", f"Save it as one of {', '.join(allowed)}."
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ObjectError(
            path, f"cannot be read ({error.strerror})", "Check the path in the manifest."
        ) from error
    if not content:
        raise ObjectError(path, "the file is empty", "Export the object again.")
    sha256 = hashlib.sha256(content).hexdigest()
    if suffix == ".pcd":
        return Geometry(*_read_pcd(path, content), sha256)
    (vertices, faces), (points, normals) = _read_scene(path, content, suffix)
    if len(faces):
        _check_faces(path, vertices, faces)
        return Geometry(vertices, faces, None, sha256)
    if suffix not in CLOUD_FORMATS:
        raise ObjectError(path, "it has no faces", "Save a surface with triangles, or a cloud as PLY or PCD.")
    _check_points(path, points)
    return Geometry(points, None, normals, sha256)


def _read_scene(
    path: Path, content: bytes, suffix: str
) -> tuple[tuple[Array, NDArray[np.int64]], tuple[Array, Array | None]]:
    """Return the vertices and triangles of a file, and the points and normals of a cloud."""
    try:
        with warnings.catch_warnings(), _silent("trimesh"):
            warnings.simplefilter("ignore")  # what matters of them is found again by the checks that follow
            scene = trimesh.load_scene(
                io.BytesIO(content), file_type=suffix[1:], process=False, skip_materials=True
            )
            return _flatten(scene), _points(scene)
    except Exception as error:  # parsers raise whatever a damaged file leads them to
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise ObjectError(
            path, f"not readable as {suffix[1:].upper()} ({reason})", "Export it again."
        ) from error


def _check_faces(path: Path, vertices: Array, faces: NDArray[np.int64]) -> None:
    if faces.min() < 0 or faces.max() >= len(vertices):
        found = f"a face refers to vertex {int(faces.max())} of {len(vertices)}"
        raise ObjectError(path, found, "The file is damaged; export it again.")


def _check_points(path: Path, points: Array) -> None:
    if not len(points):
        raise ObjectError(path, "it has neither faces nor points, or is damaged", "Export the object again.")


@contextmanager
def _silent(name: str) -> Iterator[None]:
    """Keep a library from logging: it writes tracebacks of what it then puts up with."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


def _flatten(scene: Any) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and triangles of all meshes of a scene, each placed by its node."""
    vertices: list[Array] = [np.empty((0, 3))]
    faces: list[NDArray[np.int64]] = [np.empty((0, 3), dtype=np.int64)]
    count = 0
    for node in sorted(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        placed = np.asarray(mesh.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        triangles = np.asarray(mesh.faces, dtype=np.int64)
        mirrored = np.linalg.det(transform[:3, :3]) < 0
        faces.append((triangles[:, ::-1] if mirrored else triangles) + count)
        vertices.append(placed)
        count += len(placed)
    return np.concatenate(vertices), np.concatenate(faces)


def _points(scene: Any) -> tuple[Array, Array | None]:
    """Return the points of a PLY cloud and their normals, where the file has them."""
    for geometry in scene.geometry.values():
        points = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
        columns = geometry.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
        try:
            normals = np.column_stack([np.ravel(columns[name]) for name in ("nx", "ny", "nz")])
        except (KeyError, TypeError, ValueError):  # no such columns, or of other lengths
            return points, None
        return points, normals.astype(np.float64) if len(normals) == len(points) else None
    return np.empty((0, 3)), None


def _read_pcd(path: Path, content: bytes) -> tuple[Array, None, Array | None]:
    # Open3D reserves what the header claims; a damaged header must not take all memory.
    claimed = _CLAIMED_POINTS.search(content[:_HEADER_LENGTH])
    if claimed is None or int(claimed.group(1)) > _MOST_POINTS_PER_BYTE * len(content):
        raise ObjectError(path, "its header does not say how many points follow", "Export the cloud again.")
    open3d = load_open3d()
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        try:
            cloud = open3d.io.read_point_cloud(
                str(path), remove_nan_points=False, remove_infinite_points=False
            )
        except (RuntimeError, MemoryError) as error:
            raise ObjectError(path, f"not readable as a cloud ({error})", "Export it again.") from error
    points = np.asarray(cloud.points, dtype=np.float64).copy()
    _check_points(path, points)
    normals = np.asarray(cloud.normals, dtype=np.float64).copy() if cloud.has_normals() else None
    return points, None, normals
