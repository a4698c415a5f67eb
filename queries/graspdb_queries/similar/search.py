"""The search for similar grasps: near ones first, then a close look at the nearest."""

from typing import Final

import numpy as np

from graspdb_queries.engine import Engine
from graspdb_queries.quoting import literal
from graspdb_queries.similar.answer import Similar
from graspdb_queries.similar.holdings import DEFAULT_MEMORY, Holdings
from graspdb_queries.similar.library import descriptors_of, features_by_key, flat, hands_by_key
from graspdb_queries.similar.near import Near, descriptor_distances, near
from graspdb_queries.similar.question import Question, Respect
from graspdb_queries.similar.verdict import Candidate, verdicts
from graspdb_queries.similar.where import check_filter
from graspdb_schemas.errors import QueryError, nearest

CANDIDATES: Final = 100
"""Near grasps that are aligned and compared closely."""


class Search:
    """Finds similar grasps in one snapshot; what it has read stays in memory between questions.

    Parameters
    ----------
    engine : Engine
        The snapshot.
    memory : int
        Bytes that features may take in memory; see `Holdings`.
    """

    def __init__(self, engine: Engine, memory: int = DEFAULT_MEMORY) -> None:
        self.engine = engine
        self.holdings = Holdings(engine, memory)

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
        wanted = max(CANDIDATES, count)
        found = near(self.holdings, question, respect, wanted, _narrowed(question, respect, where))
        candidates = self._candidates(question, respect, found)
        hits = verdicts(self.engine, question, respect, candidates, count)
        return Similar(
            query=question.name,
            by=respect.by,
            mode=respect.mode,
            where=where,
            searched=found.searched,
            left_out=found.left_out,
            learned_from=0 if question.kind is None else self.holdings.metric(question.kind).learned_from,
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
        kind, part, size, descriptors = None, None, None, np.empty((0, 0), np.float32)
        if described.num_rows:
            kind = described["descriptor_kind"][0].as_py()
            descriptors = descriptors_of(described["descriptor"])
            features = features_by_key(self.engine, kind, self.holdings.metric(kind), [key])
            part, size = self.holdings.parts(features, [0])[0], features.sizes.vectors[0]
        return Question(
            name=key,
            kind=kind,
            descriptors=descriptors,
            part=part,
            size=size,
            hand=hands_by_key(self.engine, [key])[key],
            side=found[0][1],
            contacts=flat(contacts["position"], 3),
            inside=True,
        )

    def _candidates(self, question: Question, respect: Respect, found: Near) -> list[Candidate]:
        """Return near grasps with what a verdict on them needs."""
        if respect.by == "posture" or question.kind is None or not found.keys:
            return [Candidate(key, float("nan"), None) for key in found.keys]
        features = self.holdings.features_of(question.kind, found.keys)
        distances = descriptor_distances(self.holdings, question, question.kind, found.keys)
        parts = self.holdings.parts(features, [features.places[key] for key in found.keys])
        return [
            Candidate(key, float(distance), part)
            for key, distance, part in zip(found.keys, distances, parts, strict=True)
        ]


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
