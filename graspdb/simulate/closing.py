"""Closing: each digit moves from open until its spheres touch the real surface, joint after joint."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.simulate.arrays import Floats
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb.simulate.surface import Surface
from graspdb_schemas.vocabulary import DIGITS, JOINT_ANGLES, JOINTS_OF_DIGIT, N_SITES

Integers = NDArray[np.int64]

OVERSHOOT: Final = 1.2
"""How far along the way to the planned posture, and beyond, a digit goes that touches nothing."""

COARSE: Final = 60
FINE: Final = 24
"""Steps along the way, and of each of the two refinements of the step in which a sphere touches."""


@dataclass(frozen=True)
class Chain:
    """A digit as closing sees it; level 0, 1, 2 are its joints from the palm outwards.

    Attributes
    ----------
    joints, joint_levels : ndarray
        Places of its angles in a configuration, and their levels.
    spheres, sphere_levels : ndarray, shape (6,)
        Planning points that it moves, and the last level that moves each.
    """

    joints: Integers
    joint_levels: Integers
    spheres: Integers
    sphere_levels: Integers


def chain(digit: str) -> Chain:
    """Return a digit's joints and spheres."""
    number, names = DIGITS.index(digit), JOINTS_OF_DIGIT[digit]
    own = [(7 + i, joint.split("_")[1]) for i, joint in enumerate(JOINT_ANGLES) if joint.startswith(digit)]
    return Chain(
        joints=np.array([place for place, _ in own]),
        joint_levels=np.array([names.index(name) for _, name in own]),
        spheres=np.array(
            [*range(4 * number + 1, 4 * number + 4), *range(N_SITES + 3 * number, N_SITES + 3 * number + 3)]
        ),
        sphere_levels=np.array([0, 1, 2, 0, 1, 2]),
    )


def close(
    hand: PlanningHand, surface: Surface, opened: Floats, planned: Floats, digits: Iterable[str]
) -> Floats:
    """Return the configuration in which digits have closed on the surface, shape (30,).

    Each digit moves along the line from its opened to its planned angles and on beyond it. Where
    a sphere touches, the joints between it and the palm stop; the joints beyond it go on until
    their own spheres touch. The palm stays where it is.

    Parameters
    ----------
    hand : PlanningHand
        The hand.
    surface : Surface
        The object, in the frame of the configurations.
    opened, planned : ndarray, shape (30,)
        Before closing, free of the surface; and as planned.
    digits : iterable of str
        The digits that close.
    """
    q = opened.copy()
    for digit in digits:
        q = _close_digit(hand, surface, q, planned, chain(digit))
    return q


def _close_digit(hand: PlanningHand, surface: Surface, q: Floats, planned: Floats, digit: Chain) -> Floats:
    stops = np.full(len(digit.joints), OVERSHOOT)
    share = 0.0
    while (moving := stops >= OVERSHOOT).any() and share < OVERSHOOT:
        watched = digit.sphere_levels >= digit.joint_levels[moving].min()
        share, level = _first_touch(hand, surface, q, planned, digit, stops, share, watched)
        stops = np.where((digit.joint_levels <= level) & moving, share, stops)
    closed: Floats = _along(hand, q, planned, digit, stops[None])[0]
    return closed


def _along(hand: PlanningHand, q: Floats, planned: Floats, digit: Chain, shares: Floats) -> Floats:
    """Return configurations with each of the digit's joints at its share of the way, shape (n, 30)."""
    joints = digit.joints
    low, high = hand.hand.joint_range[joints - 7].T
    batch = np.repeat(q[None], len(shares), axis=0)
    batch[:, joints] = np.clip(q[joints] + shares * (planned[joints] - q[joints]), low, high)
    return batch


def _first_touch(
    hand: PlanningHand,
    surface: Surface,
    q: Floats,
    planned: Floats,
    digit: Chain,
    stops: Floats,
    share: float,
    watched: NDArray[np.bool_],
) -> tuple[float, int]:
    """Return the share at which the first watched sphere touches, and its level."""
    spheres = digit.spheres[watched]
    clearance = hand.radii[spheres] - np.where(spheres < N_SITES, 0.0, FLESH_LIMIT)
    low, high = share, OVERSHOOT
    level = 2
    for steps in (COARSE, FINE, FINE):
        shares = np.linspace(low, high, steps)
        batch = _along(hand, q, planned, digit, np.minimum(shares[:, None], stops))
        inside = surface.distance(hand.points_of(batch)[:, spheres]) < clearance
        hits = np.flatnonzero(inside[1:].any(axis=1)) + 1
        if not len(hits):
            return OVERSHOOT, level
        low, high = shares[hits[0] - 1], shares[hits[0]]
        level = int(digit.sphere_levels[watched][inside[hits[0]]].max())
    return float(low), level
