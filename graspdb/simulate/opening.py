"""Opening: how far the hand opens around an object, and which way it can leave it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb.simulate.closing import chain
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb.simulate.surface import Surface
from graspdb_schemas.vocabulary import FINGERS, JOINT_ANGLES, N_SITES, Side

Floats = NDArray[np.float64]

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

THUMB_ASIDE: Final[dict[str, float]] = {
    "thumb_cmc_abduction": -15,
    "thumb_cmc_flexion": -40,
    "thumb_mcp_flexion": 0,
    "thumb_ip_flexion": 0,
}
"""The thumb out of the way of a bar that leaves the hooked fingers [degrees]."""

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
    (1, 0, 0), (1, 0, 0.3), (1, 0, -0.3), (1, 0.3, 0), (1, -0.3, 0), (1, 0.3, 0.3), (1, 0.3, -0.3), (1, 0, 0.6),
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
    for shares, directions in ((SHARES, WAYS), (HOOK_SHARES, HOOK_WAYS)):
        opening = _least_opening(hand, surface, grasp, digits, shares, _turned(hand, grasp, directions))
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
) -> Opening | None:
    for share in shares:
        q = _opened(hand, grasp, digits, share, hooked=shares is HOOK_SHARES)
        if not is_free(hand, surface, between(grasp, q)):
            continue
        points = hand.points_of(q[None])[0, : hand.n_solid]
        path = points + (ways[:, None] * DISTANCES[:, None])[:, :, None]
        gap = surface.distance(path) - hand.radii[: hand.n_solid]
        above = path[..., 2] > hand.radii[: hand.n_solid]
        clear = np.flatnonzero(((gap > -FLESH_LIMIT) & above).all(axis=(1, 2)))
        if len(clear):
            return Opening(q, ways[clear[0]])
    return None


def _opened(hand: PlanningHand, grasp: Floats, digits: tuple[str, ...], share: float, hooked: bool) -> Floats:
    """Return a grasping hand with its digits part of the way to wide open."""
    limits = hand.hand.joint_range
    q = grasp.copy()
    for digit in digits:
        aside = hooked and digit == "thumb"
        goal = THUMB_ASIDE if aside else WIDE_OPEN
        for place in chain(digit).joints:
            joint = JOINT_ANGLES[place - 7]
            if joint in goal:
                wanted = np.deg2rad(goal[joint])
                if digit != "thumb":
                    wanted = min(wanted, q[place])
                q[place] += (1.0 if aside else share) * (wanted - q[place])
    q[7:] = np.clip(q[7:], limits[:, 0], limits[:, 1])
    return q


def between(first: Floats, last: Floats, n: int = 6) -> Floats:
    """Return n configurations from just after the first to the last, shape (n, 30)."""
    return first + (last - first) * np.linspace(0, 1, n + 1)[1:, None]


def is_free(hand: PlanningHand, surface: Surface, path: Floats) -> bool:
    """Return whether no sphere is in the object in any of some configurations, shape (n, 30)."""
    points = hand.points_of(path)[:, : hand.n_solid]
    gap = surface.distance(points) - hand.radii[: hand.n_solid]
    deepest = gap.min(axis=0)
    return bool((deepest[:N_SITES] > -0.0005).all() and (deepest[N_SITES:] > -FLESH_LIMIT).all())


def _turned(hand: PlanningHand, q: Floats, directions: tuple[tuple[float, float, float], ...]) -> Floats:
    """Return directions of the hand's frame, mirrored for a left hand, as unit vectors of the object's."""
    rotation = Rotation.from_matrix(hand.hand.forward(q).rotations[1])
    mirror = np.array([1.0, 1.0 if hand.side is Side.RIGHT else -1.0, 1.0])
    ways = rotation.apply(np.array(directions, dtype=float) * mirror)
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))
