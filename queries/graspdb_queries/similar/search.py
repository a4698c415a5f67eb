"""The search for similar grasps: near ones by what all have in memory, then the best of them closely."""

from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.engine import Engine
from graspdb_queries.quoting import literal
from graspdb_queries.similar.answer import Similar
from graspdb_queries.similar.hands import Hands, contact_distances, posture_distances
from graspdb_queries.similar.library import (
    Cloud,
    Features,
    HandRows,
    all_features,
    clouds_by_id,
    descriptors_of,
    feature_batches,
    features_by_key,
    flat,
    hand_batches,
    hands_by_key,
    learn,
    part_of,
)
from graspdb_queries.similar.metric import Metric, Vectors
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.question import Question, Respect, Weight
from graspdb_queries.similar.vectors import exact_squared
from graspdb_queries.similar.verdict import Candidate, verdicts
from graspdb_queries.similar.where import check_filter, filtered_grasps
from graspdb_schemas.errors import QueryError, nearest

Floats = NDArray[np.float64]

CANDIDATES: Final = 100
"""Near grasps that are aligned and compared closely."""

MOST_CLOUDS: Final = 256
"""Objects whose clouds stay in memory."""

DEFAULT_MEMORY: Final = 4 * 1024**3
"""Bytes above which features are read anew for every question instead of being kept."""


