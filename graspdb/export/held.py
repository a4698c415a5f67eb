"""Grasps with the object, the hand and the lab around them, read with few queries for many."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.items import Floats, Grasp
from graspdb.export.reading import vectors
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.vocabulary import N_SITES, SITES

if TYPE_CHECKING:
    from graspdb.database import Database

_AROUND: Final = """
    SELECT g.grasp, g.grasp_type, g.task, g.n_contacts, h.radii, h.mjcf,
           o.cloud, o.object_ingest_id, o.mass, o.friction, o.center_of_mass, o.cloud_spacing,
           o.category, o.mesh_sha256,
           m.points AS map_points, m.gaps AS map_gaps,
           f.object_position, f.object_quaternion, t.licence, t.data_set,
           (SELECT any_value(s.up) FROM sessions s WHERE list_contains(t.context, s.ingest_id)) AS up
    FROM grasps g
    JOIN trials t ON t.trial = g.trial
    LEFT JOIN grasp_hands h USING (grasp)
    LEFT JOIN grasp_objects o USING (grasp)
    LEFT JOIN contact_maps m USING (grasp)
    LEFT JOIN frames f ON f.trial = g.trial AND f.side = g.side AND f.frame = g.snapshot_frame
    WHERE g.grasp IN (SELECT unnest($grasps))
"""

_CLOUD: Final = """
    SELECT position, normal, area
    FROM object_points
    WHERE ingest_id = $ingest_id AND object = $object
    ORDER BY point
"""

DEFAULT_SPACING: Final = 0.002
"""Spacing of a cloud where the database does not say it [m]."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """The surface of an object, as the database keeps it; object frame.

    Attributes
    ----------
    key : str
        The same for the same cloud, point by point.
    points, normals : ndarray, shape (n, 3)
        Points [m] and outward unit normals; the index is that of `object_points.point`.
    areas : ndarray, shape (n,)
        Surface that each point stands for [m2].
    spacing : float
        Distance of neighbouring points [m].
    """

    key: str
    points: Floats
    normals: Floats
    areas: Floats
    spacing: float


@dataclass(frozen=True, eq=False)
class HeldObject:
    """A grasp, and what it needs around it to be shown, simulated or learned from; object frame.

    Attributes
    ----------
    grasp : Grasp
        The grasp.
    cloud : Cloud
        Surface of the very object it was made on.
    radii : ndarray, shape (20,)
        Radii of the spheres [m]; NaN where they are not stored.
    hand_mjcf : str or None
        The calibrated hand model; None where joint angles are not known.
    map_points, map_gaps : ndarray, shape (k,)
        Points of the cloud near the hand, and their signed distances to it [m].
    mass, friction : float or None
        Mass [kg] and coefficient of friction of the object.
    center : ndarray, shape (3,)
        Centre of mass of the object, or of its surface where the database does not say it [m].
    up : ndarray, shape (3,), or None
        Vertical of the lab frame.
    world_from_object : ndarray, shape (4, 4), or None
        Pose of the object at the snapshot.
    grasp_type, task, category, mesh_sha256, licence, data_set : str or None
        What the database says of the grasp, the object and where they come from.
    """

    grasp: Grasp
    cloud: Cloud
    radii: Floats
    hand_mjcf: str | None
    map_points: NDArray[np.int64]
    map_gaps: Floats
    mass: float | None
    friction: float | None
    center: Floats
    up: Floats | None
    world_from_object: Floats | None
    grasp_type: str | None
    task: str | None
    category: str | None
    mesh_sha256: str | None
    licence: str | None
    data_set: str | None

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Whether each site touches, shape (20,)."""
        return np.isin(np.array(SITES), self.grasp.contact_sites)

    @property
    def contact_site_numbers(self) -> NDArray[np.int64]:
        """Number of the site of each contact point, shape (n_contacts,)."""
        numbers = [SITES.index(site) for site in self.grasp.contact_sites]
        return np.array(numbers[: len(self.grasp.contact_points)], dtype=np.int64)

    @property
    def wrist(self) -> Floats:
        """Origin of the hand segment [m], shape (3,)."""
        return self.grasp.object_from_hand[:3, 3]

    def point_gaps(self) -> Floats:
        """Return the signed distance of each point of the cloud to the hand [m], NaN where it is not near."""
        gaps = np.full(len(self.cloud.points), np.nan)
        gaps[self.map_points] = self.map_gaps
        return gaps

    def in_feature(self) -> NDArray[np.bool_]:
        """Return whether each point of the cloud is one of the graspable feature, shape (n,)."""
        inside = np.zeros(len(self.cloud.points), dtype=bool)
        inside[self.grasp.feature_points] = True
        return inside


class HeldReader:
    """Reads what is around grasps; each object's cloud is read once.

    Parameters
    ----------
    database : Database
        The database.
    """

    def __init__(self, database: "Database") -> None:
        self._database = database
        self._clouds: dict[str, Cloud] = {}

    def read(self, grasps: Sequence[Grasp]) -> Iterator[HeldObject]:
        """Yield grasps with what is around them, in their order."""
        rows = self._database.sql(_AROUND, grasps=[grasp.id for grasp in grasps]).table.to_pylist()
        around = {row["grasp"]: row for row in rows}
        for grasp in grasps:
            row = around[grasp.id]
            cloud = self._cloud(grasp.object, row)
            yield HeldObject(
                grasp=grasp,
                cloud=cloud,
                center=np.array(row["center_of_mass"] or cloud.points.mean(axis=0), dtype=float),
                radii=np.array(row["radii"] or [np.nan] * N_SITES, dtype=float),
                hand_mjcf=row["mjcf"],
                map_points=np.array(row["map_points"] or [], dtype=np.int64),
                map_gaps=np.array(row["map_gaps"] or [], dtype=float),
                up=None if row["up"] is None else np.array(row["up"], dtype=float),
                world_from_object=pose_matrix(row["object_position"], row["object_quaternion"]),
                **{name: row[name] for name in _PLAIN},
            )

    def _cloud(self, name: str, row: Mapping[str, Any]) -> Cloud:
        key = f"{name}-{row['cloud'] or ''}"
        if key not in self._clouds:
            ingest_id = row["object_ingest_id"] or ""
            table = self._database.sql(_CLOUD, ingest_id=ingest_id, object=name).table
            self._clouds[key] = Cloud(
                key=key,
                points=vectors(table["position"], 3),
                normals=vectors(table["normal"], 3),
                areas=table["area"].to_numpy().astype(float),
                spacing=row["cloud_spacing"] or DEFAULT_SPACING,
            )
        return self._clouds[key]


_PLAIN: Final = ("mass", "friction", "grasp_type", "task", "category", "mesh_sha256", "licence", "data_set")


def pose_matrix(position: list[float] | None, quaternion: list[float] | None) -> Floats | None:
    """Return a pose as a matrix, or None where it is not known."""
    if position is None or quaternion is None:
        return None
    pose = np.eye(4)
    pose[:3, :3] = rotations_from_quaternions(np.array([quaternion], dtype=float))[0]
    pose[:3, 3] = position
    return pose if np.isfinite(pose).all() else None
