"""An object's pose from depth-camera clouds: its model registered to each, point to plane.

This is what the paper announces in place of markers on the object: real-time data of depth sensors. The
registration is iterative (Chen and Medioni 1992) from the pose of the cloud before, with weights that
leave out what is not the object; it draws no random numbers.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.parameters import RegistrationParameters
from graspdb_ingest.rigid import Array

ITERATIONS: Final = 60
MOST_POINTS: Final = 3000
"""Points of a cloud that are used, taken evenly: more tell hardly more and take longer."""
KERNEL: Final = (0.006, 0.001)
"""Least width of the weights' kernel, from the first rounds to the last [m]: a part of the object that is
still off its place must not be taken for something else."""
SHRINK: Final = 0.85
TRIED: Final = 4
"""Of the 24 beginnings without a pose, the best that are registered to the end."""
SEEN: Final = (0.3, -0.2)
"""Least length of the mean normal of what a cloud shows, for one camera to have seen it: 0.5 is half a ball,
0 all of one. And least cosine between that direction and the normal of a point that may have been seen."""
SAME_PLANE: Final = 0.5
"""Least cosine between the normals of two partners, where the cloud has normals."""
LEAST_POINTS: Final = 20
"""Points of a cloud near the model below which no pose is told."""


@dataclass(frozen=True, eq=False)
class Registration:
    """The pose of an object in one cloud.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        world_from_object rotation; NaN where no pose is told.
    position : ndarray, shape (3,)
        Origin of the object frame in the lab frame [m].
    fitness : float
        Share of the points within reach that lie on the model.
    residual : float
        Root mean square distance of these to its surface [m].
    reason : str or None
        Why there is no pose.
    """

    rotation: Array
    position: Array
    fitness: float
    residual: float
    reason: str | None = None


def register(
    model: ObjectCloud,
    points: Array,
    rotation: Array,
    position: Array,
    parameters: RegistrationParameters | None = None,
    normals: Array | None = None,
) -> Registration:
    """Register a model to a cloud of it, from a pose nearby.

    In each round every point of the cloud within reach is paired with the nearest of the model, and the
    pose moves so that the points come to lie in the planes of their partners, by least squares with
    Tukey's weights. A camera sees one side: the model's other points have no partner and do not count,
    or a thin part, a handle, that has moved by more than its thickness would be drawn to its back.

    Parameters
    ----------
    model : ObjectCloud
        The object's surface in its own frame.
    points : ndarray, shape (n, 3)
        The cloud in the lab frame [m]; points that are not finite are left out.
    rotation, position : ndarray, shapes (3, 3) and (3,)
        Pose world_from_object to begin with.
    parameters : RegistrationParameters, optional
        When there is a pose.
    normals : ndarray, shape (n, 3), optional
        Normals of the cloud, of either sign: then points whose planes differ by more than 60 degrees are no
        partners, as those of a face that the model does not have yet.

    Returns
    -------
    Registration
        The pose with its fitness, or the reason why there is none: no finite points, none near the model,
        too few, or a fit that is too poor.
    """
    parameters = parameters or RegistrationParameters()
    usable = np.flatnonzero(np.isfinite(points).all(axis=1))
    if not len(usable):
        return no_pose("the cloud has no finite point")
    usable = usable[:: max(1, len(usable) // MOST_POINTS)]
    finite = points[usable]
    planes = None if normals is None else normals[usable]
    turn, shift = rotation.copy(), position.copy()
    side = _Side(model.tree, np.arange(len(model.points)))
    for number in range(ITERATIONS):
        within = (finite - shift) @ turn
        kernel = max(KERNEL[1], KERNEL[0] * SHRINK**number)
        if kernel > KERNEL[1]:
            side = _seen_side(model, within, parameters.reach)
        distance, partner = side.partners(within, parameters.reach)
        near = np.flatnonzero(np.isfinite(distance))
        if planes is not None:
            alike = np.einsum("ni,ni->n", planes[near] @ turn, model.normals[partner[near]])
            near = near[np.abs(alike) > SAME_PLANE]
        if len(near) < LEAST_POINTS:
            found = "no point" if not len(near) else f"{len(near)} points"
            return no_pose(f"{found} of the cloud within {1e3 * parameters.reach:g} mm of the object")
        there, out = model.points[partner[near]], model.normals[partner[near]]
        step = _step(within[near], there, out, kernel)
        if step is None:
            return no_pose("the points near the object do not fix its pose")
        small, move = Rotation.from_rotvec(-step[:3]).as_matrix(), step[3:]
        # within' = small' (within + move) in the object frame, so the pose changes by the inverse
        shift, turn = shift - turn @ move, turn @ small
        if kernel == KERNEL[1] and np.linalg.norm(step[:3]) < 1e-5 and np.linalg.norm(move) < 1e-6:
            break
    return _judged(model, finite, turn, shift, parameters)


@dataclass(frozen=True, eq=False)
class _Side:
    """Points of a model that may have been seen: a search tree of them, and their places in the model."""

    tree: cKDTree
    places: NDArray[np.int64]

    def partners(self, points: Array, reach: float) -> tuple[Array, NDArray[np.int64]]:
        """Return distance and place of the nearest of them; infinite and any where none is within reach."""
        distance, nearest = self.tree.query(points, distance_upper_bound=reach)
        return np.asarray(distance), self.places[np.minimum(nearest, len(self.places) - 1)]


def _seen_side(model: ObjectCloud, points: Array, reach: float) -> _Side:
    """Return the side of a model that a cloud shows, by the mean normal of the points nearest to it."""
    everything = _Side(model.tree, np.arange(len(model.points)))
    distance, partner = everything.partners(points, reach)
    near = partner[np.isfinite(distance)]
    if not len(near):
        return everything
    direction = model.normals[near].mean(axis=0)
    length = float(np.linalg.norm(direction))
    if length < SEEN[0]:
        return everything
    places = np.flatnonzero(model.normals @ direction > SEEN[1] * length)
    return _Side(cKDTree(model.points[places]), places)


def _step(points: Array, there: Array, normals: Array, kernel: float) -> Array | None:
    """Return the small rotation [rad] and movement [m] that bring points to their partners' planes."""
    off = np.einsum("ni,ni->n", there - points, normals)
    spread = max(1.4826 * float(np.median(np.abs(off))), kernel)
    weights = np.clip(1 - (off / (4.685 * spread)) ** 2, 0, None) ** 2
    scale = max(float(np.linalg.norm(points, axis=1).max()), 1e-6)
    columns = np.concatenate([np.cross(points, normals) / scale, normals], axis=1)
    weighted = columns * weights[:, None]
    moments = weighted.T @ columns
    # A sphere may turn and a plane slide without a difference: such directions stay as they were.
    values, axes = np.linalg.eigh(moments)
    told = values > 1e-5 * values[-1]
    if values[-1] <= 0:
        return None
    solution = axes[:, told] @ ((axes[:, told].T @ (weighted.T @ off)) / values[told])
    solution[:3] /= scale
    return np.asarray(solution)


