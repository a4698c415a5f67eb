"""Contact map: how far the points of an object lie from the surface of the hand that holds it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.surface.anatomy import unit
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_ingest.surface.rounded import Integers

FLESH_DEPTH: Final = 0.004
"""Depth of the soft tissue over a finger's bones on its palmar side [m]: some 3 to 5 mm."""


@dataclass(frozen=True, eq=False)
class ContactMap:
    """The points of an object that are near a hand's surface.

    Attributes
    ----------
    points : ndarray of int, shape (n,)
        Which points, ascending.
    gaps : ndarray, shape (n,)
        Their signed distance to the hand's surface [m], negative inside the hand.
    facing : ndarray, shape (n,)
        Cosine of the angle between the outward normal at the point and the direction to the hand's
        bone, the nearest sphere's centre: 1 where the hand lies flat on the surface, below 0 where the
        surface faces away from it.
    """

    points: Integers
    gaps: Floats
    facing: Floats

    @property
    def pressing_gaps(self) -> Floats:
        """How far the flesh is from pressing on each point [m], shape (n,); see `pressing_gap`."""
        return pressing_gap(self.gaps, self.facing)


def pressing_gap(gaps: Floats, facing: Floats) -> Floats:
    """Return how far flesh is from pressing on points of an object [m].

    Flesh presses on a point from above, along its normal, never from the side or through the object: what
    counts is how deep in the hand the place is that lies one depth of flesh above the point. To first order
    that place's distance to the surface, and the depth, make ``gap + FLESH_DEPTH * (1 - facing)``.
    """
    return np.asarray(gaps + FLESH_DEPTH * (1 - facing))


def contact_map(points: Floats, normals: Floats, surface: HandSurface, reach: float) -> ContactMap:
    """Return the points that lie within reach of a hand's surface.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        The object's points [m] and outward unit normals.
    surface : HandSurface
        A single posed hand, in the same frame.
    reach : float
        Largest gap of a point that is in the map [m].
    """
    near = _candidates(points, surface, reach)
    found = surface.distances(points[near])
    within = found.distance <= reach
    chosen = near[within]
    centres, _ = surface.sphere_at(found.shape[within], found.weights[within])
    with np.errstate(invalid="ignore"):
        facing = np.sum(unit(centres - points[chosen]) * normals[chosen], axis=1)
    return ContactMap(chosen, found.distance[within], np.nan_to_num(facing, nan=1.0))


def _candidates(points: Floats, surface: HandSurface, reach: float) -> Integers:
    """Return the points in a box around the hand; none where the hand is not known."""
    if not np.isfinite(surface.centres).all():
        return np.empty(0, dtype=np.int64)
    margin = surface.radii[:, None] + reach
    low, high = (surface.centres - margin).min(axis=0), (surface.centres + margin).max(axis=0)
    return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
