"""How far two aligned parts are from each other: Chamfer distances."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.align import TRIMMED
from graspdb_queries.similar.part import Part

Floats = NDArray[np.float64]


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
    """

    symmetric: float
    one_way: float
    trimmed: float


def chamfer(query: Part, hit: Part, rotation: Floats, position: Floats) -> Chamfer:
    """Return the distances of two parts.

    Parameters
    ----------
    query, hit : Part
        The parts.
    rotation, position : ndarray, shapes (3, 3) and (3,)
        hit_from_query.
    """
    forth = np.asarray(hit.tree.query(query.scored @ rotation.T + position)[0], dtype=np.float64)
    back = np.asarray(query.tree.query((hit.scored - position) @ rotation)[0], dtype=np.float64)
    return Chamfer(
        symmetric=float(forth.mean() + back.mean()) / 2,
        one_way=float(forth.mean()),
        trimmed=(_nearest_mean(forth) + _nearest_mean(back)) / 2,
    )


def _nearest_mean(distances: Floats) -> float:
    """Return the mean of the nearest share of distances."""
    return float(np.sort(distances)[: int(np.ceil(TRIMMED * len(distances)))].mean())
