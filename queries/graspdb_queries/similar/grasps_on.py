"""The search for grasps of a new object: like places first, then each grasp laid onto its places."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from graspdb_queries.similar.align import CHUNK
from graspdb_queries.similar.holdings import Holdings
from graspdb_queries.similar.library import Features, features_by_key, flat
from graspdb_queries.similar.metric import Metric
from graspdb_queries.similar.onto import Fit, HeldFeature, gaps, hull_planes, lay_onto, starts_on
from graspdb_queries.similar.placed import GraspsOn, PlacedGrasp
from graspdb_queries.similar.places import LEAST_POINTS, NewObject, Rows, places_on
from graspdb_queries.similar.question import MILLIMETRE, Weight
from graspdb_queries.similar.score import ScorePart
from graspdb_queries.similar.threads import in_threads
from graspdb_queries.similar.where import check_filter
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import N_Q, N_SITES

Floats = NDArray[np.float64]

PAIRS: Final = 200
"""Pairs of a place and a feature that are aligned."""

FEATURES_OF_PLACE: Final = 16
PLACES_OF_GRASP: Final = 4
"""So that neither a place that is like everything nor the many like places of a round body take all pairs."""

SHARED: Final = 0.5
"""Shared points over all points (intersection over union) above which two grasps hold the same place."""

WEIGHTS: Final[dict[str, Weight]] = {
    "descriptor": Weight(0.4, 1.0, ""),
    "surface": Weight(0.4, 1.0, MILLIMETRE),
    "contacts_off": Weight(0.2, 0.5, ""),
}
"""Parts of the cost: descriptors of what the hand encloses here and there; one-way distance of the feature to
the object, of the nearest 70 %; share of the contact points that do not lie on the object."""

_SIZES: Final = """
    SELECT unnest(quantile_disc(len(points), [0.17, 0.5, 0.83])) FROM features
    WHERE descriptor_kind = $kind AND len(points) >= $least
"""
_HELD: Final = """
    SELECT g.grasp, g.sites_object, h.radii, f.hull_vertices, g.session, g.subject, g.object, g.side, g.q,
        list(c.position ORDER BY c.site) FILTER (c.position IS NOT NULL) AS contacts
    FROM grasps g JOIN features f USING (grasp) LEFT JOIN grasp_hands h USING (grasp)
        LEFT JOIN contacts c USING (grasp)
    WHERE g.grasp IN (SELECT unnest($keys)) AND len(f.hull_vertices) > 3 AND g.sites_object IS NOT NULL
    GROUP BY ALL ORDER BY g.grasp
