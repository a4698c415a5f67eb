"""What a snapshot holds for comparisons, kept in memory between questions or read in batches."""

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.engine import Engine
from graspdb_queries.similar.library import (
    Cloud,
    Features,
    HandRows,
    all_features,
    clouds_by_id,
    feature_batches,
    features_by_key,
    hand_batches,
    learn,
    part_of,
)
from graspdb_queries.similar.metric import Metric
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.where import filtered_grasps

MOST_CLOUDS: Final = 256
"""Objects whose clouds stay in memory."""

DEFAULT_MEMORY: Final = 4 * 1024**3
"""Bytes above which features are read anew for every question instead of being kept."""

Rows = NDArray[np.int64]


class Holdings:
    """Features, hands and clouds of one snapshot.

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

    @cached_property
    def in_memory(self) -> bool:
        """Whether the features are kept."""
        points, n = self.engine.sql("SELECT sum(feature_points), count(*) FROM grasps").rows()[0]
        return 4 * int(points or 0) + 1024 * int(n) <= self.memory

    def count(self, where: str | None) -> int:
        """Return the number of grasps that pass a filter."""
        clause = "" if where is None else f" WHERE (\n{where}\n)"
        return int(self.engine.sql(f"SELECT count(*) FROM grasps{clause}").rows()[0][0])

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

    def features_of(self, kind: str, keys: Iterable[str]) -> Features:
        """Return features among which are those of some grasps: all that are in memory, or these alone."""
        if self.in_memory:
            return self.features(kind)
        return features_by_key(self.engine, kind, self.metric(kind), list(keys))

    def feature_rows(self, kind: str, where: str | None) -> Iterator[tuple[Features, Rows | None]]:
        """Yield features and which of their rows count: all at once from memory, or batch by batch."""
        if not self.in_memory:
            for batch in feature_batches(self.engine, kind, self.metric(kind), where):
                yield batch, None
            return
        features = self.features(kind)
        yield features, None if where is None else features.rows_of(filtered_grasps(self.engine, where))

    def hand_rows(self, where: str | None) -> Iterator[HandRows]:
        """Yield the hands of the grasps that pass a filter, from memory or batch by batch."""
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

    def parts(self, features: Features, rows: Iterable[int]) -> list[Part]:
        """Return features as clouds."""
        rows = list(rows)
        clouds = self.clouds({features.objects[row] for row in rows})
        return [part_of(features, row, clouds[features.objects[row]]) for row in rows]

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

    @cached_property
    def _hands(self) -> list[HandRows]:
        return list(hand_batches(self.engine, None))
