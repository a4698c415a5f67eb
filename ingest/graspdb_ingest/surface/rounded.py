"""Rounded shapes: unions of spheres whose centres and radii run linearly over points, lines and triangles.

The hull of two spheres is a cone-sphere, a tapered capsule; the hull of three a rounded wedge. Both
are the union of the spheres in between (Tkach, Pauly and Tagliasacchi, "Sphere-meshes for real-time
hand modeling and tracking", ACM Trans. Graph. 35(6), 2016), so the signed distance of a point is the
least ``||p - c|| - r`` over them, and has a closed form.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats

Integers = NDArray[np.int64]

POINTS_AT_ONCE: Final = 2048
"""Points that are compared with all shapes together, to bound the memory."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Signed distances of points to a union of rounded shapes.

    Attributes
    ----------
    distance : ndarray, shape (n,)
        Distance [m], negative inside; exact outside, and where only one shape holds the point.
    shape : ndarray of int, shape (n,)
        The shape that is nearest.
    weights : ndarray, shape (n, 3)
        Barycentric place in it of the nearest sphere's centre.
    """

    distance: Floats
    shape: Integers
    weights: Floats


def rounded_distances(points: Floats, centres: Floats, radii: Floats, shapes: Integers) -> Distances:
    """Return the signed distance of points to the nearest of rounded shapes.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points [m].
    centres : ndarray, shape (k, 3)
        Centres of the spheres at the corners [m].
    radii : ndarray, shape (k,)
        Their radii [m].
    shapes : ndarray of int, shape (m, 3)
        Corners of each shape: three for a wedge, with the last one repeated for a cone-sphere, and
        one thrice for a sphere.
    """
    parts = [
        _some_distances(points[start : start + POINTS_AT_ONCE], centres, radii, shapes)
        for start in range(0, max(len(points), 1), POINTS_AT_ONCE)
    ]
    return Distances(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _some_distances(
    points: Floats, centres: Floats, radii: Floats, shapes: Integers
) -> tuple[Floats, Integers, Floats]:
    weights = nearest_weights(points[:, None], centres[shapes], radii[shapes])
    distance = sphere_distance(points[:, None], weights, centres[shapes], radii[shapes])
    best = distance.argmin(axis=1)
    rows = np.arange(len(points))
    return distance[rows, best], best, weights[rows, best]


def sphere_distance(points: Floats, weights: Floats, corners: Floats, radii: Floats) -> Floats:
    """Return ``||p - c|| - r`` for the spheres at barycentric places of shapes, shape (...)."""
    centre = np.einsum("...k,...ki->...i", weights, corners)
    radius = np.sum(weights * radii, axis=-1)
    return np.asarray(np.linalg.norm(points - centre, axis=-1) - radius)


def nearest_weights(points: Floats, corners: Floats, radii: Floats) -> Floats:
    """Return the barycentric place of the sphere of a shape that is nearest to a point.

    Parameters
    ----------
    points : ndarray, shape (..., 3)
        Points [m].
    corners : ndarray, shape (..., 3, 3)
        Centres at the corners of the shapes [m].
    radii : ndarray, shape (..., 3)
        Radii there [m].

    Returns
    -------
    ndarray, shape (..., 3)
        Weights that sum to one.
    """
    shape = np.broadcast_shapes(points.shape[:-1], corners.shape[:-2])
    best = np.zeros((*shape, 3))
    best[..., 0] = 1.0
    # A cone-sphere repeats its last corner: its one edge says it all.
    flat = np.all(corners[..., 1, :] == corners[..., 2, :], axis=-1)
    least = np.full(shape, np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        share = _along_edge(
            points, corners[..., first, :], corners[..., second, :], radii[..., first], radii[..., second]
        )
        weights = np.zeros((*shape, 3))
        weights[..., first], weights[..., second] = 1 - share, share
        distance = sphere_distance(points, weights, corners, radii)
        nearer = (distance < least) & ((first == 0) | ~flat)
        best[nearer], least[nearer] = weights[nearer], distance[nearer]
    inner, valid = _in_triangle(points, corners, radii)
    distance = np.where(valid, sphere_distance(points, inner, corners, radii), np.inf)
    nearer = distance < least
    best[nearer] = inner[nearer]
    return best


def _along_edge(
    points: Floats, start: Floats, end: Floats, start_radius: Floats, end_radius: Floats
) -> Floats:
    """Return how far from start to end the nearest sphere lies, as a share, shape (...).

    ``||p - c(t)|| - r(t)`` is convex in t; its slope is zero where the line from the point to the
    centre leans by the taper.
    """
    axis = end - start
    squared = np.sum(axis * axis, axis=-1)
    length = np.sqrt(squared)
    safe = np.where(length > 0, length, 1.0)
    along = np.sum((points - start) * axis, axis=-1) / safe
    aside = np.sqrt(np.maximum(np.sum((points - start) ** 2, axis=-1) - along**2, 0.0))
    taper = np.broadcast_to((end_radius - start_radius) / safe, along.shape)
    # One sphere holds the other where the taper is steeper than one: then the larger one is all there is.
    inside = np.abs(taper) >= 1
    lean = taper / np.sqrt(np.maximum(1 - np.minimum(taper**2, 1.0), 1e-12))
    share = np.clip((along + aside * lean) / safe, 0.0, 1.0)
    share = np.where(inside, np.where(taper > 0, 1.0, 0.0), share)
    return np.asarray(np.where(length > 0, share, 0.0))


def _in_triangle(points: Floats, corners: Floats, radii: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return where the slope of the distance is zero in a triangle's plane, and whether that lies inside."""
    origin = corners[..., 0, :]
    first, second = corners[..., 1, :] - origin, corners[..., 2, :] - origin
    normal = np.cross(first, second)
    doubled = np.linalg.norm(normal, axis=-1)
    whole = doubled > 1e-12
    normal = normal / np.where(whole, doubled, 1.0)[..., None]
    aa, ab, bb = (np.sum(u * v, axis=-1) for u, v in ((first, first), (first, second), (second, second)))
    determinant = np.where(whole, aa * bb - ab**2, 1.0)
    rise = radii[..., 1:] - radii[..., :1]
    # The gradient of the radius in the plane.
    gradient = ((bb * rise[..., 0] - ab * rise[..., 1]) / determinant)[..., None] * first + (
        (aa * rise[..., 1] - ab * rise[..., 0]) / determinant
    )[..., None] * second
    steep = np.sum(gradient**2, axis=-1)
    arm = points - origin
    height = np.abs(np.sum(arm * normal, axis=-1))
    away = height / np.sqrt(np.maximum(1 - steep, 1e-12))
    place = arm + gradient * away[..., None]
    pa, pb = np.sum(place * first, axis=-1), np.sum(place * second, axis=-1)
    u, v = (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
    weights = np.stack([1 - u - v, u, v], axis=-1)
    valid = whole & (steep < 1) & (weights >= 0).all(axis=-1)
    return np.where(valid[..., None], weights, 0.0), np.asarray(valid)
