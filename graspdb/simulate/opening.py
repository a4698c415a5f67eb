"""Opening: how far the hand opens around an object, and which way it can leave it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb.simulate.arrays import Floats
from graspdb.simulate.closing import chain
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb.simulate.surface import Surface
from graspdb_schemas.vocabulary import FINGERS, JOINT_ANGLES, N_SITES, SITES, Side

WIDE_OPEN: Final[dict[str, float]] = {
    "thumb_cmc_abduction": 45,
    "thumb_cmc_flexion": -15,
    "thumb_mcp_flexion": 5,
    "thumb_ip_flexion": 5,
    **{f"{finger}_mcp_flexion": 12 for finger in FINGERS},
    **{f"{finger}_pip_flexion": 15 for finger in FINGERS},
    **{f"{finger}_dip_flexion": 8 for finger in FINGERS},
}
"""The hand as far open as a reach opens it [degrees]."""

Angles = dict[int, float]

THUMB_ASIDE: Final[dict[str, float]] = {
    "thumb_cmc_abduction": -15,
    "thumb_cmc_flexion": -40,
    "thumb_mcp_flexion": 0,
    "thumb_ip_flexion": 0,
}
"""The thumb out of the way of a bar that leaves the hooked fingers [degrees]."""

SITE_LIMIT: Final = 0.0005
"""How deep the object presses into a sphere at most [m]."""

THUMB_OFF: Final = 0.03
"""How far the thumb's tip moves straight off the surface where that clears the way [m]."""

SHARES: Final = (0.3, 0.45, 0.65, 0.85, 1.0)
"""How far to open, tried in this order."""

HOOK_SHARES: Final = (0.1, 0.2, 0.3, 0.4)
"""The same for fingers that hook around a bar and leave it in the direction in which they point."""

WAYS: Final = (
    (-1, 0, 0), (-1, 0, 0.5), (-1, 0, 1), (-0.5, 0, 1), (0, 0, 1), (-1, 0.4, 0.4), (-1, -0.4, 0.4),
    (-0.5, 0.5, 1), (-0.5, -0.5, 1), (0, 1, 0.5), (-1, 1, 0), (-1, -1, 0), (0, 1, 0), (-1, 0, -0.4),
)  # fmt: skip
"""Ways out in the hand's frame (distal, radial, dorsal), tried in this order: backwards first."""

HOOK_WAYS: Final = (
    (1, 0, 0), (1, 0, 0.3), (1, 0, -0.3), (1, 0.3, 0), (1, -0.3, 0), (1, 0.3, 0.3), (1, 0.3, -0.3),
    (1, 0, 0.6),
)  # fmt: skip
"""The same for hooked fingers."""

DISTANCES: Final = np.array([0.004, 0.01, 0.018, 0.028, 0.04, 0.055, 0.075, 0.10, 0.13, 0.16])
"""Where on its way out the hand is looked at [m]."""


@dataclass(frozen=True)
class Opening:
    """An opened hand, and its way out.

    Attributes
    ----------
    q : ndarray, shape (30,)
        The opened hand where the grasp is.
    way_out : ndarray, shape (3,)
        Direction in which it leaves, a unit vector in the object's frame.
    """

    q: Floats
    way_out: Floats


def find_opening(
    hand: PlanningHand, surface: Surface, grasp: Floats, digits: tuple[str, ...]
) -> Opening | None:
    """Return the least opening from which the hand can leave in a straight line; None without one.

    Parameters
    ----------
    hand : PlanningHand
        The hand.
    surface : Surface
        The object.
    grasp : ndarray, shape (30,)
        The grasping hand.
    digits : tuple of str
        The digits that hold the object; the others stay as they are.
    """
    aside = _goal("thumb", THUMB_ASIDE)
    off = _thumb_off(hand, surface, grasp)
    manners = (
        (SHARES, WAYS, None),
        (HOOK_SHARES, HOOK_WAYS, aside),
        (HOOK_SHARES, HOOK_WAYS, off),
        (HOOK_SHARES, HOOK_WAYS, {place: (off[place] + angle) / 2 for place, angle in aside.items()}),
    )
    for shares, directions, thumb in manners:
        ways = _turned(hand, grasp, directions)
        opening = _least_opening(hand, surface, grasp, digits, shares, ways, thumb)
        if opening is not None:
            return opening
    return None


