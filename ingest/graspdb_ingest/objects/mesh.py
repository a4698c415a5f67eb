"""An object's surface as graspdb uses it: checked, mended where that is safe, in metres."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.objects.files import Geometry, read_geometry
from graspdb_ingest.objects.repair import mend, stray_pieces
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ObjectError, ParameterError

SMALLEST_OBJECT: Final = 0.002
LARGEST_OBJECT: Final = 3.0
"""Largest extents [m] between which a thing can be grasped with a hand; outside, the unit is wrong."""

_PLAUSIBLE: Final = (0.01, 0.5)
_UNITS: Final = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of an object, as a mesh or as a bare cloud.

    Attributes
    ----------
    vertices : ndarray, shape (v, 3)
        Vertices, or the points of a cloud, in the object frame [m].
    faces : ndarray of int, shape (f, 3), or None
        Triangles, counter-clockwise seen from outside; None for a cloud.
    normals : ndarray, shape (v, 3), or None
        Unit normals of a cloud's points, where its file has them; None for a mesh.
    area : float or None
        Area [m2]; None for a cloud, whose area its sampling estimates.
    volume : float or None
        Enclosed volume [m3]; None unless watertight.
    extents : ndarray, shape (3,)
        Size along the axes of the object frame [m].
    watertight : bool
        Whether the mesh is closed and its faces agree which side is out.
    sha256 : str
        Of the file it was read from.
    warnings : tuple of str
        What was found wrong and put up with.
    """

    vertices: Array
    faces: NDArray[np.int64] | None
    normals: Array | None
    area: float | None
    volume: float | None
    extents: Array
    watertight: bool
    sha256: str
    warnings: tuple[str, ...]


def load_surface(path: Path, scale: float = 1.0, unit_key: str = "mesh_units", whole: bool = True) -> Surface:
    """Read an object's mesh (STL, OBJ, PLY, GLB, OFF) or cloud (PLY, PCD), check it and mend what is safe.

    Parameters
    ----------
    path : Path
        The file.
    scale : float
        Factor from the file's numbers to metres.
    unit_key : str
        Key of the manifest that the factor comes from, for messages.
    whole : bool
        Whether the file holds all of an object, which says which side of a surface that is not closed is
        out. Of a part the sides are those of the file.

    Returns
    -------
    Surface
        The surface in metres, with a warning for everything that was found wrong and put up with.

    Raises
    ------
    ObjectError
        If the file cannot be read, or cannot be the surface of an object: no faces, positions that are
        not numbers, no area, or a size that says that the unit is wrong.
    ParameterError
        If the scale is not a positive number.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise ParameterError("scale", scale, "a positive factor from the file's numbers to metres")
    return surface_of(path, read_geometry(path), scale, unit_key, whole)


def surface_of(
    path: Path,
    geometry: Geometry,
    scale: float = 1.0,
    unit_key: str = "mesh_units",
    whole: bool = True,
) -> Surface:
    """Check the vertices and faces that a file holds and mend what is safe; see `load_surface`.

    Raises
    ------
    ObjectError
        If they cannot be the surface of an object.
    """
    if geometry.faces is None:
        return _cloud_surface(path, geometry, scale, unit_key, whole)
    return _mesh_surface(path, geometry, geometry.faces, scale, unit_key, whole)


def _mesh_surface(
    path: Path, geometry: Geometry, faces: NDArray[np.int64], scale: float, unit_key: str, whole: bool
) -> Surface:
    used = np.unique(faces)
    broken = int(np.count_nonzero(~np.isfinite(geometry.vertices[used]).all(axis=1)))
    if broken:
        raise ObjectError(
            path, f"{broken} of its {len(used)} vertices are not finite", "Export the mesh again."
        )
    _check_size(path, np.ptp(geometry.vertices[used], axis=0), scale, unit_key)
    vertices = np.where(np.isfinite(geometry.vertices), geometry.vertices, 0.0) * scale
    mended = mend(vertices, faces, whole)
    mesh, warnings = mended.mesh, list(mended.warnings)
    if not len(mesh.faces) or mesh.area <= 0:
        raise ObjectError(path, "its faces have no area", "Export a surface, not lines or single points.")
    watertight = bool(mesh.is_watertight and mesh.is_winding_consistent)
    if not watertight:
        warnings.append("not watertight: no volume")
    warnings += stray_pieces(mesh)
    return Surface(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces, dtype=np.int64),
        normals=None,
        area=float(mesh.area),
        volume=float(mesh.volume) if watertight else None,
        extents=np.ptp(mesh.vertices, axis=0),
        watertight=watertight,
        sha256=geometry.sha256,
        warnings=tuple(warnings),
    )


def _cloud_surface(path: Path, geometry: Geometry, scale: float, unit_key: str, whole: bool) -> Surface:
    finite = np.asarray(np.isfinite(geometry.vertices).all(axis=1))
    points = geometry.vertices[finite] * scale
    if len(points) < 4:
        raise ObjectError(path, f"{len(points)} finite points", "A cloud needs more points to be a surface.")
    warnings = ["a cloud without faces: area estimated, no volume"]
    if not finite.all():
        warnings.append(f"{int(np.count_nonzero(~finite))} of {len(finite)} points not finite; left out")
    normals = None if geometry.normals is None else geometry.normals[finite]
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(normals).all() and (lengths > 0).all():
            normals = normals / lengths
            arms = points - points.mean(axis=0)
            flow = np.einsum("ni,ni->", normals, arms)
            # As for an open mesh: only a clear majority says which side is out.
            if whole and flow < -0.1 * np.linalg.norm(arms, axis=1).sum():
                normals = -normals
                warnings.append("all normals inside out: turned outward")
        else:
            normals = None
            warnings.append("some normals of the file are no directions; all are estimated")
    extents = np.ptp(points, axis=0)
    _check_size(path, extents / scale, scale, unit_key)
    return Surface(points, None, normals, None, None, extents, False, geometry.sha256, tuple(warnings))


def _check_size(path: Path, size: Array, scale: float, unit_key: str) -> None:
    """Raise ObjectError if the largest extent, in the file's numbers, cannot be that of an object."""
    largest = float(size.max()) * scale
    if SMALLEST_OBJECT <= largest <= LARGEST_OBJECT:
        return
    low, high = _PLAUSIBLE
    fitting = [
        f"{unit} ({size.max() * factor:.3g} m)"
        for unit, factor in _UNITS.items()
        if low <= size.max() * factor <= high
    ]
    remedy = (
        f"With {unit_key} {' or '.join(fitting)} it would fit a hand." if fitting else f"Check {unit_key}."
    )
    found = f"its largest extent is {largest:.4g} m; objects have {SMALLEST_OBJECT} to {LARGEST_OBJECT:.0f} m"
    raise ObjectError(path, found, remedy)
