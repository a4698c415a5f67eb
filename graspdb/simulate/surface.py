"""Signed distance to an object's surface, by ray casting against its triangles."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
import trimesh
from numpy.typing import NDArray

from graspdb.simulate.arrays import Floats


@dataclass(frozen=True)
class Nearest:
    """What of a surface is nearest to some points.

    Attributes
    ----------
    distance : ndarray, shape (...)
        Distance [m], negative inside.
    point : ndarray, shape (..., 3)
        Nearest point of the surface [m].
    normal : ndarray, shape (..., 3)
        Direction in which the distance grows: from the nearest point to the query outside, the
        other way inside, the triangle's normal on the surface itself.
    """

    distance: Floats
    point: Floats
    normal: Floats


class Surface:
    """The outer surface of a body made of closed parts, which may run into each other.

    The distance to the body is the least of the distances to its parts: exact outside.

    Parameters
    ----------
    parts : tuple of trimesh.Trimesh
        Watertight parts [m].
    """

    def __init__(self, parts: tuple[trimesh.Trimesh, ...]) -> None:
        self._scenes = [_scene(part) for part in parts]

    def distance(self, points: Floats) -> Floats:
        """Return the signed distance of points, shape (..., 3), to the surface [m], shape (...)."""
        queries = _tensor(points, o3d.core.float32)
        each = [scene.compute_signed_distance(queries).numpy() for scene in self._scenes]
        return np.asarray(np.min(each, axis=0), dtype=float)

    def nearest(self, points: Floats) -> Nearest:
        """Return distance, nearest point and direction for points of shape (..., 3)."""
        queries = _tensor(points, o3d.core.float32)
        distance = np.full(points.shape[:-1], np.inf)
        point = np.zeros(points.shape)
        face_normal = np.zeros(points.shape)
        for scene in self._scenes:
            signed = scene.compute_signed_distance(queries).numpy()
            closest = scene.compute_closest_points(queries)
            nearer = signed < distance
            distance[nearer] = signed[nearer]
            point[nearer] = closest["points"].numpy()[nearer]
            face_normal[nearer] = closest["primitive_normals"].numpy()[nearer]
        away = points - point
        length = np.linalg.norm(away, axis=-1, keepdims=True)
        normal = np.where(
            length > 1e-6, np.sign(distance)[..., None] * away / np.maximum(length, 1e-9), face_normal
        )
        return Nearest(distance, point, normal)


def _tensor(values: NDArray[Any], dtype: o3d.core.Dtype) -> o3d.core.Tensor:
    return o3d.core.Tensor(np.ascontiguousarray(values), dtype, o3d.core.Device("CPU:0"))


def _scene(part: trimesh.Trimesh) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        _tensor(np.asarray(part.vertices), o3d.core.float32),
        _tensor(np.asarray(part.faces), o3d.core.uint32),
    )
    return scene
