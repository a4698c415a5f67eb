"""What a snapshot holds of features and hands, as arrays: all of it in memory, or batch by batch."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_queries.engine import Engine
from graspdb_queries.similar.hands import Hands, hands_of, touching_of
from graspdb_queries.similar.metric import MOST_LEARNED, Metric, Vectors, learn_metric
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.vectors import VectorIndex
from graspdb_schemas.vocabulary import N_Q, N_SITES

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

_FEATURES: Final = """
    SELECT f.grasp, f.descriptor, f.points, f.extents, f.area, o.object_ingest_id, g.object_from_hand
    FROM features f JOIN grasps g USING (grasp) JOIN grasp_objects o USING (grasp)
    WHERE f.descriptor_kind = $kind AND len(f.points) > 0
"""
_HANDS: Final = "SELECT grasp, side, sites_object, object_from_hand, q, contact_sites FROM grasps"


@dataclass(frozen=True, eq=False)
class Features:
    """Features with a descriptor, in the order of their keys.

    Attributes
    ----------
    keys : tuple of str
        Their grasps.
    index : VectorIndex
        Their vectors.
    sizes : VectorIndex
        Their extents and the square roots of their areas [m], shape (n, 4); zero where not known.
    starts : ndarray of int, shape (n + 1,)
        Where the points of each begin in `points`.
    points : ndarray of int32
        Indices of the points of their objects' clouds.
    objects : tuple of str
        For each, the ingest_id of its object's rows.
    object_from_hand : ndarray of float32, shape (n, 4, 4)
        Poses of the hands; NaN where not known.
    """

    keys: tuple[str, ...]
    index: VectorIndex
    sizes: VectorIndex
    starts: Rows
    points: NDArray[np.int32]
    objects: tuple[str, ...]
    object_from_hand: NDArray[np.float64]

    def rows_of(self, keys: Sequence[str]) -> Rows:
        """Return the rows of keys, ascending; keys that have none are passed over."""
        found = (self.places.get(key) for key in keys)
        return np.sort(np.array([row for row in found if row is not None], dtype=np.int64))

    @cached_property
    def places(self) -> dict[str, int]:
        """Row of each key."""
        return {key: i for i, key in enumerate(self.keys)}


@dataclass(frozen=True, eq=False)
class HandRows:
    """Hands of grasps, in the order of their keys."""

    keys: tuple[str, ...]
    hands: Hands


@dataclass(frozen=True, eq=False)
class Cloud:
    """An object's points, normals and histograms."""

    points: Floats
    normals: Floats
    histograms: NDArray[np.float32]


def learn(engine: Engine, kind: str) -> Metric:
    """Return the metric of a snapshot's descriptors of one kind."""
    sample = engine.sql(
        "SELECT descriptor FROM features WHERE descriptor_kind = $kind "
        f"ORDER BY md5(grasp), grasp LIMIT {MOST_LEARNED}",
        {"kind": kind},
    ).table
    return learn_metric(descriptors_of(sample["descriptor"]))


def feature_batches(engine: Engine, kind: str, metric: Metric, where: str | None) -> Iterator[Features]:
    """Yield the features of one kind whose grasps pass a filter, a batch at a time."""
    statement = _FEATURES
    if where is not None:
        statement += f" AND f.grasp IN (SELECT grasp FROM grasps WHERE (\n{where}\n))"
    with engine.stream(statement, {"kind": kind}) as stream:
        for batch in stream:
            yield _features(pa.Table.from_batches([batch]), metric)


def all_features(engine: Engine, kind: str, metric: Metric) -> Features:
    """Return all features of one kind."""
    parts = list(feature_batches(engine, kind, metric, None))
    keys = [key for part in parts for key in part.keys]
    order = np.argsort(np.array(keys, dtype=object), kind="stable")
    counts = np.concatenate([np.diff(part.starts) for part in parts] or [np.empty(0, np.int64)])
    points = np.concatenate([part.points for part in parts] or [np.empty(0, np.int32)])
    starts = np.concatenate([[0], np.cumsum(counts)])
    placed = np.concatenate([[0], np.cumsum(counts[order])]).astype(np.int64)
    picked = np.repeat(starts[order] - placed[:-1], counts[order]) + np.arange(placed[-1])
    objects = [name for part in parts for name in part.objects]
    vectors = [part.index.vectors for part in parts] or [np.empty((0, metric.length), np.float32)]
    sizes = [part.sizes.vectors for part in parts] or [np.empty((0, 4), np.float32)]
    poses = [part.object_from_hand for part in parts] or [np.empty((0, 4, 4))]
    return Features(
        keys=tuple(keys[i] for i in order),
        index=VectorIndex(np.concatenate(vectors)[order]),
        sizes=VectorIndex(np.concatenate(sizes)[order]),
        starts=placed,
        points=points[picked],
        objects=tuple(objects[i] for i in order),
        object_from_hand=np.concatenate(poses)[order],
    )


