"""Graspable feature: the object's points inside the hand enclosing space (the paper's section II.D)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.descriptor import LENGTH, describe_features
from graspdb_ingest.enclosure import EnclosingSpace
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.cloud import ObjectCloud


@dataclass(frozen=True)
class GraspableFeature:
    """The part of an object that a hand encloses.

    Attributes
    ----------
    points : ndarray of int, shape (n,)
        Indices of the object's cloud.
    area : float
        Surface area [m2].
    centroid : ndarray, shape (3,)
        Area-weighted centre, object frame [m]; NaN for an empty feature.
    extents : ndarray, shape (3,)
        Size along its principal axes, largest first [m]; zero for fewer than two points.
    descriptor : ndarray of float32, shape (428,)
        What `describe` makes of it; NaN for an empty feature.
    """

    points: NDArray[np.int64]
    area: float
    centroid: Floats
    extents: Floats
    descriptor: NDArray[np.float32]


def graspable_feature(
    cloud: ObjectCloud, features: NDArray[np.float32], space: EnclosingSpace
) -> GraspableFeature:
    """Return the points of a cloud that lie inside an enclosing space.

    Parameters
    ----------
    cloud : ObjectCloud
        The object's surface.
    features : ndarray, shape (n_points, 128)
        `local_features` of the cloud's points.
    space : EnclosingSpace
        The hull, in the object frame.
    """
    points = np.flatnonzero(space.contains(cloud.points))
    if not len(points):
        nowhere = np.full(3, np.nan)
        return GraspableFeature(points, 0.0, nowhere, np.zeros(3), np.full(LENGTH, np.nan, np.float32))
    positions, areas = cloud.points[points], cloud.areas[points]
    weights = areas / areas.sum()
    centroid = weights @ positions
    return GraspableFeature(
        points=points,
        area=float(areas.sum()),
        centroid=centroid,
        extents=principal_extents(positions, areas),
        descriptor=describe_features(positions, cloud.normals[points], features[points], areas),
    )


def principal_extents(points: Floats, areas: Floats) -> Floats:
    """Return the size of a surface along its principal axes, largest first, shape (3,) [m].

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points, at least one [m].
    areas : ndarray, shape (n,)
        Area that each stands for [m2].
    """
    weights = areas / areas.sum()
    offsets = points - weights @ points
    _, axes = np.linalg.eigh((offsets.T * weights) @ offsets)
    return np.sort(np.ptp(offsets @ axes, axis=0))[::-1].copy()