@dataclass(frozen=True, eq=False)
class Near:
    """Grasps near to a question by what can be told without alignment.

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


class Search:
    """Finds similar grasps in one snapshot; what it has read stays in memory between questions.

    Parameters
    ----------
    engine : Engine
        The snapshot.
    memory : int
        Bytes that features may take in memory. A database with more is read in batches for every question,
        with the same answers.
    """

    def __init__(self, engine: Engine, memory: int = DEFAULT_MEMORY) -> None:
        self.engine = engine
        self.memory = memory
        self._metrics: dict[str, Metric] = {}
        self._features: dict[str, Features] = {}
        self._clouds: OrderedDict[str, Cloud] = OrderedDict()

    def similar(self, question: Question, respect: Respect, count: int, where: str | None = None) -> Similar:
        """Return the grasps most like a question.

        Parameters
        ----------
        question : Question
            A grasp, or a part from outside.
        respect : Respect
            In which respect.
        count : int
            How many, at most.
        where : str, optional
            A boolean SQL expression over the columns of grasps; only those for which it is true count.

        Raises
        ------
        QueryError
            The question lacks what the respect compares, or the filter cannot be used.
        """
        _check(question, respect)
        if where is not None:
            check_filter(self.engine, where)
        near = self._near(question, respect, max(CANDIDATES, count), _narrowed(question, respect, where))
        candidates = self._candidates(question, respect, near)
        hits = verdicts(self.engine, question, respect, candidates, count)
        return Similar(
            query=question.name,
            by=respect.by,
            mode=respect.mode,
            where=where,
            searched=near.searched,
            left_out=near.left_out,
            learned_from=0 if question.kind is None else self.metric(question.kind).learned_from,
            hits=hits,
        )

    def question(self, key: str) -> Question:
        """Return a grasp of the database as a question.

        Raises
        ------
        QueryError
            There is no such grasp; the message names one with a name like it.
        """
        found = self.engine.sql("SELECT grasp, side FROM grasps WHERE grasp = $key", {"key": key}).rows()
        if not found:
            keys = self.engine.sql("SELECT grasp FROM grasps").table["grasp"].to_pylist()
            raise QueryError(
                f"the database has no grasp {key!r}{nearest(key, keys)}",
                "graspdb sql 'SELECT grasp FROM grasps' lists them.",
            )
        described = self.engine.sql(
            "SELECT descriptor, descriptor_kind FROM features "
            "WHERE grasp = $key AND descriptor IS NOT NULL AND len(points) > 0",
            {"key": key},
        ).table
        contacts = self.engine.sql(
            "SELECT position FROM contacts WHERE grasp = $key ORDER BY site", {"key": key}
        ).table
        kind, part, descriptors = None, None, np.empty((0, 0), np.float32)
        if described.num_rows:
            kind = described["descriptor_kind"][0].as_py()
            descriptors = descriptors_of(described["descriptor"])
            features = features_by_key(self.engine, kind, self.metric(kind), [key])
            part = self.parts(features, [0])[0]
        return Question(
            name=key,
            kind=kind,
            descriptors=descriptors,
            part=part,
            hand=hands_by_key(self.engine, [key])[key],
            side=found[0][1],
            contacts=flat(contacts["position"], 3),
            inside=True,
        )

    def metric(self, kind: str) -> Metric:
        """Return the metric of descriptors of a kind, learned once."""
        if kind not in self._metrics:
            self._metrics[kind] = learn(self.engine, kind)
        return self._metrics[kind]

    def features(self, kind: str) -> Features:
        """Return all features with descriptors of a kind, read once."""
        if kind not in self._features:
            self._features[kind] = all_features(self.engine, kind, self.metric(kind))
        return self._features[kind]

    def parts(self, features: Features, rows: Iterable[int]) -> list[Part]:
        """Return features as clouds."""
        rows = list(rows)
        clouds = self.clouds({features.objects[row] for row in rows})
        return [part_of(features, row, clouds[features.objects[row]]) for row in rows]

    def vectors(self, question: Question) -> Vectors:
        """Return the vectors of a question's descriptors, shape (m, d)."""
        if question.kind is None:
            return np.empty((0, 0), np.float32)
        return self.metric(question.kind).vectors(question.descriptors)

    @cached_property
    def in_memory(self) -> bool:
        """Whether the features are kept."""
        points, n = self.engine.sql("SELECT sum(feature_points), count(*) FROM grasps").rows()[0]
        return 4 * int(points or 0) + 1024 * int(n) <= self.memory

    @cached_property
    def _hands(self) -> list[HandRows]:
        return list(hand_batches(self.engine, None))

    def _near(self, question: Question, respect: Respect, count: int, where: str | None) -> Near:
        """Return the grasps nearest to a question, and how many were searched."""
        wanted = count + 1 if question.inside else count
        if respect.by == "feature":
            found, searched = self._near_features(question, wanted, where)
        else:
            found, searched = self._near_hands(question, respect, wanted, where)
        keys = [key for key in found if not (question.inside and key == question.name)][:count]
        n_all = self.count(where)
        own = int(question.inside and question.name in found)
        return Near(keys, searched - own, n_all - searched)

    def count(self, where: str | None) -> int:
        """Return the number of grasps that pass a filter."""
        clause = "" if where is None else f" WHERE (\n{where}\n)"
        return int(self.engine.sql(f"SELECT count(*) FROM grasps{clause}").rows()[0][0])

    def _near_features(self, question: Question, count: int, where: str | None) -> tuple[list[str], int]:
        """Return the keys of the nearest features, and how many were searched."""
        kind, vectors = question.kind, self.vectors(question)
        if kind is None:
            return [], 0
        best: dict[str, float] = {}
        searched = 0
        for features, rows in self.feature_rows(kind, where):
            searched += len(features.keys) if rows is None else len(rows)
            for vector in vectors:
                found, squared = features.index.nearest(vector, count, rows)
                for row, distance in zip(found, squared, strict=True):
                    key = features.keys[row]
                    best[key] = min(float(distance), best.get(key, np.inf))
            best = dict(sorted(best.items(), key=lambda item: (item[1], item[0]))[:count])
        return list(best), searched

    def feature_rows(
        self, kind: str, where: str | None
    ) -> Iterator[tuple[Features, NDArray[np.int64] | None]]:
        """Yield features and which of their rows count: all at once from memory, or batch by batch."""
        if not self.in_memory:
            for batch in feature_batches(self.engine, kind, self.metric(kind), where):
                yield batch, None
            return
        features = self.features(kind)
        yield features, None if where is None else features.rows_of(filtered_grasps(self.engine, where))

    def _near_hands(
        self, question: Question, respect: Respect, count: int, where: str | None
    ) -> tuple[list[str], int]:
        """Return the grasps nearest by posture, sites and descriptor, as far as these count."""
        costs: dict[str, float] = {}
        searched = 0
        for rows in self._hand_rows(where):
            cost = self._coarse_costs(question, respect, rows)
            known = np.flatnonzero(np.isfinite(cost))
            searched += len(known)
            kept = known[np.lexsort((known, cost[known]))[:count]]
            costs |= {rows.keys[i]: float(cost[i]) for i in kept}
            costs = dict(sorted(costs.items(), key=lambda item: (item[1], item[0]))[:count])
        return list(costs), searched

    def _hand_rows(self, where: str | None) -> Iterator[HandRows]:
        if not self.in_memory:
            yield from hand_batches(self.engine, where)
            return
        wanted = None if where is None else set(filtered_grasps(self.engine, where))
        for rows in self._hands:
            if wanted is None:
                yield rows
                continue
            kept = np.array([i for i, key in enumerate(rows.keys) if key in wanted], dtype=np.int64)
            yield HandRows(tuple(rows.keys[i] for i in kept), rows.hands.take(kept))

    def _coarse_costs(self, question: Question, respect: Respect, rows: HandRows) -> Floats:
        """Return the sum of the costs that need no alignment; NaN where one is not known."""
        weights, hand = respect.weights, question.hand
        cost = np.zeros(len(rows.keys))
        if hand is None:
            return cost
        if "posture" in weights:
            cost += _cost(posture_of(hand, rows.hands, respect), weights["posture"])
        if "sites" in weights:
            cost += _cost(contact_distances(hand, rows.hands), weights["sites"])
        if "descriptor" in weights and question.kind is not None:
            distances = self._descriptor_distances(question, question.kind, rows.keys)
            cost += _cost(distances, weights["descriptor"])
        return cost

    def _descriptor_distances(self, question: Question, kind: str, keys: Sequence[str]) -> Floats:
        """Return distances of descriptors by key; NaN for grasps without one."""
        if self.in_memory:
            features = self.features(kind)
        else:
            features = features_by_key(self.engine, kind, self.metric(kind), keys)
        place = np.array([features.places.get(key, -1) for key in keys], dtype=np.int64)
        distances = np.full(len(keys), np.nan)
        found = place >= 0
        vectors = features.index.vectors[place[found]]
        squared = np.stack([exact_squared(vectors, vector) for vector in self.vectors(question)])
        distances[found] = np.sqrt(squared.min(axis=0))
        return distances

    def _candidates(self, question: Question, respect: Respect, near: Near) -> list[Candidate]:
        """Return near grasps with what a verdict on them needs."""
        if respect.by == "posture" or question.kind is None or not near.keys:
            return [Candidate(key, float("nan"), None) for key in near.keys]
        kind = question.kind
        if self.in_memory:
            features = self.features(kind)
        else:
            features = features_by_key(self.engine, kind, self.metric(kind), near.keys)
        distances = self._descriptor_distances(question, kind, near.keys)
        parts = self.parts(features, [features.places[key] for key in near.keys])
        return [
            Candidate(key, float(distance), part)
            for key, distance, part in zip(near.keys, distances, parts, strict=True)
        ]

    def clouds(self, ids: set[str]) -> dict[str, Cloud]:
        """Return clouds, read where they are not in memory; those not used for longest go first."""
        missing = sorted(ids - set(self._clouds))
        if missing:
            self._clouds |= clouds_by_id(self.engine, missing)
        found = {}
        for name in sorted(ids):
            self._clouds.move_to_end(name)
            found[name] = self._clouds[name]
        while len(self._clouds) > max(MOST_CLOUDS, len(ids)):
            self._clouds.popitem(last=False)
        return found


