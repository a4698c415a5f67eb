"""Rounded shapes: unions of spheres whose centres and radii run linearly over points, lines and triangles.

The hull of two spheres is a cone-sphere, a tapered capsule; the hull of three a rounded wedge. Both
are the union of the spheres in between (Tkach, Pauly and Tagliasacchi, "Sphere-meshes for real-time
hand modeling and tracking", ACM Trans. Graph. 35(6), 2016), so the signed distance of a point is the
least ``||p - c|| - r`` over them, and has a closed form.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.vectors import cross, dot, minus

Integers = NDArray[np.int64]


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
    # A shape lies in a ball, so it is no nearer to a point than that.
    corners, corner_radii = centres[shapes], radii[shapes]
    middles = corners.mean(axis=1)
    reaches = (np.linalg.norm(corners - middles[:, None], axis=2) + corner_radii).max(axis=1)
    return Distances(*_nearest(np.ascontiguousarray(points), corners, corner_radii, middles, reaches))


def nearest_weights(points: Floats, corners: Floats, radii: Floats) -> Floats:
    """Return the barycentric place of the sphere of a shape that is nearest to a point.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points [m], each with a shape of its own.
    corners : ndarray, shape (n, 3, 3)
        Centres at the corners of the shapes [m].
    radii : ndarray, shape (n, 3)
        Radii there [m].

    Returns
    -------
    ndarray, shape (n, 3)
        Weights that sum to one.
    """
    return _nearest_of_each(*(np.ascontiguousarray(values) for values in (points, corners, radii)))


@compiled
def _nearest(
    points: Floats, corners: Floats, radii: Floats, middles: Floats, reaches: Floats
) -> tuple[Floats, Integers, Floats]:
    """Return distance, shape and weights of each point; each shape lies in a ball of a middle and a reach."""
    distance, shape = np.empty(len(points)), np.empty(len(points), np.int64)
    weights, tried = np.empty((len(points), 3)), np.empty(3)
    least = np.empty(len(corners))
    for i in range(len(points)):
        first = 0
        for j in range(len(corners)):
            arm = minus(points[i], middles[j])
            least[j] = np.sqrt(dot(arm, arm)) - reaches[j]
            if least[j] < least[first]:
                first = j
        shape[i] = first
        distance[i] = _nearest_sphere(points[i], corners[first], radii[first], weights[i])
        for j in range(len(corners)):
            if j != first and least[j] < distance[i]:
                there = _nearest_sphere(points[i], corners[j], radii[j], tried)
                if there < distance[i]:
                    distance[i], shape[i], weights[i, :] = there, j, tried
    return distance, shape, weights


@compiled
def _nearest_of_each(points: Floats, corners: Floats, radii: Floats) -> Floats:
    weights = np.empty((len(points), 3))
    for i in range(len(points)):
        _nearest_sphere(points[i], corners[i], radii[i], weights[i])
    return weights


@compiled
def _nearest_sphere(point: Floats, corners: Floats, radii: Floats, weights: Floats) -> float:
    """Write the place of the sphere of one shape that is nearest to a point, and return its distance."""
    a, b, c = corners[0], corners[1], corners[2]
    share = _along_edge(point, a, b, radii[0], radii[1])
    weights[0], weights[1], weights[2] = 1 - share, share, 0.0
    least = _sphere_distance(point, corners, radii, weights[0], weights[1], weights[2])
    # A cone-sphere repeats its last corner: its one edge says it all.
    if b[0] == c[0] and b[1] == c[1] and b[2] == c[2]:
        return least
    along_second = _along_edge(point, b, c, radii[1], radii[2])
    along_third = _along_edge(point, c, a, radii[2], radii[0])
    u, v = _in_triangle(point, corners, radii)
    for x, y, z in (
        (0.0, 1 - along_second, along_second),
        (along_third, 0.0, 1 - along_third),
        (1 - u - v, u, v),
    ):
        # Outside the triangle, or where it has no such place, a weight is negative or NaN.
        if x >= 0 and y >= 0 and z >= 0:
            distance = _sphere_distance(point, corners, radii, x, y, z)
            if distance < least:
                least = distance
                weights[0], weights[1], weights[2] = x, y, z
    return least


@compiled
def _sphere_distance(point: Floats, corners: Floats, radii: Floats, x: float, y: float, z: float) -> float:
    """Return ``||p - c|| - r`` for the sphere at a barycentric place."""
    squared = 0.0
    for i in range(3):
        arm = point[i] - (x * corners[0, i] + y * corners[1, i] + z * corners[2, i])
        squared += arm * arm
    return float(np.sqrt(squared) - (x * radii[0] + y * radii[1] + z * radii[2]))


@compiled
def _along_edge(point: Floats, start: Floats, end: Floats, start_radius: float, end_radius: float) -> float:
    """Return how far from start to end the nearest sphere lies, as a share.

    ``||p - c(t)|| - r(t)`` is convex in t; its slope is zero where the line from the point to the
    centre leans by the taper.
    """
    axis, arm = minus(end, start), minus(point, start)
    length = np.sqrt(dot(axis, axis))
    if length == 0:
        return 0.0
    taper = (end_radius - start_radius) / length
    # One sphere holds the other where the taper is steeper than one: then the larger one is all there is.
    if abs(taper) >= 1:
        return 1.0 if taper > 0 else 0.0
    along = dot(arm, axis) / length
    aside = np.sqrt(max(dot(arm, arm) - along**2, 0.0))
    lean = taper / np.sqrt(max(1 - taper**2, 1e-12))
    return float(min(max((along + aside * lean) / length, 0.0), 1.0))


@compiled
def _in_triangle(point: Floats, corners: Floats, radii: Floats) -> tuple[float, float]:
    """Return the weights of the last two corners where the slope of the distance is zero in their plane.

    They may lie outside the triangle, and are NaN where there is no such place.
    """
    first, second = minus(corners[1], corners[0]), minus(corners[2], corners[0])
    normal = cross(first, second)
    doubled = np.sqrt(dot(normal, normal))
    if doubled <= 1e-12:
        return np.nan, np.nan
    aa, ab, bb = dot(first, first), dot(first, second), dot(second, second)
    determinant = aa * bb - ab**2
    # The gradient of the radius in the plane.
    rise, climb = radii[1] - radii[0], radii[2] - radii[0]
    along_first, along_second = (bb * rise - ab * climb) / determinant, (aa * climb - ab * rise) / determinant
    steep = along_first * rise + along_second * climb
    if steep >= 1:
        return np.nan, np.nan
    arm = minus(point, corners[0])
    away = abs(dot(arm, normal)) / doubled / np.sqrt(max(1 - steep, 1e-12))
    pa, pb = dot(arm, first) + away * rise, dot(arm, second) + away * climb
    return (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