def _judged(
    model: ObjectCloud, points: Array, turn: Array, shift: Array, parameters: RegistrationParameters
) -> Registration:
    within = (points - shift) @ turn
    distance, partner = _seen_side(model, within, parameters.reach).partners(within, parameters.reach)
    near = np.flatnonzero(np.isfinite(distance))
    if len(near) < LEAST_POINTS:
        return no_pose("the registration leads away from the cloud")
    pairs = partner[near]
    off = np.einsum("ni,ni->n", model.points[pairs] - within[near], model.normals[pairs])
    spread = max(1.4826 * float(np.median(np.abs(off))), 2e-4)
    good = np.abs(off) < 3 * spread
    fitness, residual = float(good.mean()), float(np.sqrt(np.mean(off[good] ** 2)))
    if fitness < parameters.minimum_fitness:
        return no_pose(f"only {fitness:.0%} of the points near the object lie on it", fitness, residual)
    if residual > parameters.maximum_residual:
        return no_pose(f"the points lie {1e3 * residual:.1f} mm from the object (rms)", fitness, residual)
    return Registration(turn, shift, fitness, residual)


def no_pose(reason: str, fitness: float = 0.0, residual: float = float("nan")) -> Registration:
    """Return that a cloud tells no pose, and why."""
    return Registration(np.full((3, 3), np.nan), np.full(3, np.nan), fitness, residual, reason)


def first_pose(model: ObjectCloud, points: Array, parameters: RegistrationParameters) -> Registration:
    """Register a model to a cloud without a pose to begin with.

    The cloud's middle and principal axes against those of the model, in all turns by quarters, give
    24 beginnings; the registration that most of the points lie on counts.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) < LEAST_POINTS:
        return no_pose("the cloud has no finite point" if not len(finite) else "the cloud has too few points")
    few = finite[:: max(1, len(finite) // 400)]
    axes, own = _principal(few), _principal(model.points)
    middle = model.points.mean(axis=0)
    rough = []
    for turn in Rotation.create_group("O").as_matrix():
        rotation = axes @ turn @ own.T
        # the visible side is nearer than the object's middle; a wide reach finds it
        start = few.mean(axis=0) - rotation @ middle
        result = register(model, few, rotation, start, RegistrationParameters(0.06, 0.0, np.inf))
        if result.reason is None:
            rough.append(result)
    rough.sort(key=lambda result: mean_distance(model, few, result))
    found = [register(model, few, r.rotation, r.position, parameters) for r in rough[:TRIED]]
    good = [result for result in found if result.reason is None]
    if not good:
        return no_pose("no beginning leads to a pose")
    best = min(good, key=lambda result: mean_distance(model, few, result))
    return register(model, finite, best.rotation, best.position, parameters)


def mean_distance(model: ObjectCloud, points: Array, result: Registration) -> float:
    """Return how far the points lie from the model on average, each counting at most 10 mm [m]."""
    distance = model.tree.query((points - result.position) @ result.rotation)[0]
    return float(np.mean(np.minimum(distance, 0.01)))


def _principal(points: Array) -> Array:
    """Return principal axes as a right-handed rotation, shape (3, 3)."""
    axes = np.linalg.eigh(np.cov(points.T))[1]
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return np.asarray(axes)