def posture_of(query: Hands, hands: Hands, respect: Respect) -> Floats:
    """Return distances of postures in the unit of their weight: millimetres or degrees."""
    distances = posture_distances(query, hands, respect.posture)
    return np.degrees(distances) if respect.posture == "angles" else 1e3 * distances


def _cost(distances: Floats, weight: Weight) -> Floats:
    return distances * (weight.weight / weight.scale)


def _narrowed(question: Question, respect: Respect, where: str | None) -> str | None:
    """Return a filter that also leaves out the other hand's grasps, where parts are compared as held."""
    if respect.mode != "held" or question.side is None:
        return where
    same_side = f"side = {literal(question.side)}"
    return same_side if where is None else f"(\n{where}\n) AND {same_side}"


def _check(question: Question, respect: Respect) -> None:
    """Raise QueryError if a question lacks what is to be compared."""
    if respect.by != "posture" and question.part is None:
        raise QueryError(
            f"{question.name} encloses no point of its object, so there is no feature to compare",
            "Ask --by posture, or for another grasp.",
        )
    if respect.by != "feature" and question.hand is None:
        raise QueryError(
            f"{question.name} is a part without a hand; it has no posture and no contacts",
            "Ask --by feature.",
        )
    if respect.mode == "held" and not (question.part is None or question.part.has_hand):
        raise QueryError(f"the pose of a hand about {question.name} is not known", "Ask with --mode shape.")
    if respect.by in ("posture", "all") and question.hand is not None:
        values = question.hand.angles if respect.posture == "angles" else question.hand.sites
        if not np.isfinite(values).all():
            remedy = "Ask with --posture scaled." if respect.posture == "angles" else "Ask --by feature."
            raise QueryError(f"{question.name} has no {respect.posture} posture", remedy)
