"""Bounding bodies of a hand enclosing space: box, ellipsoid and sphere.

The paper tried them before it chose the hull (section II.D); they are here for comparison.
"""

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.enclosure import EnclosingSpace
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.vectors import Three, cross, dot, minus, stepped


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
    return _least_box(space.vertices, normals, edges, sides, directions, heights, prisms, np.argsort(prisms))


@compiled
def _least_box(
    vertices: Floats,
    normals: Floats,
    edges: NDArray[np.int64],
    sides: NDArray[np.int64],
    directions: Floats,
    heights: Floats,
    prisms: Floats,
    order: NDArray[np.int64],
) -> float:
    """Return the volume of the least box over the shadows in some directions."""
    least = np.inf
    for i in order:
        if prisms[i] >= least * (1 + 1e-6):
            break
        normal = directions[i]
        outline = np.empty(len(edges), np.int64)
        found = 0
        for j in range(len(edges)):
            if dot(normals[sides[j, 0]], normal) * dot(normals[sides[j, 1]], normal) <= 1e-9:
                outline[found] = j
                found += 1
        for j in outline[:found]:
            arm = minus(vertices[edges[j, 1]], vertices[edges[j, 0]])
            along = stepped(arm, normal, -dot(arm, normal))
            length = np.sqrt(dot(along, along))
            if length > 1e-9:
                along = (along[0] / length, along[1] / length, along[2] / length)
                ends = vertices, edges, outline[:found]
                rectangle = _span(*ends, along) * _span(*ends, cross(normal, along))
                least = min(least, heights[i] * rectangle)
    return least


@compiled
def _span(vertices: Floats, edges: NDArray[np.int64], some: NDArray[np.int64], direction: Three) -> float:
    """Return how far the ends of some edges reach in a direction."""
    low, high = np.inf, -np.inf
    for j in some:
        for end in range(2):
            place = dot(vertices[edges[j, end]], direction)
            low, high = min(low, place), max(high, place)
    return high - low


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
    for _ in range(50):
        inverse = np.linalg.inv(lifted.T * weights @ lifted)  # anew, before rounding adds up
        if _move_weights(weights, lifted, inverse, tolerance):
            break
    centre = weights @ centred
    spread = centred.T * weights @ centred - np.outer(centre, centre)
    return float(4 / 3 * np.pi * np.sqrt(np.linalg.det((m - 1) * spread)) * scale**3)


@compiled
def _move_weights(weights: Floats, lifted: Floats, inverse: Floats, tolerance: float) -> bool:
    """Take a hundred steps towards the least ellipsoid, and return whether it was reached."""
    n, m = lifted.shape
    distances, towards = np.empty(n), np.empty(m)
    for i in range(n):
        distances[i] = _form(inverse, lifted[i])
    for _ in range(100):
        furthest, nearest = 0, -1
        for i in range(n):
            if distances[i] > distances[furthest]:
                furthest = i
            if weights[i] > 0 and (nearest < 0 or distances[i] < distances[nearest]):
                nearest = i
        beyond, within = distances[furthest] - m, m - distances[nearest]
        if max(beyond, within) <= tolerance * m:
            return True
        chosen = furthest if beyond > within else nearest
        distance = distances[chosen]
        step = (distance - m) / (m * (distance - 1)) if distance > 1 else -1.0
        step = max(step, -weights[chosen] / (1 - weights[chosen]))
        for a in range(m):
            towards[a] = _dot_four(inverse[a], lifted[chosen])
        shared = step / (1 - step + step * distance)
        for i in range(n):
            distances[i] = (distances[i] - shared * _dot_four(lifted[i], towards) ** 2) / (1 - step)
            weights[i] *= 1 - step
        for a in range(m):
            for b in range(m):
                inverse[a, b] = (inverse[a, b] - shared * towards[a] * towards[b]) / (1 - step)
        weights[chosen] = max(0.0, weights[chosen] + step)
    return False


@compiled
def _dot_four(a: Floats, b: Floats) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])


@compiled
def _form(matrix: Floats, vector: Floats) -> float:
    """Return the quadratic form of a matrix, shape (4, 4), for a vector, shape (4,)."""
    total = 0.0
    for a in range(4):
        total += vector[a] * _dot_four(matrix[a], vector)
    return total


def sphere_volume(space: EnclosingSpace) -> float:
    """Return the volume of the least sphere around the hull [m3], exact by its support of up to four points.

    trimesh has one, too, which is not always the least (up to 0.6 % larger on hulls of fingers).
    """
    points = space.vertices
    if not len(points):
        return 0.0
    return float(4 / 3 * np.pi * _least_ball(points)[1] ** 1.5)


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
    """Return the candidates whose circumscribed ball is the least that holds all candidates.

    The last one, which lay outside the ball of the others, is among them.
    """
    best, least = candidates, np.inf
    for pattern in range(2 ** (len(candidates) - 1), 2 ** len(candidates)):
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
