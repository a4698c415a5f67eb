"""Distance to an object: exact to its mesh where there is one, else to the nearest point of its cloud."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.rigid import Array

RAYS: Final = 3
"""Rays that vote whether a point is inside; one alone may meet an edge."""
WORTH_THREADS: Final = 2000
"""Points fewer than this are asked in one thread."""
TOUCHING: Final = 1e-6
"""Distance below which the direction from the surface to a point is that of the face [m]."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """What of an object is nearest to some points.

    Attributes
    ----------
    distance : ndarray, shape (...)
        Distance [m], negative inside a watertight mesh.
    positions : ndarray, shape (..., 3)
        Nearest points of the surface [m].
    normals : ndarray, shape (..., 3)
        Outward unit normals there. On an edge or corner of a mesh, where faces disagree, the one
        that leads to the point asked for.
    """

    distance: Array
    positions: Array
    normals: Array


@dataclass(frozen=True, eq=False)
class ObjectDistance:
    """An object that can be asked how far it is.

    Attributes
    ----------
    surface : Surface
        Mesh or cloud as loaded.
    cloud : ObjectCloud
        Its evenly spaced points; they are the surface where there is no mesh.
    """

    surface: Surface
    cloud: ObjectCloud

    @property
    def exact(self) -> bool:
        """Whether distances are those to a mesh."""
        return self.surface.faces is not None

    def nearest(self, points: Array) -> Nearest:
        """Return distance, nearest point and normal for finite points, shape (..., 3), object frame."""
        if not self.exact:
            distance, index = self.cloud.tree.query(points)
            return Nearest(np.asarray(distance), self.cloud.points[index], self.cloud.normals[index])
        found = self._scene.compute_closest_points(_tensor(points), nthreads=_threads(points))
        positions = found["points"].numpy().astype(np.float64)
        faces = found["primitive_normals"].numpy().astype(np.float64)
        arms = points - positions
        distance = np.linalg.norm(arms, axis=-1)
        sign = np.where(self.inside(points), -1.0, 1.0)
        away = distance[..., None] > TOUCHING
        normals = np.where(away, sign[..., None] * arms / np.where(away, distance[..., None], 1.0), faces)
        if not self.surface.watertight:
            # A sheet has two sides; its normal says which is out, the point asked for does not.
            normals *= np.where(np.sum(normals * faces, axis=-1, keepdims=True) < 0, -1.0, 1.0)
        return Nearest(sign * distance, positions, normals)

    def inside(self, points: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return which points lie in a watertight mesh, shape (...); in anything else none does."""
        inside = np.zeros(points.shape[:-1], dtype=bool)
        if not self.surface.watertight:
            return inside
        low, high = self.surface.vertices.min(axis=0), self.surface.vertices.max(axis=0)
        within = np.all((points > low) & (points < high), axis=-1)
        if within.any():
            asked = points[within]
            occupied = self._scene.compute_occupancy(_tensor(asked), nthreads=_threads(asked), nsamples=RAYS)
            inside[within] = occupied.numpy() > 0
        return inside

    @cached_property
    def _scene(self) -> Any:
        open3d = load_open3d()
        scene = open3d.t.geometry.RaycastingScene()
        faces = np.asarray(self.surface.faces, dtype=np.uint32)
        scene.add_triangles(_tensor(self.surface.vertices), open3d.core.Tensor(faces))
        return scene

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the ray caster, which is built anew where it is needed."""
        return {"surface": self.surface, "cloud": self.cloud}


def _threads(points: Array) -> int:
    """Return how many threads are worth their start: one for few points, else as many as there are cores."""
    return 1 if points.size < 3 * WORTH_THREADS else 0


def _tensor(values: Array) -> Any:
    return load_open3d().core.Tensor(np.ascontiguousarray(values, dtype=np.float32))