def _least_opening(
    hand: PlanningHand,
    surface: Surface,
    grasp: Floats,
    digits: tuple[str, ...],
    shares: tuple[float, ...],
    ways: Floats,
    thumb: Angles | None,
) -> Opening | None:
    """Return the least opening with a way out; the thumb goes all the way to `thumb` if that is given."""
    for share in shares:
        q = _opened(hand, grasp, digits, share, thumb)
        if not is_free(hand, surface, between(grasp, q)):
            continue
        points = hand.points_of(q[None])[0, : hand.n_solid]
        path = points + (ways[:, None] * DISTANCES[:, None])[:, :, None]
        gap = surface.distance(path) - hand.radii[: hand.n_solid]
        above = path[..., 2] > hand.radii[: hand.n_solid]
        clear = np.flatnonzero(((gap > -allowed_depth(hand)) & above).all(axis=(1, 2)))
        if len(clear):
            return Opening(q, ways[clear[0]])
    return None


def _opened(
    hand: PlanningHand, grasp: Floats, digits: tuple[str, ...], share: float, thumb: Angles | None
) -> Floats:
    """Return a grasping hand with its digits part of the way to wide open; fingers only ever extend."""
    limits = hand.hand.joint_range
    q = grasp.copy()
    for digit in digits:
        if digit == "thumb":
            goal = thumb or {
                place: q[place] + share * (angle - q[place])
                for place, angle in _goal(digit, WIDE_OPEN).items()
            }
        else:
            goal = {
                place: q[place] + share * min(0.0, angle - q[place])
                for place, angle in _goal(digit, WIDE_OPEN).items()
            }
        q[list(goal)] = list(goal.values())
    q[7:] = np.clip(q[7:], limits[:, 0], limits[:, 1])
    return q


def _goal(digit: str, degrees: dict[str, float]) -> Angles:
    """Return the angles [rad] that a posture gives a digit, by their places in a configuration."""
    names = {int(place): JOINT_ANGLES[place - 7] for place in chain(digit).joints}
    return {place: float(np.deg2rad(degrees[name])) for place, name in names.items() if name in degrees}


def _thumb_off(hand: PlanningHand, surface: Surface, grasp: Floats) -> Angles:
    """Return angles that move the thumb's tip straight off the surface, as far as they can."""
    hand.move(grasp)
    tip, joints = SITES.index("thumb_tip"), chain("thumb").joints
    normal = surface.nearest(hand.points()[tip][None]).normal[0]
    jacobian = hand.jacobian()[tip][:, joints - 1]
    step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-5 * np.eye(3), THUMB_OFF * normal)
    limits = hand.hand.joint_range[joints - 7]
    angles = np.clip(grasp[joints] + np.clip(step, -0.8, 0.8), limits[:, 0], limits[:, 1])
    return dict(zip(joints.tolist(), angles.tolist(), strict=True))


def between(first: Floats, last: Floats, n: int = 6) -> Floats:
    """Return n configurations from just after the first to the last, shape (n, 30)."""
    return first + (last - first) * np.linspace(0, 1, n + 1)[1:, None]


def allowed_depth(hand: PlanningHand) -> Floats:
    """Return how deep the object may press into each of the solid spheres [m], shape (n_solid,)."""
    return np.where(np.arange(hand.n_solid) < N_SITES, SITE_LIMIT, FLESH_LIMIT)


def is_free(hand: PlanningHand, surface: Surface, path: Floats) -> bool:
    """Return whether no sphere is in the object in any of some configurations, shape (n, 30)."""
    points = hand.points_of(path)[:, : hand.n_solid]
    gap = surface.distance(points) - hand.radii[: hand.n_solid]
    return bool((gap > -allowed_depth(hand)).all())


def _turned(hand: PlanningHand, q: Floats, directions: tuple[tuple[float, float, float], ...]) -> Floats:
    """Return directions of the hand's frame, mirrored for a left hand, as unit vectors of the object's."""
    rotation = Rotation.from_matrix(hand.hand.forward(q).rotations[1])
    mirror = np.array([1.0, 1.0 if hand.side is Side.RIGHT else -1.0, 1.0])
    ways = rotation.apply(np.array(directions, dtype=float) * mirror)
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))
