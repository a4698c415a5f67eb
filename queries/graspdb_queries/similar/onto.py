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
from scipy.spatial.transform import Rotation

from graspdb_queries.similar.align import TRIMMED, aligned
from graspdb_queries.similar.library import Cloud
from graspdb_queries.similar.metric import Metric, Vectors
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.places import LEAST_POINTS, NewObject, Rows

Floats = NDArray[np.float64]

STEPS: Final = (4, 10)
"""Steps of every start, then of the best one."""

AT_REST: Final = 1e-5
"""A step that moves no point further, roughly, is the last [m]."""

NEIGHBOURS: Final = 8
"""Points of the object among which one is looked for whose normal points the same way."""

REACH: Final = 0.010
"""Distance [m] that a point counts with where no surface that faces the same way is as near."""

ON: Final = 0.005
"""A contact point this near to the new object lies on it [m]."""

DEPTH: Final = 0.005
"""A sphere this much deeper in the new object than in its own reaches into it [m]."""

MOST_INSIDE: Final = 3
"""Spheres of 20 that may reach into the new object."""

STILL: Final = 1e-3
"""Share of the mean stiffness that holds a feature where its surface does not, as along a cylinder."""


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


def lay_onto(new: NewObject, place: Rows, features: Sequence[HeldFeature], metric: Metric) -> list[Fit]:
    """Return how features lie about a place of a new object; those that enclose nothing are left out."""
    poses, _ = aligned(new.part(place), [feature.part for feature in features])
    matrices = np.linalg.inv(poses.matrices())
    fits = []
    for feature, starts in zip(features, matrices, strict=True):
        # What is nearly alike both ways round, as a handle is, shows only on the whole object which fits.
        tried = [_settled(new, feature.part, start, STEPS[0]) for start in starts]
        best = min(tried, key=lambda pose: _nearest_mean(_apart(new, feature.part, pose)))
        fit = _judge(new, feature, _settled(new, feature.part, best, STEPS[1]), metric)
        if fit is not None:
            fits.append(fit)
    return fits


def _moved(points: Floats, pose: Floats) -> Floats:
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def _facing(new: NewObject, points: Floats, normals: Floats) -> tuple[Floats, Rows]:
    """Return distances to the nearest points that face the same way, at most `REACH`, and their rows."""
    found = new.tree.query(points)
    apart, rows = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    facing = np.einsum("ni,ni->n", new.cloud.normals[rows], normals) > 0
    # Few points lie nearest to a surface that faces away, as across a thin wall; those look further.
    across = np.flatnonzero(~facing & (apart < REACH))
    if len(across):
        k = min(NEIGHBOURS, len(new.cloud.points))
        more = new.tree.query(points[across], k=np.arange(1, k + 1))
        alike = np.einsum("nki,ni->nk", new.cloud.normals[more[1]], normals[across]) > 0
        further = np.where(alike, more[0], REACH)
        best, every = further.argmin(axis=1), np.arange(len(across))
        apart[across], rows[across] = further[every, best], more[1][every, best]
    return np.minimum(apart, REACH), rows


def _settled(new: NewObject, part: Part, pose: Floats, steps: int) -> Floats:
    """Return a pose after steps of point-to-plane iterated closest points, the furthest left out."""
    points, normals = part.scored, part.scored_normals
    for _ in range(steps):
        moved, turned = _moved(points, pose), normals @ pose[:3, :3].T
        apart, rows = _facing(new, moved, turned)
        near = np.argsort(apart, kind="stable")[: int(np.ceil(TRIMMED * len(apart)))]
        planes = new.cloud.normals[rows[near]]
        centre = moved[near].mean(axis=0)
        arms = moved[near] - centre
        off = np.einsum("ni,ni->n", new.cloud.points[rows[near]] - moved[near], planes)
        reach = np.sqrt((arms**2).sum(axis=1).mean()) + 1e-9  # so that turns and shifts weigh alike
        slopes = np.concatenate([np.cross(arms / reach, planes), planes], axis=1)
        stiffness = slopes.T @ slopes
        stiffness += STILL * np.trace(stiffness) / 6 * np.eye(6)
        step = np.linalg.solve(stiffness, slopes.T @ off)
        turn = Rotation.from_rotvec(step[:3] / reach).as_matrix()
        change = np.eye(4)
        change[:3, :3], change[:3, 3] = turn, centre - turn @ centre + step[3:]
        pose = change @ pose
        if np.abs(step).max() < AT_REST:
            break
    return pose


def _apart(new: NewObject, part: Part, pose: Floats) -> Floats:
    return _facing(new, _moved(part.scored, pose), part.scored_normals @ pose[:3, :3].T)[0]


def _nearest_mean(apart: Floats) -> float:
    return float(np.sort(apart)[: int(np.ceil(TRIMMED * len(apart)))].mean())


def _judge(new: NewObject, feature: HeldFeature, pose: Floats, metric: Metric) -> Fit | None:
    part = feature.part
    apart = _apart(new, part, pose)
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
        trimmed=_nearest_mean(apart),
        contacts_on=float(np.mean(on)),
        penetration=float(max(deeper.max(), 0.0)),
        n_inside=int((deeper > DEPTH).sum()),
    )
