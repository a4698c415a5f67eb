"""The solid that a closed mesh bounds, and how much of it lies inside a convex hull, exactly."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import manifold3d
import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.mesh import Surface


@dataclass(frozen=True)
class Inside:
    """What of an object lies inside a hull.

    Attributes
    ----------
    volume : float
        Volume [m3].
    area : float
        Area of the object's own surface there [m2].
    """

    volume: float
    area: float


@dataclass(frozen=True, eq=False)
class Solid:
    """The body inside a closed mesh.

    Attributes
    ----------
    surface : Surface
        The mesh; one that is not watertight bounds no body.
    """

    surface: Surface

    def __getstate__(self) -> dict[str, Any]:
        return {"surface": self.surface}

    @cached_property
    def _body(self) -> manifold3d.Manifold | None:
        """The body as Manifold has it, or None if the mesh bounds none."""
        if not self.surface.watertight or self.surface.faces is None:
            return None
        body = _manifold(self.surface.vertices, self.surface.faces)
        if body.status() != manifold3d.Error.NoError:
            return None
        parts = body.decompose()
        # Parts that run into each other are one body; a part turned inside out is the wall of a hollow.
        if len(parts) > 1 and all(part.volume() > 0 for part in parts):
            body = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add)
        return body.as_original()

    def inside(self, vertices: Floats, faces: NDArray[np.int64]) -> Inside | None:
        """Return how much of the body lies inside a convex hull; None if the mesh bounds no body.

        Parameters
        ----------
        vertices : ndarray, shape (v, 3)
            Corners of the hull [m]; none for an empty one.
        faces : ndarray of int, shape (f, 3)
            Its triangles, outward.
        """
        if self._body is None:
            return None
        if not len(faces):
            return Inside(0.0, 0.0)
        common = self._body ^ _manifold(vertices, faces)
        if common.is_empty():
            return Inside(0.0, 0.0)
        return Inside(max(0.0, float(common.volume())), _area_from(common, self._body.original_id()))


def _manifold(vertices: Floats, faces: NDArray[np.int64]) -> manifold3d.Manifold:
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(vertices, dtype=np.float64), np.ascontiguousarray(faces, dtype=np.uint64)
    )
    return manifold3d.Manifold(mesh)


def _area_from(body: manifold3d.Manifold, original: int) -> float:
    """Return the area of those faces of a body that come from one of the bodies it was made of [m2]."""
    mesh = body.to_mesh64()
    bounds = np.asarray(mesh.run_index, dtype=np.int64) // 3
    total = 0.0
    for start, stop, source in zip(bounds[:-1], bounds[1:], mesh.run_original_id, strict=True):
        if source == original:
            a, b, c = (mesh.vert_properties[mesh.tri_verts[start:stop, i], :3] for i in range(3))
            total += float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    return total