"""


def grasps_on(holdings: Holdings, new: NewObject, count: int, where: str | None = None) -> GraspsOn:
    """Return the grasps of a database that fit a new object best, each laid onto it.

    Parameters
    ----------
    holdings : Holdings
        The database.
    new : NewObject
        The object.
    count : int
        How many grasps, at most.
    where : str, optional
        A boolean SQL expression over the columns of grasps; only those for which it is true count.

    Raises
    ------
    QueryError
        The database has no features that can be compared, or the filter cannot be used.
    """
    sizes = feature_sizes(holdings, new.kind, where)
    metric = holdings.metric(new.kind)
    places = places_on(new, sizes)
    pairs, searched = _pairs(holdings, new, places, metric, where)
    held, rows = _held(holdings, new.kind, metric, sorted({key for keys in pairs.values() for key in keys}))
    fits = _fits(new, places, pairs, held, metric)
    best: dict[str, Fit] = {}
    for fit in sorted((fit for fit in fits if fit.possible), key=_order):
        best.setdefault(fit.key, fit)
    chosen = list(best.values())[:count]
    return GraspsOn(
        object=new.name,
        where=where,
        searched=searched,
        left_out=holdings.count(where) - searched,
        places=len(places),
        refused=len({fit.key for fit in fits} - set(best)),
        hits=_hits(new, chosen, held, rows),
    )


def feature_sizes(holdings: Holdings, kind: str, where: str | None) -> list[int]:
    """Return three numbers of points that features have: few, usual and many.

    Worth asking before an object is described, which takes longer.

    Raises
    ------
    QueryError
        The database has no features that can be compared, or the filter cannot be used.
    """
    if where is not None:
        check_filter(holdings.engine, where)
    sizes = [row[0] for row in holdings.engine.sql(_SIZES, {"kind": kind, "least": LEAST_POINTS}).rows()]
    if not sizes or sizes[0] is None:
        raise QueryError(
            f"the database has no features with descriptors of kind {kind!r}",
            "Ingest grasps into it, or those it has anew: graspdb ingest --force.",
        )
    return sizes


def _pairs(
    holdings: Holdings, new: NewObject, places: Sequence[Rows], metric: Metric, where: str | None
) -> tuple[dict[int, list[str]], int]:
    """Return the features to lay on each place, and how many features were searched."""
    vectors = metric.vectors(np.stack(in_threads(new.describe, places)))
    near: list[list[tuple[float, str]]] = [[] for _ in places]
    searched = 0
    for features, rows in holdings.feature_rows(new.kind, where):
        searched += len(features.keys) if rows is None else len(rows)
        for i, vector in enumerate(vectors):
            found, squared = features.index.nearest(vector, FEATURES_OF_PLACE, rows)
            entries = [
                (float(distance), features.keys[row]) for row, distance in zip(found, squared, strict=True)
            ]
            near[i] = sorted(near[i] + entries)[:FEATURES_OF_PLACE]
    taken: dict[str, int] = {}
    pairs: dict[int, list[str]] = {}
    n_pairs = 0
    for _, key, i in sorted((distance, key, i) for i, found in enumerate(near) for distance, key in found):
        if n_pairs < PAIRS and taken.get(key, 0) < PLACES_OF_GRASP:
            taken[key] = taken.get(key, 0) + 1
            pairs.setdefault(i, []).append(key)
            n_pairs += 1
    return pairs, searched


def _fits(
    new: NewObject,
    places: Sequence[Rows],
    pairs: dict[int, list[str]],
    held: dict[str, HeldFeature],
    metric: Metric,
) -> list[Fit]:
    """Return how the features of all pairs lie on the new object."""
    features = {place: [held[key] for key in keys if key in held] for place, keys in pairs.items()}
    features = {place: found for place, found in features.items() if found}
    starts = in_threads(lambda place: starts_on(new, places[place], features[place]), features)
    if not starts:
        return []
    all_features = [feature for found in features.values() for feature in found]
    all_starts = np.concatenate(starts)

    def lay(first: int) -> list[Fit]:
        some = slice(first, first + CHUNK)
        return lay_onto(new, all_features[some], all_starts[some], metric)

    return [fit for found in in_threads(lay, range(0, len(all_features), CHUNK)) for fit in found]


def _held(
    holdings: Holdings, kind: str, metric: Metric, keys: Sequence[str]
) -> tuple[dict[str, HeldFeature], dict[str, dict[str, Any]]]:
    """Return features with the hand on them, by grasp, and their rows; those without a space are left out."""
    table = holdings.engine.sql(_HELD, {"keys": list(keys)}).table
    rows = {row["grasp"]: row for row in table.drop_columns(["sites_object", "q"]).to_pylist()}
    for row, sites, q in zip(
        rows.values(), flat(table["sites_object"], N_SITES, 3), flat(table["q"], N_Q), strict=True
    ):
        row["sites"], row["q"] = sites, q if np.isfinite(q).all() else None
    features: Features = features_by_key(holdings.engine, kind, metric, list(rows))
    parts = holdings.parts(features, range(len(features.keys)))
    clouds = holdings.clouds(set(features.objects))
    trees = {name: cKDTree(cloud.points) for name, cloud in clouds.items()}
    held = {}
    for i, part in enumerate(parts):
        row, name = rows[part.name], features.objects[i]
        vertices = np.array(row["hull_vertices"], dtype=float)
        planes = hull_planes(vertices)
        if planes is None or not np.isfinite(row["sites"]).all():
            continue
        radii = np.array(row["radii"] or [0.0] * N_SITES, dtype=float)
        held[part.name] = HeldFeature(
            part=part,
            vector=features.index.vectors[i],
            planes=planes,
            box=np.array([vertices.min(axis=0) - 1e-9, vertices.max(axis=0) + 1e-9]),
            sites=row["sites"],
            radii=radii,
            own_gaps=gaps(trees[name], clouds[name], row["sites"], radii),
            contacts=np.array(row["contacts"] or np.empty((0, 3)), dtype=float),
        )
        for cached in (part.dense, part.axes, part.scored, part.scored_normals):
            del cached  # made once, before threads share the part
    return held, rows


def _parts(fit: Fit) -> tuple[ScorePart, ...]:
    distances = {
        "descriptor": fit.descriptor,
        "surface": 1e3 * fit.trimmed,
        "contacts_off": 1 - fit.contacts_on,
    }
    return tuple(
        ScorePart(name, distances[name], weight.unit, weight.scale, weight.weight)
        for name, weight in WEIGHTS.items()
    )


def _cost(fit: Fit) -> float:
    return sum(part.cost for part in _parts(fit))


def _order(fit: Fit) -> tuple[float, str, tuple[float, ...]]:
    return _cost(fit), fit.key, tuple(fit.pose.ravel())


def _hits(
    new: NewObject, fits: Sequence[Fit], held: dict[str, HeldFeature], rows: dict[str, dict[str, Any]]
) -> tuple[PlacedGrasp, ...]:
    hits = []
    firsts: list[set[int]] = []
    for rank, fit in enumerate(fits, 1):
        enclosed = set(fit.rows.tolist())
        place = next(
            (i for i, first in enumerate(firsts) if len(enclosed & first) > SHARED * len(enclosed | first)),
            len(firsts),
        )
        if place == len(firsts):
            firsts.append(enclosed)
        row, feature = rows[fit.key], held[fit.key]
        turn, shift = fit.pose[:3, :3], fit.pose[:3, 3]
        hits.append(
            PlacedGrasp(
                rank=rank,
                place=place + 1,
                grasp=fit.key,
                session=row["session"],
                subject=row["subject"],
                object=row["object"],
                side=row["side"],
                cost=_cost(fit),
                parts=_parts(fit),
                new_from_object=fit.pose,
                points=new.cloud.points[fit.rows],
                sites=feature.sites @ turn.T + shift,
                contacts=feature.contacts @ turn.T + shift,
                q=row["q"],
                one_way=fit.one_way,
                trimmed=fit.trimmed,
                contacts_on=fit.contacts_on,
                penetration=fit.penetration,
            )
        )
    return tuple(hits)
