"""Laying grasps of a database onto a new object: alignment, and what speaks for and against each.

A feature is first laid over the place that its descriptor is like, then settled on the whole object, one
way: all of the feature should lie on the object, and what else the object has does not matter. Then the
grasp's enclosing space is moved along, and what it holds of the new object is compared with the feature.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from graspdb_queries.similar.align import aligned
from graspdb_queries.similar.library import Cloud
from graspdb_queries.similar.metric import Metric, Vectors
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.places import LEAST_POINTS, NewObject, Rows
from graspdb_queries.similar.settle import best_starts, facing, nearest_means, settled

Floats = NDArray[np.float64]

STEPS: Final = (4, 20)
"""Steps of every start, then of the best one."""

ON: Final = 0.005
"""A contact point this near to the new object lies on it [m]."""

DEPTH: Final = 0.005
"""A sphere this much deeper in the new object than in its own reaches into it [m]."""

MOST_INSIDE: Final = 3
"""Spheres of 20 that may reach into the new object."""


@dataclass(frozen=True, eq=False)
class HeldFeature:
    """A feature of the database, and the hand on it, in the frame of its object.

    Attributes
    ----------
    part : Part
        The feature.
    vector : ndarray of float32, shape (d,)
        Its descriptor's vector.
    planes : ndarray, shape (f, 4)
        Half-spaces of the enclosing space: a x <= -b.
    box : ndarray, shape (2, 3)
        Its lowest and highest corner [m].
    sites : ndarray, shape (20, 3)
        Sphere centres [m].
    radii : ndarray, shape (20,)
        Sphere radii [m].
    own_gaps : ndarray, shape (20,)
        Distances of the spheres' surfaces to their own object, negative inside [m].
    contacts : ndarray, shape (k, 3)
        Contact points [m].
    """

    part: Part
    vector: Vectors
    planes: Floats
    box: Floats
    sites: Floats
    radii: Floats
    own_gaps: Floats
    contacts: Floats


@dataclass(frozen=True, eq=False)
class Fit:
    """How a grasp lies on the new object; see `PlacedGrasp`."""

    key: str
    pose: Floats
    rows: Rows
    descriptor: float
    one_way: float
    trimmed: float
    contacts_on: float
    penetration: float
    n_inside: int

    @property
    def possible(self) -> bool:
        """Whether the hand stays outside the new object."""
        return self.n_inside <= MOST_INSIDE


def hull_planes(vertices: Floats) -> Floats | None:
    """Return the half-spaces of a convex hull, shape (f, 4); None for a flat one."""
    try:
        return np.asarray(ConvexHull(vertices).equations)
    except (QhullError, ValueError):
        return None


def gaps(tree: cKDTree, cloud: Cloud, centres: Floats, radii: Floats) -> Floats:
    """Return distances of spheres' surfaces to a cloud's surface, negative inside it [m], shape (n,)."""
    apart, nearest = tree.query(centres)
    outside = np.einsum("ni,ni->n", centres - cloud.points[nearest], cloud.normals[nearest]) >= 0
    return np.asarray(np.where(outside, apart, -apart) - radii)


def starts_on(new: NewObject, place: Rows, features: Sequence[HeldFeature]) -> Floats:
    """Return where features may lie about a place of a new object, new_from_object, shape (n, s, 4, 4)."""
    poses, _ = aligned(new.part(place), [feature.part for feature in features])
    return np.asarray(np.linalg.inv(poses.matrices()), dtype=np.float64)


def lay_onto(new: NewObject, features: Sequence[HeldFeature], starts: Floats, metric: Metric) -> list[Fit]:
    """Return how features lie on a new object; those that enclose nothing are left out.

    Parameters
    ----------
    new : NewObject
        The object.
    features : sequence of HeldFeature
        At most `CHUNK`.
    starts : ndarray, shape (n, s, 4, 4)
        Where each may lie, new_from_object.
    metric : Metric
        What compares descriptors.
    """
    n, n_starts = starts.shape[:2]
    points = np.stack([feature.part.dense.points for feature in features])
    normals = np.stack([feature.part.dense.normals for feature in features])
    every = np.repeat(np.arange(n), n_starts)
    tried = settled(new, points[every], normals[every], starts.reshape(-1, 4, 4), STEPS[0])
    # What is nearly alike both ways round, as a handle is, shows only on the whole object which fits.
    best = best_starts(new, points, normals, tried.reshape(starts.shape))
    poses = settled(new, points, normals, best, STEPS[1])
    fits = [_judge(new, feature, pose, metric) for feature, pose in zip(features, poses, strict=True)]
    return [fit for fit in fits if fit is not None]


def _moved(points: Floats, pose: Floats) -> Floats:
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def _judge(new: NewObject, feature: HeldFeature, pose: Floats, metric: Metric) -> Fit | None:
    part = feature.part
    apart, _ = facing(new, _moved(part.scored, pose), part.scored_normals @ pose[:3, :3].T)
    back = (new.cloud.points - pose[:3, 3]) @ pose[:3, :3]
    rows = np.flatnonzero(((back >= feature.box[0]) & (back <= feature.box[1])).all(axis=1))
    inside = (back[rows] @ feature.planes[:, :3].T + feature.planes[:, 3] <= 1e-9).all(axis=1)
    rows = rows[inside]
    if len(rows) < LEAST_POINTS:
        return None
    vector = metric.vectors(new.describe(rows)[None])[0]
    on = new.tree.query(_moved(feature.contacts, pose))[0] <= ON if len(feature.contacts) else np.zeros(1)
    there = gaps(new.tree, new.cloud, _moved(feature.sites, pose), feature.radii)
    deeper = np.minimum(feature.own_gaps, 0) - there
    return Fit(
        key=part.name,
        pose=pose,
        rows=rows,
        descriptor=float(np.linalg.norm(vector.astype(np.float64) - feature.vector)),
        one_way=float(apart.mean()),
        trimmed=float(nearest_means(apart)),
        contacts_on=float(np.mean(on)),
        penetration=float(max(deeper.max(), 0.0)),
        n_inside=int((deeper > DEPTH).sum()),
    )
