"""Where the objects of a session were touched."""

from dataclasses import dataclass

import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from graspdb.database import Database

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ObjectDensity:
    """Contacts on the surface of one object.

    Attributes
    ----------
    object : str
        Its name.
    n_grasps : int
        Grasps of it.
    points, normals : ndarray, shape (n, 3)
        Its cloud [m], object frame.
    density : ndarray, shape (n,)
        Contacts for each grasp and area about each point [1/m2].
    """

    object: str
    n_grasps: int
    points: Floats
    normals: Floats
    density: Floats


def contact_densities(database: Database) -> tuple[ObjectDensity, ...]:
    """Return the contact density of every object that was grasped, each version of it by itself."""
    densities = []
    for name, cloud, ingest_id, n_grasps in database.sql(_CLOUDS).rows():
        rows = database.query("where_grasped", object=name).table
        rows = rows.filter(pc.field("cloud") == cloud).sort_by("point")
        normals = database.sql(_NORMALS, object=name, id=ingest_id).table["normal"].to_pylist()
        if len(normals) != rows.num_rows or not rows.num_rows:
            continue
        points = np.stack([rows[axis].to_numpy() for axis in "xyz"], axis=1)
        array = np.array([normal or [np.nan] * 3 for normal in normals], dtype=float)
        densities.append(ObjectDensity(name, n_grasps, points, array, rows["contact_density"].to_numpy()))
    return tuple(densities)


_CLOUDS = """
    SELECT object, cloud, min(object_ingest_id), count(*)
    FROM grasp_objects
    GROUP BY object, cloud
    ORDER BY object, min(object_ingest_id)
"""

_NORMALS = """
    SELECT normal FROM object_points WHERE object = $object AND ingest_id = $id ORDER BY point
"""
