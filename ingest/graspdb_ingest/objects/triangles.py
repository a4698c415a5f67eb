"""The triangles of a mesh in a tree of boxes: which point is nearest, and what lies inside."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.rigid import Array
from graspdb_ingest.vectors import Three, cross, dot, minus, stepped

LEAF: Final = 8
"""A leaf holds this many triangles at the least, and less than twice as many."""

RAYS: Final = np.array([[0.5374, 0.6841, 0.4931], [-0.7219, 0.3173, 0.6150], [0.2837, -0.6469, -0.7079]])
"""Directions of the rays that vote whether a point is inside: one alone may meet an edge."""

_DEEPEST: Final = 64


class TriangleTree(NamedTuple):
    """Triangles in the order of the leaves of a balanced tree.

    The children of box k are 2 k + 1 and 2 k + 2, and each has half of its triangles.

    Attributes
    ----------
    corners : ndarray, shape (n, 3, 3)
        Corners of each triangle [m].
    frames : ndarray, shape (n, 5, 3)
        What bounds each of them closely: three axes, of which the last is its normal, and its lowest and
        highest coordinates along them [m].
    boxes : ndarray, shape (n_boxes, 2, 3)
        Lowest and highest corner of what each box holds [m], the root first and then level by level.
    starts : ndarray of int, shape (n_leaves + 1,)
        First triangle of each leaf.
    """

    corners: Array
    frames: Array
    boxes: Array
    starts: NDArray[np.int64]


def triangle_tree(vertices: Array, faces: NDArray[np.int64]) -> TriangleTree:
    """Sort the triangles of a mesh into a tree.

    Parameters
    ----------
    vertices : ndarray, shape (v, 3)
        Vertices [m].
    faces : ndarray of int, shape (n, 3)
        Triangles, at least one.
    """
    n = len(faces)
    depth = max(0, int(np.log2(n / LEAF)))
    centres = vertices[faces].mean(axis=1)
    order = np.arange(n)
    for level in range(depth):
        starts = _starts(n, level)
        box = np.repeat(np.arange(2**level), np.diff(starts))
        here = centres[order]
        extents = np.maximum.reduceat(here, starts[:-1]) - np.minimum.reduceat(here, starts[:-1])
        along = here[np.arange(n), extents.argmax(axis=1)[box]]
        order = order[np.lexsort((along, box))]
    corners = np.ascontiguousarray(vertices[faces[order]], dtype=np.float64)
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    boxes = [
        np.stack([np.minimum.reduceat(lows, first), np.maximum.reduceat(highs, first)], axis=1)
        for first in (_starts(n, level)[:-1] for level in range(depth + 1))
    ]
    return TriangleTree(corners, _frames(corners), np.concatenate(boxes), _starts(n, depth))


def _frames(corners: Array) -> Array:
    """Return axes and extents along them of triangles of shape (n, 3, 3), as the tree has them."""
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
    along = _unit(np.take_along_axis(edges, longest[:, None, None], axis=1)[:, 0], np.eye(3)[0])
    # Any normal does for a triangle without an area.
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    normals = _unit(np.cross(edges[:, 0], edges[:, 1]), _unit(aside, aside))
    axes = np.stack([along, np.cross(normals, along), normals], axis=1)
    places = np.einsum("nai,nci->nca", axes, corners)
    margin = 1e-12 * np.abs(corners).max()  # no tighter by rounding
    low, high = places.min(axis=1) - margin, places.max(axis=1) + margin
    return np.concatenate([axes, low[:, None], high[:, None]], axis=1)


def _unit(vectors: Array, instead: Array) -> Array:
    """Return unit vectors along others, shape (n, 3), and something else for those without a length."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 0, vectors / np.where(lengths > 0, lengths, 1.0), instead)


def _starts(n: int, level: int) -> NDArray[np.int64]:
    """Return the first triangle of each box of a level, and the number of triangles."""
    return (n * np.arange(2**level + 1)) >> level


