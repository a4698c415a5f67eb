"""Postural synergies: principal components of joint angles, grasps among them, clusters of grasps."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from graspdb_queries.postures import (
    Array,
    Moments,
    at_least_one,
    joints_of,
    moments,
    principal_components,
    whole_rows,
)
from graspdb_schemas.errors import QueryError

_MOST_GRASPS: Final = 10_000
"""Grasps that are clustered at most: the distances of all their pairs take 400 MB."""

Rows = Iterable[pa.RecordBatch]


def components(rows: Rows, parameters: Mapping[str, Any]) -> pa.Table:
    """Return the synergies of postures; see ``sql/synergies.sql``."""
    joints = joints_of(parameters)
    found = moments(rows, joints)
    synergies = principal_components(found, parameters["normalisation"])
    explained = synergies.variances / synergies.total if synergies.total else synergies.variances
    n = len(explained)
    return pa.table(
        {
            "component": pa.array(range(1, n + 1), pa.int32()),
            "variance": synergies.variances,
            "explained": explained,
            "cumulative": np.cumsum(explained),
            "n_postures": pa.array([found.n] * n, pa.int64()),
            "loadings": pa.array(
                [list(zip(joints, axis.tolist(), strict=True)) for axis in synergies.axes],
                pa.map_(pa.string(), pa.float64()),
            ),
        }
    )


def space(rows: Rows, parameters: Mapping[str, Any]) -> pa.Table:
    """Return where grasps lie in the space of their synergies; see ``sql/synergy_space.sql``."""
    n_components = at_least_one(parameters, "components")
    grasps, angles = _grasps(rows, parameters)
    synergies = principal_components(_moments(angles), parameters["normalisation"])
    axes = synergies.axes[:n_components]
    centred = synergies.scaled(angles)
    scores = centred @ axes.T
    # Angles that never vary are the mean; 0 times infinity would not say so.
    scale = np.where(np.isfinite(synergies.scale), synergies.scale, 0.0)
    left = (centred - scores @ axes) * scale
    residual = np.sqrt(np.mean(left**2, axis=1))
    return (
        grasps.append_column("score_1", _score(scores, 0))
        .append_column("score_2", _score(scores, 1))
        .append_column("scores", pa.array(scores.tolist(), pa.list_(pa.float64())))
        .append_column("residual", pa.array(residual, pa.float64()))
    )


def clusters(rows: Rows, parameters: Mapping[str, Any]) -> pa.Table:
    """Return grasps in clusters of like posture; see ``sql/grasp_clusters.sql``.

    Raises
    ------
    QueryError
        There are too many grasps to compare each with each.
    """
    n_clusters = at_least_one(parameters, "clusters")
    grasps, angles = _grasps(rows, parameters)
    if len(angles) > _MOST_GRASPS:
        raise QueryError(
            f"{len(angles):,} grasps are too many to compare each with each",
            f"Choose at most {_MOST_GRASPS:,} by the parameters object or subject.",
        )
    scaled = principal_components(_moments(angles), parameters["normalisation"]).scaled(angles)
    labels = _labels(scaled, n_clusters, parameters["linkage"])
    order = np.lexsort((np.arange(len(labels)), labels))
    sizes = np.bincount(labels) if len(labels) else np.zeros(0, int)
    distance, central = np.zeros(len(labels)), np.zeros(len(labels), bool)
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        off = np.linalg.norm(scaled[members] - scaled[members].mean(axis=0), axis=1)
        central[members[off.argmin()]] = True
        distance[members] = np.sqrt(np.mean((angles[members] - angles[members].mean(axis=0)) ** 2, axis=1))
    answer = {
        "cluster": pa.array(labels + 1, pa.int32()),
        "n_grasps": pa.array(sizes[labels], pa.int64()),
        "distance": pa.array(distance, pa.float64()),
        "central": pa.array(central, pa.bool_()),
    }
    for name, column in answer.items():
        grasps = grasps.append_column(name, column)
    return grasps.take(pa.array(order))


def _grasps(rows: Rows, parameters: Mapping[str, Any]) -> tuple[pa.Table, Array]:
    """Return the grasps that have every joint angle asked for, and these angles, shape (n, d)."""
    joints = joints_of(parameters)
    parts = list(whole_rows(rows, joints))
    schema = pa.schema([(name, pa.string()) for name in ("grasp", "subject", "object")])
    grasps = pa.Table.from_batches([batch.select(schema.names).cast(schema) for batch, _ in parts], schema)
    return grasps, np.concatenate([np.zeros((0, len(joints))), *(angles for _, angles in parts)])


def _moments(angles: Array) -> Moments:
    d = angles.shape[1]
    return Moments(0, np.zeros(d), np.zeros((d, d))).with_rows(angles)


def _score(scores: Array, i: int) -> pa.Array:
    """Return one column of scores, nulls where there are not so many components."""
    return pa.array(scores[:, i]) if scores.shape[1] > i else pa.nulls(len(scores), pa.float64())


def _labels(scaled: Array, n_clusters: int, method: Any) -> NDArray[np.int64]:
    """Return the cluster of each row: 0 is the largest; of two of one size, that with the earlier row."""
    if len(scaled) < 2:
        return np.zeros(len(scaled), np.int64)
    tree: Any = linkage(scaled, method)
    found = fcluster(tree, n_clusters, criterion="maxclust")
    _, first, inverse, counts = np.unique(found, return_index=True, return_inverse=True, return_counts=True)
    rank = np.empty(len(counts), np.int64)
    rank[np.lexsort((first, -counts))] = np.arange(len(counts))
    return rank[inverse]
