"""The files of objects in an export: each object's surface once, whatever the number of its grasps."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final

import numpy as np

from graspdb.export.closed_surface import ClosedSurface, closed_surface
from graspdb.export.held import Cloud, HeldObject
from graspdb.export.obj import ObjPart, write_obj
from graspdb.export.ply import point_properties, write_ply

MESH_FACES: Final = 20_000
"""Triangles of a mesh, at most."""


def object_name(held: HeldObject) -> str:
    """Return a file name for an object: its own, as far as it is plain, and what tells clouds apart."""
    plain = "".join(sign if sign.isalnum() or sign in "-_" else "_" for sign in held.grasp.object)
    return f"{plain}-{sha256(held.cloud.key.encode()).hexdigest()[:8]}"


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """A file with an object's closed surface.

    Attributes
    ----------
    path : Path
        The file.
    surface : ClosedSurface
        What it holds.
    """

    path: Path
    surface: ClosedSurface


class Surfaces:
    """Closed surfaces of clouds, each made once."""

    def __init__(self) -> None:
        self._made: dict[str, ClosedSurface | None] = {}

    def of(self, cloud: Cloud) -> ClosedSurface | None:
        """Return the surface through a cloud; None where it is too small for one."""
        if cloud.key not in self._made:
            made = closed_surface(cloud.points, cloud.normals, cloud.spacing, MESH_FACES)
            self._made[cloud.key] = made
        return self._made[cloud.key]


class ObjectMeshes:
    """Closed surfaces of objects, each made and written once.

    Parameters
    ----------
    folder : Path
        Folder of the export; meshes lie in its folder ``objects``.
    ending : {'.ply', '.obj'}
        Their format.
    """

    def __init__(self, folder: Path, ending: str) -> None:
        self._folder = folder / "objects"
        self._ending = ending
        self._surfaces = Surfaces()
        self._made: dict[str, ObjectMesh | None] = {}

    def of(self, held: HeldObject) -> ObjectMesh | None:
        """Return the mesh of a grasp's object; None where its cloud is too small for a surface."""
        key = held.cloud.key
        if key not in self._made:
            self._made[key] = self._make(held.cloud, object_name(held))
        return self._made[key]

    def _make(self, cloud: Cloud, name: str) -> ObjectMesh | None:
        surface = self._surfaces.of(cloud)
        if surface is None:
            return None
        self._folder.mkdir(exist_ok=True)
        path = self._folder / f"{name}{self._ending}"
        if self._ending == ".obj":
            part = ObjPart("object", surface.vertices.astype(np.float32), faces=surface.faces)
            write_obj(path, f"{name}: closed surface, object frame, metres", [part])
        else:
            write_ply(path, point_properties(surface.vertices), surface.faces)
        return ObjectMesh(path, surface)
