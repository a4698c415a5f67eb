"""Fast point feature histograms of an object's cloud, computed once per object."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.grid import ROWS, Grid, make_grid, rows_around, squared_distance
from graspdb_ingest.objects.smooth import smoothed
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ParameterError

BINS: Final = 11
_ROUNDING: Final = 1e-15


def point_histograms(cloud: ObjectCloud, parameters: CloudParameters) -> NDArray[np.float32]:
    """Return the FPFH of a cloud's points on the smoothed surface, shape (n, 33); see `fpfh`.

    Histograms of a cloud with noise differ little from those of the surface only once the noise is smoothed
    away, and those of a clean cloud must then be of a smoothed one, too.
    """
    points, normals = smoothed(cloud.points, cloud.normals, parameters.smoothing_radius)
    return fpfh(ObjectCloud(points, normals, cloud.areas, cloud.spacing), parameters.fpfh_radius)


def fpfh(cloud: ObjectCloud, radius: float) -> NDArray[np.float32]:
    """Describe the surface around each point by its fast point feature histogram.

    Rusu, Blodow, Beetz (2009), IEEE Int. Conf. Robot. Autom., 3212: three histograms of 11 bins over the
    angles between the normals of neighbouring points. All neighbours within the radius count. As in Open3D
    and the Point Cloud Library, the neighbours' histograms are weighed by the inverse square of their
    distance, and each of the three by itself is scaled to the weight of the point's own, 100.

    Parameters
    ----------
    cloud : ObjectCloud
        Points and normals.
    radius : float
        Radius of the neighbourhood [m].

    Returns
    -------
    ndarray of float32, shape (n, 33)
        Histograms; zero for a point without neighbours.

    Raises
    ------
    ParameterError
        If the radius is not a positive number.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise ParameterError("cloud.fpfh_radius", radius, "a positive radius in metres")
    grid = make_grid(cloud.points, radius)
    own = _own_histograms(grid, np.ascontiguousarray(cloud.normals[grid.order]), radius)
    histograms = np.empty((len(own), 3 * BINS), dtype=np.float32)
    histograms[grid.order] = _with_neighbours(grid, own, radius)
    return histograms


@compiled
def _own_histograms(grid: Grid, normals: Array, radius: float) -> Array:
    """Return the histograms of each point's pairs with its neighbours, in the order of the grid, (n, 33)."""
    points = grid.points
    histograms, count = np.zeros((len(points), 3 * BINS)), np.zeros(len(points))
    rows = np.empty((ROWS, 2), np.int64)
    for i in range(len(points)):
        for row in range(rows_around(grid, points[i], rows)):
            for j in range(max(rows[row, 0], i + 1), rows[row, 1]):
                squared = squared_distance(points[i], points[j])
                if squared <= radius * radius:
                    count[i] += 1
                    count[j] += 1
                    _count_pair(points, normals, i, j, np.sqrt(squared), histograms)
    for i in range(len(points)):
        histograms[i] *= 100 / max(count[i], 1)
    return histograms


@compiled
def _count_pair(points: Array, normals: Array, i: int, j: int, distance: float, histograms: Array) -> None:
    """Enter a pair of neighbours into the histograms of both."""
    x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    leaning = (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z) / max(distance, 1e-300)
    other = (normals[j, 0] * x + normals[j, 1] * y + normals[j, 2] * z) / max(distance, 1e-300)
    # Angles are taken at the point whose normal is closer to the line between them, or else at each's own.
    difference = abs(leaning) - abs(other)
    if difference >= -_ROUNDING:
        first, second, third = _bins(normals[i], normals[j], x, y, z, leaning)
    else:
        first, second, third = _bins(normals[j], normals[i], -x, -y, -z, -other)
    histograms[i, first] += 1
    histograms[i, second] += 1
    histograms[i, third] += 1
    if abs(difference) <= _ROUNDING:
        first, second, third = _bins(normals[j], normals[i], -x, -y, -z, -other)
    histograms[j, first] += 1
    histograms[j, second] += 1
    histograms[j, third] += 1


@compiled
def _bins(source: Array, target: Array, x: float, y: float, z: float, leaning: float) -> tuple[int, int, int]:
    """Return where a pair belongs in the three histograms, from the step between its points."""
    a, b, c = y * source[2] - z * source[1], z * source[0] - x * source[2], x * source[1] - y * source[0]
    length = np.sqrt(a * a + b * b + c * c)
    middle = BINS // 2
    if length == 0:  # no angles are known of points in one place, or one above the other
        return middle, BINS + middle, 2 * BINS + middle
    a, b, c = a / length, b / length, c / length
    along = a * target[0] + b * target[1] + c * target[2]
    across = (
        (source[1] * c - source[2] * b) * target[0]
        + (source[2] * a - source[0] * c) * target[1]
        + (source[0] * b - source[1] * a) * target[2]
    )
    turn = np.arctan2(across, source[0] * target[0] + source[1] * target[1] + source[2] * target[2])
    return (
        _bin((turn + np.pi) / (2 * np.pi)),
        BINS + _bin((along + 1) * 0.5),
        2 * BINS + _bin((leaning + 1) * 0.5),
    )


@compiled
def _bin(share: float) -> int:
    return min(max(int(np.floor(BINS * share)), 0), BINS - 1)


@compiled
def _with_neighbours(grid: Grid, own: Array, radius: float) -> Array:
    """Return the points' own histograms and the weighted means of their neighbours', shape (n, 33)."""
    points = grid.points
    histograms = np.zeros_like(own)
    rows = np.empty((ROWS, 2), np.int64)
    for i in range(len(points)):
        for row in range(rows_around(grid, points[i], rows)):
            for j in range(max(rows[row, 0], i + 1), rows[row, 1]):
                squared = squared_distance(points[i], points[j])
                if 0 < squared <= radius * radius:
                    weight = 1 / squared
                    for k in range(3 * BINS):
                        histograms[i, k] += weight * own[j, k]
                        histograms[j, k] += weight * own[i, k]
    for i in range(len(points)):
        for first in range(0, 3 * BINS, BINS):
            some = histograms[i, first : first + BINS]
            total = some.sum()
            if total > 0:
                some *= 100 / total
            some += own[i, first : first + BINS]
    return histograms
