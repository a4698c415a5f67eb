"""Fast point feature histograms of an object's cloud, computed once per object."""

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.objects.smooth import smoothed
from graspdb_ingest.parameters import CloudParameters
from graspdb_schemas.errors import ParameterError


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
    angles between the normals of neighbouring points. All neighbours within the radius count.

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
    MissingLibraryError
        If Open3D, or a system library that it needs, is not installed.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise ParameterError("cloud.fpfh_radius", radius, "a positive radius in metres")
    open3d = load_open3d()
    points = open3d.geometry.PointCloud()
    points.points = open3d.utility.Vector3dVector(cloud.points)
    points.normals = open3d.utility.Vector3dVector(cloud.normals)
    search = open3d.geometry.KDTreeSearchParamRadius(radius)
    histograms = open3d.pipelines.registration.compute_fpfh_feature(points, search)
    return np.ascontiguousarray(histograms.data.T, dtype=np.float32)
