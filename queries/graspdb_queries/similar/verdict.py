"""Close comparison of candidates: alignment, distances of surfaces and contacts, costs, ranks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.engine import Engine
from graspdb_queries.similar.align import CHUNK, Poses, align, held_poses
from graspdb_queries.similar.answer import Hit
from graspdb_queries.similar.chamfer import Chamfer, chamfer
from graspdb_queries.similar.hands import contact_distances, posture_in_units, set_distance, site_names
from graspdb_queries.similar.library import hands_by_key
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.question import Question, Respect
from graspdb_queries.similar.score import ScorePart
from graspdb_queries.similar.threads import in_threads

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A near grasp.

    Attributes
    ----------
    key : str
        The grasp.
    descriptor : float
        Distance of the descriptors; NaN where they were not compared.
    part : Part or None
        Its feature.
    """

    key: str
    descriptor: float
    part: Part | None


@dataclass(frozen=True, eq=False)
class Laid:
    """How the query lies on a candidate.

    Attributes
    ----------
    pose : ndarray, shape (4, 4)
        hit_from_query.
    apart : Chamfer
        Distances of the surfaces.
    """

    pose: Floats
    apart: Chamfer


def verdicts(
    engine: Engine, question: Question, respect: Respect, candidates: Sequence[Candidate], count: int
) -> tuple[Hit, ...]:
    """Return the best candidates as hits, the cheapest first, equal ones by key."""
    laid = lay(question.part, [c.part for c in candidates if c.part is not None], respect.mode)
    weights = respect.weights
    hand_parts = {"posture", "sites", "contacts"} & set(weights)
    hands = hands_by_key(engine, [c.key for c in candidates]) if hand_parts else {}
    contacts = _contacts(engine, [c.key for c in candidates]) if "contacts" in weights else {}
    judged = []
    for candidate in candidates:
        where = laid.get(candidate.key)
        if where is None and respect.by != "posture":
            continue  # held by the other hand
        distances = {"descriptor": candidate.descriptor}
        if where is not None:
            distances["surface"] = 1e3 * where.apart.surface
        if hand_parts and question.hand is not None:
            hand = hands[candidate.key]
            distances["posture"] = float(posture_in_units(question.hand, hand, respect.posture)[0])
            distances["sites"] = float(contact_distances(question.hand, hand)[0])
        if where is not None and "contacts" in weights:
            moved = question.contacts @ where.pose[:3, :3].T + where.pose[:3, 3]
            distances["contacts"] = 1e3 * set_distance(moved, contacts.get(candidate.key, np.empty((0, 3))))
        parts = tuple(
            ScorePart(name, float(distances[name]), weight.unit, weight.scale, weight.weight)
            for name, weight in weights.items()
        )
        cost = sum(part.cost for part in parts)
        if np.isfinite(cost):
            judged.append((cost, candidate.key, parts, where))
    judged.sort(key=lambda entry: entry[:2])
    return _hits(engine, question, judged[:count])


def lay(query: Part | None, candidates: Sequence[Part], mode: str) -> dict[str, Laid]:
    """Return how a query lies on each candidate, by name.

    Candidates are aligned in groups of a fixed size and each group by one thread, with linear algebra on
    one thread; so the numbers are the same however many threads there are.
    """
    if query is None or not candidates:
        return {}
    groups = [candidates[i : i + CHUNK] for i in range(0, len(candidates), CHUNK)]
    for cached in (query.sparse, query.dense, query.axes, query.tree, query.scored, query.scored_normals):
        del cached  # made once, before threads share the query

    def work(group: Sequence[Part]) -> list[tuple[str, Laid]]:
        if mode == "held":
            group = [part for part in group if part.has_hand]
        if not group:
            return []
        poses: Poses = held_poses(query, group) if mode == "held" else align(query, group)
        matrices = poses.matrices()
        return [
            (part.name, Laid(matrix, chamfer(query, part, matrix[:3, :3], matrix[:3, 3])))
            for part, matrix in zip(group, matrices, strict=True)
        ]

    return dict(entry for found in in_threads(work, groups) for entry in found)


def _contacts(engine: Engine, keys: Sequence[str]) -> dict[str, Floats]:
    """Return the contact points of grasps, each of shape (k, 3) [m]."""
    rows = engine.sql(
        "SELECT grasp, position FROM contacts WHERE grasp IN (SELECT unnest($keys)) ORDER BY grasp, site",
        {"keys": list(keys)},
    ).rows()
    found: dict[str, list[Any]] = {}
    for key, position in rows:
        found.setdefault(key, []).append(position)
    return {key: np.array(positions, dtype=float) for key, positions in found.items()}


def _hits(
    engine: Engine,
    question: Question,
    judged: Sequence[tuple[float, str, tuple[ScorePart, ...], Laid | None]],
) -> tuple[Hit, ...]:
    keys = [entry[1] for entry in judged]
    described = {
        row[0]: row
        for row in engine.sql(
            "SELECT grasp, session, subject, object, side FROM grasps WHERE grasp IN (SELECT unnest($keys))",
            {"keys": keys},
        ).rows()
    }
    hands = hands_by_key(engine, keys)
    own = None if question.hand is None else question.hand.touching[0]
    hits = []
    for rank, (cost, key, parts, laid) in enumerate(judged, 1):
        touching = hands[key].touching[0]
        shared = np.zeros_like(touching) if own is None else touching & own
        _, session, subject, name, side = described[key]
        hits.append(
            Hit(
                rank=rank,
                grasp=key,
                session=session,
                subject=subject,
                object=name,
                side=side,
                cost=cost,
                parts=parts,
                hit_from_query=None if laid is None else laid.pose,
                symmetric=None if laid is None else laid.apart.symmetric,
                one_way=None if laid is None else laid.apart.one_way,
                trimmed=None if laid is None else laid.apart.trimmed,
                shared_sites=site_names(shared),
                only_query=() if own is None else site_names(own & ~touching),
                only_hit=site_names(touching & ~shared),
            )
        )
    return tuple(hits)
