"""How far two aligned parts are from each other: Chamfer distances."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.align import TRIMMED
from graspdb_queries.similar.part import Part

Floats = NDArray[np.float64]

TILT: Final = 0.010
"""Distance that a tilt of one radian between surfaces counts with [m].

Root mean square distance of two discs that cross in a diameter, for each radian: half of their radius. The
radius is that of the neighbourhoods which describe a point, 20 mm.
"""


@dataclass(frozen=True)
class Chamfer:
    """Distances between two aligned clouds [m].

    Attributes
    ----------
    symmetric : float
        Mean distance of the points of each to the nearest of the other, the mean of both ways.
    one_way : float
        Mean distance of the query's points to the nearest of the hit: how much of the query is there.
    trimmed : float
        As symmetric, of the nearest 70 % of the points of each: what the better part of both says.
    surface : float
        As trimmed, of pieces of surface: the root of the sum of squares of the distance between points and
        of what their tilt counts.
    """

    symmetric: float
    one_way: float
    trimmed: float
    surface: float


def chamfer(query: Part, hit: Part, rotation: Floats, position: Floats) -> Chamfer:
    """Return the distances of two parts.

    Parameters
    ----------
    query, hit : Part
        The parts.
    rotation, position : ndarray, shapes (3, 3) and (3,)
        hit_from_query.
    """
    forth, there = _nearest(hit, query.scored @ rotation.T + position)
    back, here = _nearest(query, (hit.scored - position) @ rotation)
    oriented = query.oriented and hit.oriented
    onto = np.hypot(forth, TILT * _tilts(query.scored_normals @ rotation.T, hit.normals[there], oriented))
    from_it = np.hypot(back, TILT * _tilts(hit.scored_normals @ rotation, query.normals[here], oriented))
    return Chamfer(
        symmetric=float(forth.mean() + back.mean()) / 2,
        one_way=float(forth.mean()),
        trimmed=(_nearest_mean(forth) + _nearest_mean(back)) / 2,
        surface=(_nearest_mean(onto) + _nearest_mean(from_it)) / 2,
    )


def _nearest(part: Part, points: Floats) -> tuple[Floats, NDArray[np.int64]]:
    apart, rows = part.tree.query(points)
    return np.asarray(apart, dtype=np.float64), np.asarray(rows, dtype=np.int64)


def _tilts(first: Floats, second: Floats, oriented: bool) -> Floats:
    """Return the lengths of the differences of unit normals: angles, for small ones."""
    cosines = np.einsum("ni,ni->n", first, second)
    if not oriented:
        cosines = np.abs(cosines)
    return np.asarray(np.sqrt(np.maximum(2 - 2 * cosines, 0.0)))


def _nearest_mean(distances: Floats) -> float:
    """Return the mean of the nearest share of distances."""
    return float(np.sort(distances)[: int(np.ceil(TRIMMED * len(distances)))].mean())
