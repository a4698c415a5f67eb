"""Hand enclosing space: the paper's section II.D.

The convex hull of the touching spheres, each as 64 vertices.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from graspdb_ingest.hand.model import Bools, Floats

INSIDE_TOLERANCE: Final = 1e-9
"""Distance beyond a face of the hull at which a point still counts as inside [m]."""
GOLDEN_ANGLE: Final = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class EnclosingSpace:
    """The convex hull of the touching spheres.

    Attributes
    ----------
    vertices : ndarray, shape (v, 3)
        Corners of the hull [m]; none where nothing touches.
    faces : ndarray of int, shape (f, 3)
        Triangles, counter-clockwise seen from outside.
    planes : ndarray, shape (f, 4)
        Outward unit normal and offset of each face: inside is where ``n . x + d <= 0``.
    volume : float
        Enclosed volume [m3].
    """

    vertices: Floats
    faces: NDArray[np.int64]
    planes: Floats
    volume: float

    def contains(self, points: Floats) -> Bools:
        """Return which points lie inside or on the hull, shape (n,) for points (n, 3).

        An empty space contains nothing.
        """
        if not len(self.planes):
            return np.zeros(len(points), dtype=bool)
        inside = np.zeros(len(points), dtype=bool)
        inside[self._left(points)] = True
        return inside

    def _left(self, points: Floats) -> NDArray[np.int64]:
        """Return the points that no side of the bounding box and no face leaves out."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        left = np.arange(len(points))
        for axis in range(3):
            along = points[left, axis]
            reach = (along >= low[axis] - INSIDE_TOLERANCE) & (along <= high[axis] + INSIDE_TOLERANCE)
            left = left[reach]
        # A few faces of all directions leave out most of what is outside; the rest is compared with all.
        n = len(self.planes)
        for planes in (self.planes[:: max(1, n // 12)], self.planes[1 :: max(1, n // 48)], self.planes):
            beyond = points[left] @ planes[:, :3].T
            beyond += planes[:, 3]
            left = left[beyond.max(axis=1, initial=-np.inf) <= INSIDE_TOLERANCE]
        return left


def sphere_vertices(count: int) -> Floats:
    """Return unit vectors spread evenly over the sphere, on a golden spiral, shape (count, 3)."""
    height = 1 - (2 * np.arange(count) + 1) / count
    across = np.sqrt(1 - height**2)
    angle = GOLDEN_ANGLE * np.arange(count)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])


def sphere_cloud(centres: Floats, radii: Floats, count: int) -> Floats:
    """Return the vertices that stand for the spheres, shape (k * count, 3)."""
    points = centres[:, None] + radii[:, None, None] * sphere_vertices(count)
    return np.asarray(points.reshape(-1, 3))


def enclosing_space(centres: Floats, radii: Floats, count: int) -> EnclosingSpace:
    """Return the hull of the touching spheres.

    One sphere gives itself, two their common hull: a sphere has a volume, so no arrangement of
    centres, on a line or in a plane, is degenerate. No sphere, or spheres without a radius that
    span no volume, give an empty space of volume zero.

    Parameters
    ----------
    centres : ndarray, shape (k, 3)
        Centres of the touching spheres [m].
    radii : ndarray, shape (k,)
        Their radii [m].
    count : int
        Vertices for each sphere; the paper has 64.
    """
    points = sphere_cloud(centres, radii, count)
    if not _spans_a_volume(points):
        return EnclosingSpace(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), np.empty((0, 4)), 0.0)
    hull = ConvexHull(points)
    corners = np.sort(hull.vertices)
    faces = np.searchsorted(corners, hull.simplices)
    vertices = points[corners]
    planes = np.asarray(hull.equations)
    return EnclosingSpace(vertices, _outward(faces, vertices, planes), planes, float(hull.volume))


def _spans_a_volume(points: Floats) -> bool:
    if len(points) < 4:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[-1] > 1e-9 * max(spread[0], 1e-3))


def _outward(faces: NDArray[np.int64], vertices: Floats, planes: Floats) -> NDArray[np.int64]:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.sum(np.cross(b - a, c - a) * planes[:, :3], axis=1) < 0
    turned = faces.copy()
    turned[inward] = turned[inward][:, ::-1]
    return turned
