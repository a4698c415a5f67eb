"""Distance to an object: exact to its mesh where there is one, else to the nearest point of its cloud."""

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any, Final

import numpy as np

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.triangles import RAYS, TriangleTree, inside, nearest_points, triangle_tree
from graspdb_ingest.rigid import Array

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
        """Return distance, nearest point and normal for finite points, shape (..., n, 3), object frame.

        Points of one path, frame by frame, are found sooner if their frames are the axis before n.
        """
        if not self.exact:
            distance, index = self.cloud.tree.query(points)
            return Nearest(np.asarray(distance), self.cloud.points[index], self.cloud.normals[index])
        # Frames one after the other, so that the search for one begins where that of the last one ended.
        steps = np.ascontiguousarray(points.reshape(prod(points.shape[:-2]), *points.shape[-2:]))
        positions, triangles = nearest_points(self._triangles, steps)
        arms, faces = steps - positions, self._face_normals[triangles]
        distance = np.linalg.norm(arms, axis=-1)
        sign = np.ones(distance.shape)
        if self.surface.watertight:
            sign[inside(self._triangles, steps, distance, RAYS)] = -1.0
        away = distance[..., None] > TOUCHING
        normals = np.where(away, sign[..., None] * arms / np.where(away, distance[..., None], 1.0), faces)
        if not self.surface.watertight:
            # A sheet has two sides; its normal says which is out, the point asked for does not.
            normals *= np.where(np.sum(normals * faces, axis=-1, keepdims=True) < 0, -1.0, 1.0)
        signed = (sign * distance).reshape(points.shape[:-1])
        return Nearest(signed, positions.reshape(points.shape), normals.reshape(points.shape))

    @cached_property
    def _triangles(self) -> TriangleTree:
        return triangle_tree(self.surface.vertices, np.asarray(self.surface.faces))

    @cached_property
    def _face_normals(self) -> Array:
        """The unit normals of the tree's triangles; zero for one without an area."""
        a, b, c = (self._triangles.corners[:, i] for i in range(3))
        normals = np.cross(b - a, c - a)
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the tree, which is built anew where it is needed in less time than it takes to load."""
        return {"surface": self.surface, "cloud": self.cloud}
