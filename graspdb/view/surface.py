"""Triangles between the points of a cloud, to draw it as a surface."""

from typing import Final

import numpy as np

from graspdb.view.scene import Floats, Integers
from graspdb_ingest.objects.open3d_library import load_open3d

BALLS: Final = (0.8, 1.3, 2.0, 3.0)
"""Radii of the balls that roll over the cloud, over its spacing: small first, which keeps edges sharp."""

LEAST_POINTS: Final = 4


def triangles_between(points: Floats, normals: Floats, areas: Floats) -> Integers:
    """Return triangles whose corners are points of a cloud, shape (m, 3).

    The ball-pivoting algorithm (Bernardini and others, IEEE Trans. Vis. Comput. Graph. 5(4), 1999): three
    points make a triangle where a ball rests on them and holds no other. Even clouds are what it is for.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Points [m] and outward unit normals.
    areas : ndarray, shape (n,)
        Surface that each point stands for [m2]; its mean tells the spacing.
    """
    known = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
    if known.sum() < LEAST_POINTS:
        return np.empty((0, 3), dtype=np.int32)
    open3d = load_open3d()
    rows = np.flatnonzero(known)
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points[rows]))
    cloud.normals = open3d.utility.Vector3dVector(normals[rows])
    balls = open3d.utility.DoubleVector(_spacing(points[rows], areas[rows]) * np.array(BALLS))
    quiet = open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error)
    with quiet:
        mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, balls)
    return np.asarray(rows[np.asarray(mesh.triangles, dtype=np.int64).reshape(-1, 3)], dtype=np.int32)


def _spacing(points: Floats, areas: Floats) -> float:
    """Return the distance of neighbours [m]: of points evenly on a plane, by the area of each.

    Each point of a plane's triangular lattice of spacing d has the area sqrt(3)/2 d^2. Where areas are
    missing, the median distance to the nearest point stands for d.
    """
    mean = float(np.nanmean(areas)) if np.isfinite(areas).any() else 0.0
    if mean > 0:
        return float(np.sqrt(2 * mean / np.sqrt(3)))
    from scipy.spatial import cKDTree

    distances = np.asarray(cKDTree(points).query(points, k=[2])[0])
    return float(np.median(distances[distances > 0])) if (distances > 0).any() else 1e-3