def hand_batches(engine: Engine, where: str | None) -> Iterator[HandRows]:
    """Yield the hands of the grasps that pass a filter, a batch at a time."""
    statement = _HANDS if where is None else f"{_HANDS} WHERE (\n{where}\n)"
    with engine.stream(statement) as stream:
        for batch in stream:
            table = pa.Table.from_batches([batch])
            keys = table["grasp"].to_pylist()
            order = np.argsort(np.array(keys, dtype=object), kind="stable")
            yield HandRows(tuple(keys[i] for i in order), _hands(table).take(order))


def hands_by_key(engine: Engine, keys: Sequence[str]) -> dict[str, Hands]:
    """Return the hands of some grasps."""
    table = engine.sql(f"{_HANDS} WHERE grasp IN (SELECT unnest($keys))", {"keys": list(keys)}).table
    hands = _hands(table)
    return {key: hands.row(i) for i, key in enumerate(table["grasp"].to_pylist())}


def features_by_key(engine: Engine, kind: str, metric: Metric, keys: Sequence[str]) -> Features:
    """Return the features of some grasps."""
    statement = f"{_FEATURES} AND f.grasp IN (SELECT unnest($keys))"
    return _features(engine.sql(statement, {"kind": kind, "keys": list(keys)}).table, metric)


def clouds_by_id(engine: Engine, ids: Sequence[str]) -> dict[str, Cloud]:
    """Return the clouds of objects by their ingest_id."""
    table = engine.sql(
        "SELECT ingest_id, position, normal, fpfh FROM object_points "
        "WHERE ingest_id IN (SELECT unnest($ids)) ORDER BY ingest_id, point",
        {"ids": list(ids)},
    ).table
    owners = np.array(table["ingest_id"].to_pylist(), dtype=object)
    position, normal, fpfh = (
        flat(table[name], n) for name, n in (("position", 3), ("normal", 3), ("fpfh", 33))
    )
    found = {}
    for name in ids:
        rows = np.flatnonzero(owners == name)
        found[name] = Cloud(position[rows], normal[rows], fpfh[rows].astype(np.float32))
    return found


def part_of(features: Features, row: int, cloud: Cloud) -> Part:
    """Return a feature as a cloud."""
    points = features.points[features.starts[row] : features.starts[row + 1]]
    return Part(
        name=features.keys[row],
        points=cloud.points[points],
        normals=cloud.normals[points],
        histograms=cloud.histograms[points],
        object_from_hand=features.object_from_hand[row],
    )


def descriptors_of(column: pa.ChunkedArray) -> Vectors:
    """Return a column of descriptors, none of them null, as an array, shape (n, 428)."""
    flat_values = column.combine_chunks().flatten().to_numpy()
    return flat_values.reshape(len(column), -1) if len(column) else np.empty((0, 428), np.float32)


def sizes_of(extents: NDArray[np.floating], areas: NDArray[np.floating]) -> Vectors:
    """Return sizes that compare as vectors, shape (n, 4) [m], from extents, (n, 3), and areas, (n,)."""
    return np.asarray(np.nan_to_num(np.column_stack([extents, np.sqrt(areas)])), dtype=np.float32)


def flat(column: pa.ChunkedArray, *shape: int) -> Floats:
    """Return a column of lists as an array, shape (n, *shape); rows that are null are NaN."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    values = np.full((len(array), *shape), np.nan)
    known = np.asarray(array.is_valid())
    inner = array.filter(pa.array(known))
    if not len(inner):
        return values
    leaves = inner.flatten()
    if len(shape) > 1:
        if leaves.null_count:
            rows = [[[np.nan] * shape[1] if row is None else row for row in r] for r in inner.to_pylist()]
            values[known] = np.array(rows, dtype=float)
            return values
        leaves = leaves.flatten()
    values[known] = leaves.to_numpy(zero_copy_only=False).reshape(-1, *shape)
    return values


def _features(table: pa.Table, metric: Metric) -> Features:
    """Return the rows of a table of features, in the order of their keys."""
    keys = table["grasp"].to_pylist()
    order = np.argsort(np.array(keys, dtype=object), kind="stable")
    table = table.take(order)
    points = table["points"].combine_chunks()
    return Features(
        keys=tuple(keys[i] for i in order),
        index=VectorIndex(metric.vectors(descriptors_of(table["descriptor"]))),
        sizes=VectorIndex(sizes_of(flat(table["extents"], 3), table["area"].to_numpy())),
        starts=np.concatenate([[0], np.cumsum(points.value_lengths().to_numpy())]).astype(np.int64),
        points=points.flatten().to_numpy(),
        objects=tuple(table["object_ingest_id"].to_pylist()),
        object_from_hand=flat(table["object_from_hand"], 4, 4),
    )


def _hands(table: pa.Table) -> Hands:
    return hands_of(
        flat(table["sites_object"], N_SITES, 3),
        flat(table["object_from_hand"], 4, 4),
        np.array([side == "left" for side in table["side"].to_pylist()], dtype=bool),
        flat(table["q"], N_Q),
        touching_of(table["contact_sites"].to_pylist()),
    )