@compiled
def nearest_points(tree: TriangleTree, points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the nearest points of a mesh and the triangles of the tree that they lie on.

    Parameters
    ----------
    tree : TriangleTree
        The mesh.
    points : ndarray, shape (n, k, 3)
        Where to ask from [m]: k paths, each of which is asked step by step.

    Returns
    -------
    tuple of ndarray, shapes (n, k, 3) and (n, k)
        Positions [m], and triangles.
    """
    positions, triangles = np.empty(points.shape), np.zeros(points.shape[:2], np.int64)
    stack, distances = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST)
    corners, frames, boxes, starts = tree
    for i in range(points.shape[0]):
        for k in range(points.shape[1]):
            # What was nearest the step before is not far off now, which rules out most boxes at once.
            first = triangles[i - 1, k] if i else 0
            point = (points[i, k, 0], points[i, k, 1], points[i, k, 2])
            best = _descend(corners, frames, boxes, starts, point, first, stack, distances)
            triangles[i, k] = best
            positions[i, k, :] = _on_triangle(point, corners[best])
    return positions, triangles


@compiled
def _descend(
    corners: Array,
    frames: Array,
    boxes: Array,
    starts: NDArray[np.int64],
    point: Three,
    first: int,
    stack: NDArray[np.int64],
    distances: Array,
) -> int:
    """Return the triangle nearest to a point, beginning with a guess."""
    best, least = first, _squared_to_triangle(point, corners[first])
    n_inner = len(starts) - 2
    stack[0], distances[0] = 0, _squared_to_box(point, boxes, 0)
    waiting = 1
    while waiting:
        waiting -= 1
        box = stack[waiting]
        if distances[waiting] >= least:
            continue
        if box >= n_inner:
            for j in range(starts[box - n_inner], starts[box - n_inner + 1]):
                if _squared_to_frame(point, frames[j]) < least:
                    squared = _squared_to_triangle(point, corners[j])
                    if squared < least:
                        best, least = j, squared
            continue
        left, right = 2 * box + 1, 2 * box + 2
        to_left, to_right = _squared_to_box(point, boxes, left), _squared_to_box(point, boxes, right)
        # The nearer one is taken first, for it lies on top.
        if to_left < to_right:
            left, right, to_left, to_right = right, left, to_right, to_left
        stack[waiting], distances[waiting] = left, to_left
        stack[waiting + 1], distances[waiting + 1] = right, to_right
        waiting += 2
    return best


@compiled
def _squared_to_box(point: Three, boxes: Array, box: int) -> float:
    squared = 0.0
    for i in range(3):
        beyond = max(boxes[box, 0, i] - point[i], point[i] - boxes[box, 1, i], 0.0)
        squared += beyond * beyond
    return squared


@compiled
def _squared_to_frame(point: Three, frame: Array) -> float:
    squared = 0.0
    for i in range(3):
        along = dot(frame[i], point)
        beyond = max(frame[3, i] - along, along - frame[4, i], 0.0)
        squared += beyond * beyond
    return squared


@compiled
def _squared_to_triangle(point: Three, corners: Array) -> float:
    arm = minus(_on_triangle(point, corners), point)
    return dot(arm, arm)


@compiled
def _on_triangle(point: Three, corners: Array) -> Three:
    """Return the nearest point of a triangle (Ericson, "Real-Time Collision Detection", 2005, 5.1.5)."""
    a, b, c = corners[0], corners[1], corners[2]
    ab, ac, bc = minus(b, a), minus(c, a), minus(c, b)
    from_a, from_b, from_c = minus(point, a), minus(point, b), minus(point, c)
    b_at_a, c_at_a = dot(ab, from_a), dot(ac, from_a)
    b_at_b, c_at_b = dot(ab, from_b), dot(ac, from_b)
    b_at_c, c_at_c = dot(ab, from_c), dot(ac, from_c)
    if b_at_a <= 0 and c_at_a <= 0:
        return a[0], a[1], a[2]
    if b_at_b >= 0 and c_at_b <= b_at_b:
        return b[0], b[1], b[2]
    if c_at_c >= 0 and b_at_c <= c_at_c:
        return c[0], c[1], c[2]
    on_a, on_b, on_c = (
        b_at_b * c_at_c - b_at_c * c_at_b,
        b_at_c * c_at_a - b_at_a * c_at_c,
        b_at_a * c_at_b - b_at_b * c_at_a,
    )
    if on_c <= 0 and b_at_a >= 0 >= b_at_b and b_at_a > b_at_b:
        return stepped(a, ab, b_at_a / (b_at_a - b_at_b))
    if on_b <= 0 and c_at_a >= 0 >= c_at_c and c_at_a > c_at_c:
        return stepped(a, ac, c_at_a / (c_at_a - c_at_c))
    if on_a <= 0:
        towards_c, towards_b = c_at_b - b_at_b, b_at_c - c_at_c
        return stepped(b, bc, towards_c / max(towards_c + towards_b, 1e-300))
    whole = on_a + on_b + on_c
    return stepped(stepped(a, ab, on_b / whole), ac, on_c / whole)


@compiled
def inside(tree: TriangleTree, points: Array, distances: Array, rays: Array) -> NDArray[np.bool_]:
    """Return which points lie inside a closed mesh: most rays from them meet an odd number of triangles.

    Parameters
    ----------
    tree : TriangleTree
        The mesh.
    points : ndarray, shape (n, k, 3)
        Points [m], in n steps of k paths.
    distances : ndarray, shape (n, k)
        Their distances to the mesh [m].
    rays : ndarray, shape (r, 3)
        Directions.

    Returns
    -------
    ndarray of bool, shape (n, k)
    """
    found = np.zeros(distances.shape, np.bool_)
    stack, box = np.empty(_DEEPEST, np.int64), tree.boxes[0]
    for i in range(points.shape[0]):
        for k in range(points.shape[1]):
            place = points[i, k]
            if not _within(place, box):
                continue
            if i:
                # A step shorter than the distance to the surface does not lead through it.
                step = minus(place, points[i - 1, k])
                if dot(step, step) < distances[i - 1, k] ** 2:
                    found[i, k] = found[i - 1, k]
                    continue
            votes = 0
            for ray in rays:
                votes += 1 if _crossings(tree, place, ray, stack) % 2 else -1
                if 2 * abs(votes) > len(rays):
                    break
            found[i, k] = votes > 0
    return found


@compiled
def _within(place: Array, box: Array) -> bool:
    x, y, z = place[0], place[1], place[2]
    low, high = box[0], box[1]
    return bool(low[0] < x < high[0] and low[1] < y < high[1] and low[2] < z < high[2])


@compiled
def _crossings(tree: TriangleTree, point: Array, ray: Array, stack: NDArray[np.int64]) -> int:
    """Return how many triangles a ray from a point meets."""
    n_inner, crossings, waiting = len(tree.starts) - 2, 0, 1
    stack[0] = 0
    while waiting:
        waiting -= 1
        box = stack[waiting]
        if not _meets_box(point, ray, tree.boxes[box]):
            continue
        if box < n_inner:
            stack[waiting], stack[waiting + 1] = 2 * box + 1, 2 * box + 2
            waiting += 2
        else:
            for j in range(tree.starts[box - n_inner], tree.starts[box - n_inner + 1]):
                crossings += _meets_triangle(point, ray, tree.corners[j])
    return crossings


@compiled
def _meets_box(point: Array, ray: Array, box: Array) -> bool:
    near, far = 0.0, np.inf
    for i in range(3):
        one, other = (box[0, i] - point[i]) / ray[i], (box[1, i] - point[i]) / ray[i]
        near, far = max(near, min(one, other)), min(far, max(one, other))
    return bool(near <= far * (1 + 1e-12))


@compiled
def _meets_triangle(point: Array, ray: Array, corners: Array) -> bool:
    """Return whether a ray meets a triangle (Moeller and Trumbore, J. Graph. Tools 2(1), 1997)."""
    first, second = minus(corners[1], corners[0]), minus(corners[2], corners[0])
    across, arm = cross(ray, second), minus(point, corners[0])
    determinant = dot(first, across)
    if determinant == 0:
        return False
    u = dot(arm, across) / determinant
    over = cross(arm, first)
    v = dot(ray, over) / determinant
    return bool(u >= 0 and v >= 0 and u + v <= 1 and dot(second, over) / determinant > 0)
