"""The shapes that a picture of a grasp consists of, read for many grasps at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb.database import Database
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, DIGITS, N_SITES, SITES

Floats = NDArray[np.float64]

_RADIUS: Final = 0.008
"""Radius of a site of a hand that is not known [m]."""

_OBJECTS_KEPT: Final = 16
"""Objects whose clouds a reader keeps."""

_WRIST: Final = N_SITES
"""Number of the wrist, behind those of the sites."""

_PALM: Final = tuple(range(0, N_SITES, N_SITES // len(DIGITS)))
"""The sites at the palm: the first of each digit."""

_BONES: Final = (
    *((i, i + 1) for i in range(N_SITES - 1) if DIGIT_OF_SITE[i] == DIGIT_OF_SITE[i + 1]),
    *((_WRIST, i) for i in _PALM),
    *pairwise(_PALM[1:]),
)
"""What is drawn between which sites: along the digits, from the wrist to the palm, across the palm."""


@dataclass(frozen=True, eq=False)
class ObjectShape:
    """The surface of an object, as a cloud.

    Attributes
    ----------
    points, normals : ndarray, shape (n, 3)
        Points [m] and outward unit normals, object frame.
    """

    points: Floats
    normals: Floats


@dataclass(frozen=True, eq=False)
class GraspShape:
    """What there is to see of a grasp at its snapshot; object frame.

    Attributes
    ----------
    grasp, side : str
        Its key; right or left.
    object : ObjectShape
        The object, shared by the grasps of it.
    feature : ndarray of int, shape (k,)
        Indices of the object's points that are the graspable feature.
    sites : ndarray, shape (20, 3)
        Centres of the spheres [m]; NaN where one is not known.
    radii : ndarray, shape (20,)
        Their radii [m].
    wrist : ndarray, shape (3,)
        Origin of the hand segment [m]; NaN where it is not known.
    touching : ndarray of bool, shape (20,)
        Which spheres touch.
    hull : ndarray, shape (n, 3)
        Vertices of the enclosing space [m].
    """

    grasp: str
    side: str
    object: ObjectShape
    feature: NDArray[np.int64]
    sites: Floats
    radii: Floats
    wrist: Floats
    touching: NDArray[np.bool_]
    hull: Floats

    def bones(self) -> tuple[Floats, Floats]:
        """Return the known segments of the hand: ends, shape (n, 2, 3) [m], and radii, (n, 2) [m]."""
        places = np.vstack([self.sites, self.wrist])
        radii = np.append(self.radii, self.radii[list(_PALM)].mean())
        pairs = np.array(_BONES)
        known = np.isfinite(places[pairs]).all(axis=(1, 2))
        return places[pairs][known], radii[pairs][known]


_SHAPES: Final = """
    SELECT g.grasp, g.side, g.object, g.sites_object, g.object_from_hand, g.contact_sites,
           o.object_ingest_id, h.radii, f.points, f.hull_vertices
    FROM grasps g
    LEFT JOIN grasp_objects o USING (grasp)
    LEFT JOIN grasp_hands h USING (grasp)
    LEFT JOIN features f USING (grasp)
    WHERE list_contains($grasps, g.grasp)
    ORDER BY g.object, o.object_ingest_id, g.grasp
"""


_CLOUD: Final = """
    SELECT position, normal FROM object_points WHERE object = $object AND ingest_id = $id ORDER BY point
"""


class ShapeReader:
    """Reads the shapes of grasps from one database; keeps the objects that it read last.

    Parameters
    ----------
    database : Database
        The database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._object = lru_cache(_OBJECTS_KEPT)(partial(_object, database))

    def shapes(self, grasps: Sequence[str]) -> Iterator[GraspShape]:
        """Yield the shapes of grasps, those on one object together; keys that there are not are left out."""
        for row in self._database.sql(_SHAPES, grasps=list(grasps)).table.to_pylist():
            yield _shape(row, self._object(row["object"], row["object_ingest_id"]))


def _object(database: Database, name: str, ingest_id: str | None) -> ObjectShape:
    """Return the cloud of one version of an object."""
    table = database.sql(
        _CLOUD,
        object=name,
        id=ingest_id,
    ).table
    return ObjectShape(_vectors(table["position"]), _vectors(table["normal"]))


def _vectors(column: pa.ChunkedArray) -> Floats:
    """Return a column of vectors as an array of shape (n, 3), NaN where one is missing."""
    if column.null_count == 0 and len(column.combine_chunks().flatten()) == 3 * len(column):
        return np.asarray(column.combine_chunks().flatten().to_numpy(zero_copy_only=False), float).reshape(
            -1, 3
        )
    rows = [[np.nan] * 3 if row is None else row for row in column.to_pylist()]
    return np.array(rows, dtype=float).reshape(-1, 3)


def _shape(row: dict[str, Any], body: ObjectShape) -> GraspShape:
    sites = np.full((N_SITES, 3), np.nan)
    for i, site in enumerate(row["sites_object"] or ()):
        if site is not None:
            sites[i] = site
    pose = row["object_from_hand"]
    radii = row["radii"] if len(row["radii"] or ()) == N_SITES else [_RADIUS] * N_SITES
    touching = set(row["contact_sites"] or ())
    feature = np.array(row["points"] or [], dtype=np.int64)
    return GraspShape(
        grasp=row["grasp"],
        side=row["side"],
        object=body,
        feature=feature[feature < len(body.points)],
        sites=sites,
        radii=np.array([_RADIUS if radius is None else radius for radius in radii]),
        wrist=np.full(3, np.nan) if pose is None else np.array([line[3] for line in pose[:3]], dtype=float),
        touching=np.array([site in touching for site in SITES]),
        hull=np.array(row["hull_vertices"] or [], dtype=float).reshape(-1, 3),
    )
