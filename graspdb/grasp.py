"""One grasp with its arrays."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_schemas.errors import QueryError, nearest
from graspdb_schemas.vocabulary import N_Q, N_SITES

if TYPE_CHECKING:
    from graspdb.database import Database
    from graspdb_queries.engine import Engine

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Grasp:
    """One hold of one object by one hand, as it was at its snapshot; object frame, SI units.

    Attributes
    ----------
    id, trial, session, subject, object, side : str
        Its key, and what it belongs to.
    snapshot_kind : str
        lift_onset, steadiest where there is no lift, or static where there is one instant alone.
    snapshot_time : float or None
        Time of the snapshot [s].
    digits, contact_sites : tuple of str
        Digits in contact, thumb first, and the sites that touch.
    q : ndarray, shape (30,), or as many numbers as the hand model has
        Configuration of the hand [m, 1, rad].
    sites : ndarray, shape (20, 3)
        Centres of the spheres [m].
    gap : ndarray, shape (20,)
        Signed distance of each sphere to the object's cloud [m].
    object_from_hand : ndarray, shape (4, 4)
        Pose of the hand segment.
    contact_points, contact_normals : ndarray, shape (n_contacts, 3)
        Where the sites touch [m], and the outward normals there, in the order of `contact_sites`.
    hull_vertices, hull_faces : ndarray, shapes (n, 3) and (m, 3)
        The enclosing space: vertices [m], and triangles as indices of vertices.
    hull_volume : float or None
        Its volume [m3].
    feature_points : ndarray of int, shape (k,)
        Indices of the object's points in the enclosing space: the graspable feature.
    feature_cloud, feature_normals : ndarray, shape (k, 3)
        Their positions [m] and outward normals.
    descriptor : ndarray, shape (428,)
        Descriptor of the feature.
    quality : mapping of str to float
        Grasp quality indices by name.
    database : Database or None
        Where it comes from, which its picture in a notebook is made of; copies in other processes have none.

    Numbers that are missing are NaN; an array that is missing as a whole has no rows, or is all NaN.
    """

    id: str
    trial: str
    session: str
    subject: str
    object: str
    side: str
    snapshot_kind: str
    snapshot_time: float | None
    digits: tuple[str, ...]
    contact_sites: tuple[str, ...]
    q: Floats
    sites: Floats
    gap: Floats
    object_from_hand: Floats
    contact_points: Floats
    contact_normals: Floats
    hull_vertices: Floats
    hull_faces: NDArray[np.int32]
    hull_volume: float | None
    feature_points: NDArray[np.int32]
    feature_cloud: Floats
    feature_normals: Floats
    descriptor: Floats
    quality: Mapping[str, float]
    database: "Database | None" = field(default=None, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "database": None}

    def _repr_html_(self) -> str:
        """Return facts and, where its database is at hand, a picture, for a notebook."""
        from graspdb.view.notebook import grasp_html

        return grasp_html(self)


def read_grasp(engine: "Engine", key: str) -> Grasp:
    """Return one grasp of a snapshot.

    Raises
    ------
    QueryError
        There is no such grasp.
    """
    return next(read_grasps(engine, [key]))


def read_grasps(engine: "Engine", keys: Sequence[str]) -> Iterator[Grasp]:
    """Yield grasps of a snapshot, in the order of their keys; many with as many queries as one.

    Raises
    ------
    QueryError
        There is no grasp of one of the keys.
    """
    rows = {row["grasp"]: row for row in _rows_of(engine, "grasps", keys)}
    contacts: dict[str, list[dict[str, Any]]] = {}
    for contact in _rows_of(engine, "contacts", keys):
        contacts.setdefault(contact["grasp"], []).append(contact)
    features = {row["grasp"]: row for row in _rows_of(engine, "features", keys)}
    objects = _objects(engine, keys)
    clouds: dict[str, pa.Table] = {}
    for key in keys:
        if key not in rows:
            raise _no_grasp(engine, key)
        cloud = objects.get(key, "")
        if cloud not in clouds:
            clouds[cloud] = _cloud(engine, cloud)
        yield _grasp(rows[key], contacts.get(key, []), features.get(key, {}), clouds[cloud])


def _grasp(
    row: dict[str, Any], contacts: list[dict[str, Any]], feature: dict[str, Any], cloud: pa.Table
) -> Grasp:
    points = np.array(feature.get("points") or [], dtype=np.int32)
    positions, normals = _chosen(cloud, points)
    by_site = {contact["site"]: contact for contact in contacts}
    touching = [by_site[site] for site in row["contact_sites"] or () if site in by_site]
    return Grasp(
        id=row["grasp"],
        **{name: row[name] for name in ("trial", "session", "subject", "object", "side")},
        **{name: row[name] for name in ("snapshot_kind", "snapshot_time", "hull_volume")},
        digits=tuple(row["digits"] or ()),
        contact_sites=tuple(row["contact_sites"] or ()),
        q=_floats(row["q"], (N_Q,)),
        sites=_floats(row["sites_object"], (N_SITES, 3)),
        gap=_floats(row["gap"], (N_SITES,)),
        object_from_hand=_floats(row["object_from_hand"], (4, 4)),
        contact_points=_rows([contact["position"] for contact in touching]),
        contact_normals=_rows([contact["normal"] for contact in touching]),
        hull_vertices=_rows(feature.get("hull_vertices")),
        hull_faces=np.array(feature.get("hull_faces") or [], dtype=np.int32).reshape(-1, 3),
        feature_points=points,
        feature_cloud=positions,
        feature_normals=normals,
        descriptor=np.array(feature.get("descriptor") or [], dtype=float),
        quality=dict(row["quality"] or ()),
    )


def _rows_of(engine: "Engine", table: str, keys: Sequence[str]) -> list[dict[str, Any]]:
    """Return the rows of a table that belong to some grasps."""
    statement = f"SELECT * FROM {table} WHERE grasp IN (SELECT unnest($grasps))"
    return list(engine.sql(statement, {"grasps": list(keys)}).table.to_pylist())


def _objects(engine: "Engine", keys: Sequence[str]) -> dict[str, str]:
    """Return, by grasp, the ingest_id of the very rows of the object that it stands on."""
    statement = "SELECT grasp, object_ingest_id FROM grasp_objects WHERE grasp IN (SELECT unnest($grasps))"
    return dict(engine.sql(statement, {"grasps": list(keys)}).rows())


def _cloud(engine: "Engine", ingest_id: str) -> pa.Table:
    """Return the points of an object: number, position and normal."""
    return engine.sql(
        "SELECT point, position, normal FROM object_points WHERE ingest_id = $ingest_id",
        {"ingest_id": ingest_id},
    ).table


def _chosen(cloud: pa.Table, points: NDArray[np.int32]) -> tuple[Floats, Floats]:
    """Return positions and normals of some points of a cloud, those that it has."""
    by_point = dict(zip(cloud["point"].to_pylist(), range(cloud.num_rows), strict=True))
    rows = [by_point[point] for point in points.tolist() if point in by_point]
    chosen = cloud.take(np.array(rows, dtype=np.int64))
    return _rows(chosen["position"].to_pylist()), _rows(chosen["normal"].to_pylist())


def _rows(values: list[Any] | None) -> Floats:
    """Return vectors as an array of shape (n, 3), NaN where one is missing."""
    vectors = [[np.nan] * 3 if value is None else value for value in values or ()]
    return np.array(vectors, dtype=float).reshape(-1, 3)


def _floats(values: list[Any] | None, shape: tuple[int, ...]) -> Floats:
    """Return numbers as an array of a shape, NaN where they are missing."""
    if values is None:
        return np.full(shape, np.nan)
    if len(shape) == 1:
        return np.array(values, dtype=float)
    return np.array([[np.nan] * shape[1] if row is None else row for row in values], dtype=float)


def _no_grasp(engine: "Engine", key: str) -> QueryError:
    """Say which grasps there are with names like this."""
    keys = engine.sql("SELECT grasp FROM grasps").table["grasp"].to_pylist()
    return QueryError(
        f"the database has no grasp {key!r}{nearest(key, keys)}",
        "graspdb sql 'SELECT grasp FROM grasps' lists them.",
    )
