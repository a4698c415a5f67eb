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


def box_volume(space: EnclosingSpace) -> float:
    """Return the volume of the least box around the hull with one side flush with a face [m3].

    For each face's direction the least rectangle around the hull's shadow is found over the shadow's own
    edges, which are those between a face that looks towards the light and one that looks away. The least
    box of all need not be flush with a face; this one is at most a little larger. (trimesh's, from a
    coarser set of directions, comes out up to 2 % larger than this.)
    """
    if not len(space.faces):
        return 0.0
    normals = space.planes[:, :3]
    edges, sides = _edges(space.faces)
    directions = np.unique(np.round(normals, 6), axis=0)
    heights = np.ptp(space.vertices @ directions.T, axis=0)
    # No box is smaller than the prism over the shadow: begin with the least, and stop where it is no less.
    prisms = heights * (np.abs(directions @ normals.T) @ _triangle_areas(space)) / 2
    least = np.inf
    for i in np.argsort(prisms):
        normal = directions[i]
        if prisms[i] >= least * (1 + 1e-6):
            break
        facing = normals[sides] @ normal
        outline = facing[:, 0] * facing[:, 1] <= 1e-9
        ends = space.vertices[edges[outline]]
        along = ends[:, 1] - ends[:, 0]
        along = along - np.outer(along @ normal, normal)
        lengths = np.linalg.norm(along, axis=1, keepdims=True)
        along = along[lengths[:, 0] > 1e-9] / lengths[lengths[:, 0] > 1e-9]
        spans = np.ptp(space.vertices @ np.concatenate([along, np.cross(normal, along)]).T, axis=0)
        rectangle = np.min(spans[: len(along)] * spans[len(along) :])
        least = min(least, float(heights[i] * rectangle))
    return least


def ellipsoid_volume(space: EnclosingSpace, tolerance: float = 1e-3) -> float:
    """Return the volume of the least ellipsoid around the hull, to a thousandth [m3].

    Khachiyan's algorithm with away steps (Todd and Yildirim 2007): weights move to the furthest
    point, or away from the nearest that has any, until all are equally far to `tolerance`. Each step
    changes the moments by one point, and their inverse by the formula of Sherman and Morrison.
    """
    points = space.vertices
    if not len(points):
        return 0.0
    scale = float(np.ptp(points))
    centred = (points - points.mean(axis=0)) / scale
    n, m = len(points), 4
    lifted = np.column_stack([centred, np.ones(n)])
    weights = np.full(n, 1 / n)
    for number in range(5000):
        if number % 100 == 0:  # anew, before rounding adds up
            inverse = np.linalg.inv(lifted.T * weights @ lifted)
            distances = np.einsum("ij,ij->i", lifted @ inverse, lifted)
        furthest = int(distances.argmax())
        nearest = int(np.where(weights > 0, distances, np.inf).argmin())
        beyond, within = distances[furthest] - m, m - distances[nearest]
        if max(beyond, within) <= tolerance * m:
            break
        chosen = furthest if beyond > within else nearest
        distance = distances[chosen]
        step = (distance - m) / (m * (distance - 1)) if distance > 1 else -1.0
        step = max(step, -weights[chosen] / (1 - weights[chosen]))
        towards = inverse @ lifted[chosen]
        shared = step / (1 - step + step * distance)
        inverse = (inverse - shared * np.outer(towards, towards)) / (1 - step)
        distances = (distances - shared * (lifted @ towards) ** 2) / (1 - step)
        weights *= 1 - step
        weights[chosen] = max(0.0, weights[chosen] + step)
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


def _triangle_areas(space: EnclosingSpace) -> Floats:
    a, b, c = (space.vertices[space.faces[:, i]] for i in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the ends of each edge of a closed surface, and the two faces beside it, both of shape (e, 2)."""
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(ends.T)
    return ends[order[::2]], order.reshape(-1, 2) // 3


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
