"""The wrist's way to an object: a curve that ends straight along the hand's way in."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import comb
from typing import Final

import numpy as np

from graspdb.simulate.arrays import Floats

STRAIGHT: Final = (0.06, 0.10, 0.14)
"""Distances between the last three control points, which lie on the way in [m]."""

RISES: Final = (0.06, 0.14, 0.24)
"""Heights of the arch, tried in this order [m]."""

ASIDE: Final = (0.0, 0.10, 0.20)
"""How far the curve swings to the back of the hand before the way in [m]."""

COARSE: Final = 21
FINE: Final = 81
"""Points at which a curve is looked at, first and then."""


@dataclass(frozen=True)
class Curve:
    """A Bezier curve; control points of shape (n, 3) [m]."""

    control: Floats

    def at(self, share: Floats) -> Floats:
        """Return points at shares of the way, shape (len(share), 3)."""
        n = len(self.control) - 1
        s = share[:, None]
        weights = [comb(n, i) * s**i * (1 - s) ** (n - i) for i in range(n + 1)]
        return np.asarray(np.hstack(weights) @ self.control)


def find_path(
    start: Floats, end: Floats, way_out: Floats, back: Floats, depth: Callable[[Curve, int], float]
) -> Curve | None:
    """Return the first of several curves that keeps the hand out of everything; None without one.

    Parameters
    ----------
    start, end : ndarray, shape (3,)
        Wrist at rest and at the object [m].
    way_out : ndarray, shape (3,)
        Direction in which the hand leaves the object.
    back : ndarray, shape (3,)
        Direction in which the back of the hand faces at the object.
    depth : callable
        How much deeper than allowed the hand runs into something on a curve, looked at in so
        many points [m].
    """
    for aside, straight, rise in product(ASIDE, STRAIGHT, RISES):
        lifted = start + np.array([0.0, 0.0, rise])
        near = end + straight * way_out
        far = near + straight * way_out + aside * back
        curve = Curve(np.array([start, lifted, far, near, end]))
        if depth(curve, COARSE) <= 0 and depth(curve, FINE) <= 0:
            return curve
    return None
