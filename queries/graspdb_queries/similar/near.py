"""Grasps near to a question by what can be told without alignment: the candidates for a close look.

Features come by two orders in turn, the distance of their descriptors and that of their sizes. Descriptors
say what a surface is like, and are far apart where one part has an edge or a wall more than another that it
covers all the same; such a pair is near in size.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.hands import contact_distances, posture_in_units
from graspdb_queries.similar.holdings import Holdings
from graspdb_queries.similar.library import HandRows
from graspdb_queries.similar.metric import Vectors
from graspdb_queries.similar.question import Question, Respect, Weight
from graspdb_queries.similar.vectors import exact_squared

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Near:
    """Grasps near to a question.

    Attributes
    ----------
    keys : list of str
        Nearest first.
    searched, left_out : int
        Grasps that were compared, and grasps that could not be.
    """

    keys: list[str]
    searched: int
    left_out: int


@dataclass
class Order:
    """The nearest of what has been seen so far, batch after batch.

    Attributes
    ----------
    count : int
        How many are kept.
    distances : dict
        Key -> distance, nearest first, equal ones in the order of their keys.
    """

    count: int
    distances: dict[str, float] = field(default_factory=dict)

    def add(self, keys: Sequence[str], rows: Rows, distances: Floats) -> None:
        """Take in the nearest rows of a batch; of a key seen before, the smaller distance counts."""
        for row, distance in zip(rows.tolist(), distances.tolist(), strict=True):
            key = keys[row]
            self.distances[key] = min(distance, self.distances.get(key, np.inf))
        ranked = sorted(self.distances.items(), key=lambda item: (item[1], item[0]))
        self.distances = dict(ranked[: self.count])


def near(holdings: Holdings, question: Question, respect: Respect, count: int, where: str | None) -> Near:
    """Return the grasps nearest to a question, and how many were searched.

    Parameters
    ----------
    holdings : Holdings
        The database.
    question : Question
        A grasp, or a part from outside.
    respect : Respect
        In which respect.
    count : int
        How many, at most.
    where : str or None
        A boolean SQL expression over the columns of grasps; only those for which it is true count.
    """
    wanted = count + 1 if question.inside else count
    if respect.by == "feature":
        found, searched = _near_features(holdings, question, wanted, where)
    else:
        found, searched = _near_hands(holdings, question, respect, wanted, where)
    keys = [key for key in found if not (question.inside and key == question.name)][:count]
    own = int(question.inside and question.name in found)
    return Near(keys, searched - own, holdings.count(where) - searched)


def in_turn(orders: Sequence[Sequence[str]], count: int) -> list[str]:
    """Return keys of several orders, the first of each, the second of each, and so on, each key once."""
    longest = max((len(order) for order in orders), default=0)
    keys = (order[i] for i in range(longest) for order in orders if i < len(order))
    return list(dict.fromkeys(keys))[:count]


def descriptor_distances(holdings: Holdings, question: Question, kind: str, keys: Sequence[str]) -> Floats:
    """Return distances of descriptors by key; NaN for grasps without one."""
    features = holdings.features_of(kind, keys)
    place = np.array([features.places.get(key, -1) for key in keys], dtype=np.int64)
    distances = np.full(len(keys), np.nan)
    found = place >= 0
    vectors = features.index.vectors[place[found]]
    squared = np.stack([exact_squared(vectors, vector) for vector in _vectors(holdings, question)])
    distances[found] = np.sqrt(squared.min(axis=0))
    return distances


def _near_features(
    holdings: Holdings, question: Question, count: int, where: str | None
) -> tuple[list[str], int]:
    """Return the keys of the nearest features, and how many were searched."""
    if question.kind is None or question.size is None:
        return [], 0
    vectors = _vectors(holdings, question)
    by_descriptor, by_size = Order(count), Order(count)
    searched = 0
    for features, rows in holdings.feature_rows(question.kind, where):
        searched += len(features.keys) if rows is None else len(rows)
        for vector in vectors:
            by_descriptor.add(features.keys, *features.index.nearest(vector, count, rows))
        by_size.add(features.keys, *features.sizes.nearest(question.size, count, rows))
    return in_turn([list(by_descriptor.distances), list(by_size.distances)], count), searched


def _near_hands(
    holdings: Holdings, question: Question, respect: Respect, count: int, where: str | None
) -> tuple[list[str], int]:
    """Return the grasps nearest by posture, sites and descriptor, as far as these count."""
    best = Order(count)
    searched = 0
    for rows in holdings.hand_rows(where):
        cost = _coarse_costs(holdings, question, respect, rows)
        known = np.flatnonzero(np.isfinite(cost))
        searched += len(known)
        kept = known[np.lexsort((known, cost[known]))[:count]]
        best.add(rows.keys, kept, cost[kept])
    return list(best.distances), searched


def _coarse_costs(holdings: Holdings, question: Question, respect: Respect, rows: HandRows) -> Floats:
    """Return the sum of the costs that need no alignment; NaN where one is not known."""
    weights, hand = respect.weights, question.hand
    cost = np.zeros(len(rows.keys))
    if hand is None:
        return cost
    if "posture" in weights:
        cost += _cost(posture_in_units(hand, rows.hands, respect.posture), weights["posture"])
    if "sites" in weights:
        cost += _cost(contact_distances(hand, rows.hands), weights["sites"])
    if "descriptor" in weights and question.kind is not None:
        distances = descriptor_distances(holdings, question, question.kind, rows.keys)
        cost += _cost(distances, weights["descriptor"])
    return cost


def _cost(distances: Floats, weight: Weight) -> Floats:
    return distances * (weight.weight / weight.scale)


def _vectors(holdings: Holdings, question: Question) -> Vectors:
    """Return the vectors of a question's descriptors, shape (m, d)."""
    if question.kind is None:
        return np.empty((0, 0), np.float32)
    return holdings.metric(question.kind).vectors(question.descriptors)
