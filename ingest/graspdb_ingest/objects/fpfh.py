"""Fast point feature histograms of a cloud (Rusu, Blodow and Beetz 2009)."""

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.open3d_library import load_open3d


def fpfh(cloud: ObjectCloud, radius: float) -> NDArray[np.float32]:
    """Return the histogram of every point, from all its neighbours within a radius.

    Parameters
    ----------
    cloud : ObjectCloud
        Points and normals.
    radius : float
        Radius of the neighbourhood [m]. It does not scale with the object: size matters in grasping.

    Returns
    -------
    ndarray of float32, shape (n_points, 33)
        Three blocks of eleven bins.

    Raises
    ------
    MissingLibraryError
        If Open3D, or a system library that it needs, is not installed.
    """
    open3d = load_open3d()
    geometry = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points))
    geometry.normals = open3d.utility.Vector3dVector(cloud.normals)
    search = open3d.geometry.KDTreeSearchParamRadius(radius)
    feature = open3d.pipelines.registration.compute_fpfh_feature(geometry, search)
    return np.ascontiguousarray(np.asarray(feature.data).T, dtype=np.float32)
