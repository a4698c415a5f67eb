"""A hand pose that touches an object where it should: damped least squares on all degrees of freedom."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from graspdb.simulate.arrays import Floats
from graspdb.simulate.planning import FLESH_DEPTH, FOREARM_LENGTH, PlanningHand
from graspdb.simulate.surface import Surface
from graspdb_schemas.vocabulary import N_SITES, SITES

TOUCH_SD = 0.0003
"""Tightness with which chosen spheres are drawn to the surface, and all are kept out of it [m]."""

PLACE_SD = 0.012
"""Freedom of the wrist and the knuckles about the place that the plan gives them [m]."""

GIVE_UP = 0.15
"""A sphere that cannot reach the surface pulls with no more than the inverse of this."""

PAD_SD = 0.1
PAD_COSINE = 0.35
"""A touching sphere has the surface at least this much on its palmar side."""


@dataclass(frozen=True)
class Intent:
    """What a hand is to do: where it comes from, and what it is to touch with.

    Attributes
    ----------
    contacts : tuple of str
        Sites that are to touch.
    posture, posture_sd : ndarray, shape (23,)
        Joint angles to stay near, and how near [rad].
    knuckles : ndarray, shape (3, 3)
        Wanted places of wrist, index_mcp and little_mcp in the object's frame [m].
    elevation : float
        Wanted slope of the forearm, positive with the elbow higher than the wrist [rad].
    aims : mapping of str to ndarray
        Wanted places of particular sites in the object's frame [m].
    target : Surface or None
        The part of the object that is to be touched; None for all of it.
    """

    contacts: tuple[str, ...]
    posture: Floats
    posture_sd: Floats
    knuckles: Floats
    elevation: float
    aims: Mapping[str, Floats] = field(default_factory=dict)
    target: Surface | None = None


@dataclass(frozen=True)
class Linear:
    """Residuals and their Jacobian, each row weighted by its own standard deviation."""

    residual: Floats
    jacobian: Floats


def solve(
    hand: PlanningHand, surface: Surface, intent: Intent, start: Floats, iterations: int = 40
) -> Floats:
    """Return the configuration, shape (30,), that best does what is intended, from a start.

    Levenberg and Marquardt's damped least squares on the manifold; joint limits are kept by
    clipping each step. The pull of the contacts tightens from 4 mm to `TOUCH_SD` on the way.
    """
    q = start
    damping = 1e-2
    current: Linear | None = None
    for i in range(iterations):
        touch_sd = max(TOUCH_SD, 0.004 * 0.75**i)
        if current is None or touch_sd > TOUCH_SD:
            current = _linearise(hand, surface, intent, q, touch_sd)
        normal = current.jacobian.T @ current.jacobian
        gradient = current.jacobian.T @ current.residual
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1.0), gradient)
        step *= min(1.0, 0.35 / float(np.abs(step[3:]).max()))
        candidate = clipped(hand, hand.hand.integrate(q, step))
        trial = _linearise(hand, surface, intent, candidate, touch_sd)
        before, after = (float(x.residual @ x.residual) for x in (current, trial))
        if after < before:
            q, current, damping = candidate, trial, max(damping / 4, 1e-6)
            if touch_sd == TOUCH_SD and before - after < 1e-5 * before:
                break
        else:
            damping = min(damping * 6, 1e4)
    return q


def clipped(hand: PlanningHand, q: Floats) -> Floats:
    """Return a configuration with its hinges inside their limits."""
    limits = hand.hand.joint_range
    q = q.copy()
    q[7:] = np.clip(q[7:], limits[:, 0] + 1e-3, limits[:, 1] - 1e-3)
    return q


def _linearise(hand: PlanningHand, surface: Surface, intent: Intent, q: Floats, touch_sd: float) -> Linear:
    hand.move(q)
    points, jacobian = hand.points(), hand.jacobian()
    rows = [
        _touch_rows(hand, intent.target or surface, intent, points, jacobian, touch_sd),
        _outside_rows(hand, surface, points, jacobian),
        _apart_rows(hand, points, jacobian),
        _table_rows(hand, points, jacobian),
        _place_rows(intent, points, jacobian),
        _posture_rows(intent, q),
    ]
    return Linear(np.concatenate([r.residual for r in rows]), np.concatenate([r.jacobian for r in rows]))


def _touch_rows(
    hand: PlanningHand,
    target: Surface,
    intent: Intent,
    points: Floats,
    jacobian: Floats,
    touch_sd: float,
) -> Linear:
    """Return: chosen spheres touch what they are to touch, with their palmar side."""
    sites = np.array([SITES.index(site) for site in intent.contacts])
    dorsal, dorsal_jacobian = hand.dorsal(sites)
    near = target.nearest(points[sites])
    gap = near.distance - hand.radii[sites]
    pull = 1 / np.hypot(touch_sd, np.maximum(gap, 0) * GIVE_UP)
    cosine = np.einsum("ki,ki->k", near.normal, dorsal)
    turned = cosine < PAD_COSINE
    slope = np.einsum("ki,kij->kj", near.normal, jacobian[sites]) * pull[:, None]
    cosine_slope = np.einsum("ki,kij->kj", near.normal[turned], dorsal_jacobian[turned])
    return Linear(
        np.concatenate([gap * pull, (cosine[turned] - PAD_COSINE) / PAD_SD]),
        np.concatenate([slope, cosine_slope / PAD_SD]),
    )


def _outside_rows(hand: PlanningHand, surface: Surface, points: Floats, jacobian: Floats) -> Linear:
    """Return: no sphere goes into the object, flesh by no more than it gives."""
    solid = hand.n_solid
    near = surface.nearest(points[:solid])
    allowed = np.where(np.arange(solid) < N_SITES, 0.0, FLESH_DEPTH)
    depth = near.distance - hand.radii[:solid] + allowed
    inside = np.flatnonzero(depth < 0)
    slope = np.einsum("ki,kij->kj", near.normal[inside], jacobian[inside])
    return Linear(depth[inside] / TOUCH_SD, slope / TOUCH_SD)


def _apart_rows(hand: PlanningHand, points: Floats, jacobian: Floats) -> Linear:
    """Return: digits do not run into each other."""
    digit = hand.digit_of_point
    free = np.flatnonzero((digit >= 0) & (np.arange(len(points)) < hand.n_solid))
    first, second = np.triu_indices(len(free), k=1)
    first, second = free[first], free[second]
    different = digit[first] != digit[second]
    first, second = first[different], second[different]
    between = points[first] - points[second]
    distance = np.linalg.norm(between, axis=1)
    room = distance - hand.radii[first] - hand.radii[second] + 0.001
    close = room < 0
    direction = between[close] / np.maximum(distance[close, None], 1e-6)
    slope = np.einsum("ki,kij->kj", direction, jacobian[first[close]] - jacobian[second[close]])
    return Linear(room[close] / 0.001, slope / 0.001)


def _table_rows(hand: PlanningHand, points: Floats, jacobian: Floats) -> Linear:
    """Return: the whole arm stays above the table z = 0."""
    height = points[:, 2] - hand.radii - 0.003
    low = height < 0
    return Linear(height[low] / 0.001, jacobian[low, 2] / 0.001)


def _place_rows(intent: Intent, points: Floats, jacobian: Floats) -> Linear:
    """Return: wrist and knuckles near their places, the forearm at its slope."""
    wrist, forearm = len(points) - 2, len(points) - 1
    three = [wrist, SITES.index("index_mcp"), SITES.index("little_mcp")]
    three += [SITES.index(site) for site in intent.aims]
    wanted = np.vstack([intent.knuckles, *(aim[None] for aim in intent.aims.values())])
    residual = (points[three] - wanted).ravel() / PLACE_SD
    slope = (points[forearm, 2] - points[wrist, 2]) / FOREARM_LENGTH - np.sin(intent.elevation)
    slope_jacobian = (jacobian[forearm, 2] - jacobian[wrist, 2]) / FOREARM_LENGTH
    return Linear(
        np.append(residual, slope / 0.15),
        np.vstack([jacobian[three].reshape(len(residual), -1) / PLACE_SD, slope_jacobian[None] / 0.15]),
    )


def _posture_rows(intent: Intent, q: Floats) -> Linear:
    """Return: joint angles near the posture; the free joint's columns are zero."""
    jacobian = np.zeros((23, 29))
    jacobian[:, 6:] = np.diag(1 / intent.posture_sd)
    return Linear((q[7:] - intent.posture) / intent.posture_sd, jacobian)
