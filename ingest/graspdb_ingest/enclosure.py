"""Hand enclosing space: the paper's section II.D.

The convex hull of the touching spheres, each as 64 vertices. The bounding bodies that the paper
tried before it chose the hull are here for comparison: box, ellipsoid and sphere.
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
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = np.all((points >= low - INSIDE_TOLERANCE) & (points <= high + INSIDE_TOLERANCE), axis=1)
        # A few faces leave out most of what is outside; only the rest need be compared with all of them.
        for start, stop in ((0, 12), (12, 60), (60, len(self.planes))):
            planes = self.planes[start:stop]
            beyond = points[inside] @ planes[:, :3].T + planes[:, 3]
            inside[inside] = np.all(beyond <= INSIDE_TOLERANCE, axis=1)
        return np.asarray(inside)


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


def box_volume(space: EnclosingSpace) -> float:
    """Return the volume of the least box around the hull with one side flush with a face [m3].

    For each face's direction the least rectangle of the hull's shadow is found over the shadow's
    own edges. The least box of all need not be flush with a face; this one is at most a little
    larger. (trimesh's, from a coarser set of directions, comes out up to 2 % larger than this.)
    """
    least = np.inf
    normals = np.unique(np.round(space.planes[:, :3], 6), axis=0)
    for normal in normals:
        across, along = _plane_axes(normal)
        height = np.ptp(space.vertices @ normal)
        shadow = space.vertices @ np.column_stack([across, along])
        least = min(least, height * _least_rectangle(shadow))
    return float(least) if len(normals) else 0.0


def ellipsoid_volume(space: EnclosingSpace, tolerance: float = 1e-4) -> float:
    """Return the volume of the least ellipsoid around the hull [m3].

    Khachiyan's algorithm with away steps (Todd and Yildirim 2007): weights move to the furthest
    point, or away from the nearest that has any, until all are equally far to `tolerance`.
    """
    points = space.vertices
    if not len(points):
        return 0.0
    scale = float(np.ptp(points))
    centred = (points - points.mean(axis=0)) / scale
    n, m = len(points), 4
    lifted = np.column_stack([centred, np.ones(n)])
    weights = np.full(n, 1 / n)
    for _ in range(5000):
        moments = lifted.T * weights @ lifted
        distances = np.einsum("ij,ij->i", lifted @ np.linalg.inv(moments), lifted)
        furthest = int(np.argmax(distances))
        nearest = int(np.argmin(np.where(weights > 0, distances, np.inf)))
        if max(distances[furthest] - m, m - distances[nearest]) <= tolerance * m:
            break
        chosen = furthest if distances[furthest] - m > m - distances[nearest] else nearest
        step = (distances[chosen] - m) / (m * (distances[chosen] - 1)) if distances[chosen] > 1 else -1.0
        step = max(step, -weights[chosen] / (1 - weights[chosen]))
        weights *= 1 - step
        weights[chosen] += step
    centre = weights @ centred
    spread = centred.T * weights @ centred - np.outer(centre, centre)
    return float(4 / 3 * np.pi * np.sqrt(np.linalg.det((m - 1) * spread)) * scale**3)


def sphere_volume(space: EnclosingSpace) -> float:
    """Return the volume of the least sphere around the hull [m3], exact by its support of up to four points.

    trimesh has one, too, which is not always the least (up to 0.6 % larger on hulls of fingers).
    """
    points = space.vertices
    if not len(points):
        return 0.0
    return float(4 / 3 * np.pi * _least_ball(points)[1] ** 1.5)


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


def _plane_axes(normal: Floats) -> tuple[Floats, Floats]:
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    across = np.cross(normal, helper)
    across /= np.linalg.norm(across)
    return across, np.cross(normal, across)


def _least_rectangle(shadow: Floats) -> float:
    """Return the area of the least rectangle around points of a plane, flush with an edge of their hull."""
    corners = shadow[ConvexHull(shadow).vertices]
    edges = np.roll(corners, -1, axis=0) - corners
    angle = np.arctan2(edges[:, 1], edges[:, 0])
    along = corners @ np.array([np.cos(angle), np.sin(angle)])
    across = corners @ np.array([-np.sin(angle), np.cos(angle)])
    return float(np.min(np.ptp(along, axis=0) * np.ptp(across, axis=0)))


def _least_ball(points: Floats) -> tuple[Floats, float]:
    """Return centre and squared radius of the least ball, adding the furthest point until none is out."""
    support = [0]
    centre, squared = points[0], 0.0
    for _ in range(1000):
        distances = np.sum((points - centre) ** 2, axis=1)
        furthest = int(np.argmax(distances))
        if distances[furthest] <= squared * (1 + 1e-10) + 1e-18:
            break
        support = _best_support(points, [*support, furthest])
        centre, squared = _ball_through(points[support])
    return centre, squared


def _best_support(points: Floats, candidates: list[int]) -> list[int]:
    """Return the candidates whose circumscribed ball is the least that holds all candidates."""
    best, least = candidates, np.inf
    for pattern in range(1, 2 ** len(candidates)):
        chosen = [c for i, c in enumerate(candidates) if pattern >> i & 1]
        if len(chosen) > 4:
            continue
        centre, squared = _ball_through(points[chosen])
        furthest = np.max(np.sum((points[candidates] - centre) ** 2, axis=1))
        if furthest <= squared * (1 + 1e-9) + 1e-18 and squared < least:
            best, least = chosen, squared
    return best


def _ball_through(points: Floats) -> tuple[Floats, float]:
    """Return centre and squared radius of the least ball with one to four points on its surface."""
    edges = points[1:] - points[0]
    gram = edges @ edges.T
    shares = np.linalg.lstsq(gram, np.diagonal(gram) / 2, rcond=None)[0] if len(edges) else np.empty(0)
    arm = shares @ edges if len(edges) else np.zeros(3)
    return points[0] + arm, float(arm @ arm)
