"""Scenes read from a database."""

from typing import Any, Final

import numpy as np

from graspdb.database import Database
from graspdb.view.motion import Times, array_of, elbows, read_motion
from graspdb.view.scene import ELBOW, NODES, WRIST, ContactMap, Floats, ObjectSurface, Scene
from graspdb.view.surface import triangles_between
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_ingest.surface.parts import WRIST_RADIUS
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import N_SITES, SITES

_GRASP: Final = """
    SELECT g.task, g.repetition, g.grasp_type, g.contact_threshold, g.snapshot_frame, g.snapshot_time,
           g.onset_time, g.lift_time, g.release_time, h.radii, o.cloud, o.object_ingest_id,
           (SELECT s.up FROM sessions s JOIN trials t ON list_contains(t.context, s.ingest_id)
            WHERE t.trial = g.trial LIMIT 1) AS up
    FROM grasps g
    LEFT JOIN grasp_hands h USING (grasp)
    LEFT JOIN grasp_objects o USING (grasp)
    WHERE g.grasp = $grasp
"""

_CLOUD: Final = """
    SELECT position, normal, area
    FROM object_points
    WHERE ingest_id = $ingest_id AND object = $object
    ORDER BY point
"""

_FRAMES: Final = """
    SELECT frame, time, q, sites, object_position, object_quaternion, gap, touching
    FROM frames
    WHERE trial = $trial AND side = $side AND time BETWEEN $first AND $last
    ORDER BY frame
"""

_NEIGHBOURS: Final = """
    SELECT max(release_time) FILTER (release_time <= $at) AS before,
           min(onset_time) FILTER (onset_time > $at) AS after
    FROM grasps
    WHERE trial = $trial AND side = $side AND grasp <> $grasp
"""
"""When the hand let go before a grasp, and when it takes hold again after it."""

_SNAPSHOT: Final = """
    SELECT q, object_quaternion FROM frames WHERE trial = $trial AND side = $side AND frame = $frame
"""

FOREARM_RADIUS: Final = 1.1
"""Radius of the drawn forearm over the wrist's."""


class SceneReader:
    """Scenes of one database; each object's surface is made once.

    Parameters
    ----------
    database : Database
        The database.
    """

    def __init__(self, database: Database) -> None:
        self.database = database
        self._surfaces: dict[str, ObjectSurface] = {}

    def scene(self, key: str, *, motion: bool = True) -> Scene:
        """Return the scene of a grasp.

        Parameters
        ----------
        key : str
            The grasp.
        motion : bool
            Whether the frames of its trial are wanted, too.

        Raises
        ------
        QueryError
            There is no such grasp, or the radii of its hand are not stored.
        """
        grasp = self.database.grasp(key)
        row = self.database.sql(_GRASP, grasp=key).table.to_pylist()[0]
        if not row["radii"]:
            raise QueryError(
                f"the radii of the hand of grasp {key!r} are not stored", "Ingest its session again."
            )
        hand = {"trial": grasp.trial, "side": grasp.side}
        snapshot = self._snapshot(row["snapshot_frame"], hand)
        nodes = _nodes(grasp.sites, grasp.object_from_hand[:3, 3])
        nodes[ELBOW] = _elbow(snapshot, nodes[WRIST])
        up = None if row["up"] is None else np.array(row["up"], dtype=float)
        frames = self._frames(key, row["snapshot_time"], hand) if motion else None
        surface = self._surface(row, grasp.object)
        times = Times(row["onset_time"], row["lift_time"], row["release_time"])
        return Scene(
            grasp=grasp,
            task=row["task"],
            repetition=row["repetition"],
            grasp_type=row["grasp_type"],
            threshold=row["contact_threshold"],
            surface=surface,
            nodes=nodes,
            radii=_radii(row["radii"]),
            contact_map=self._contact_map(key, len(surface.points)),
            up=_object_up(up, snapshot),
            motion=None if frames is None else read_motion(frames, row["snapshot_frame"], nodes, up, times),
        )

    def _snapshot(self, frame: int | None, hand: dict[str, str]) -> dict[str, Any]:
        """Return configuration and object pose in the frame of the snapshot, None where there are none."""
        if frame is None:
            return {"q": None, "object_quaternion": None}
        rows = self.database.sql(_SNAPSHOT, frame=frame, **hand).table.to_pylist()
        return dict(rows[0]) if rows else {"q": None, "object_quaternion": None}

    def _frames(self, key: str, at: float | None, hand: dict[str, str]) -> dict[str, list[Any]] | None:
        """Return the frames from the hand's last release before the grasp to its next onset after it."""
        if at is None:
            return None
        before, after = self.database.sql(_NEIGHBOURS, grasp=key, at=at, **hand).rows()[0]
        window = {
            "first": -np.inf if before is None else before,
            "last": np.inf if after is None else after,
        }
        return dict(self.database.sql(_FRAMES, **hand, **window).table.to_pydict())

    def _surface(self, row: dict[str, Any], name: str) -> ObjectSurface:
        """Return the surface of the very object that the grasp stands on."""
        cloud = row["cloud"] or ""
        if cloud not in self._surfaces:
            found = self.database.sql(_CLOUD, ingest_id=row["object_ingest_id"] or "", object=name).table
            points = array_of(found["position"].to_pylist(), (3,))
            normals = array_of(found["normal"].to_pylist(), (3,))
            areas = array_of(found["area"].to_pylist(), ())
            faces = triangles_between(points, normals, areas)
            self._surfaces[cloud] = ObjectSurface(points, normals, areas, faces)
        return self._surfaces[cloud]

    def _contact_map(self, key: str, n_points: int) -> ContactMap | None:
        rows = self.database.sql(
            "SELECT points, gaps, surface FROM contact_maps WHERE grasp = $grasp", grasp=key
        ).rows()
        if not rows or rows[0][0] is None or rows[0][1] is None:
            return None
        points, gaps = np.array(rows[0][0], dtype=np.int32), np.array(rows[0][1], dtype=float)
        there = points < n_points
        return ContactMap(points[there], gaps[there], str(rows[0][2] or ""))


def read_scene(database: Database, key: str, *, motion: bool = True) -> Scene:
    """Return the scene of one grasp; see `SceneReader`, which is quicker for many.

    Raises
    ------
    QueryError
        There is no such grasp, or the radii of its hand are not stored.
    """
    return SceneReader(database).scene(key, motion=motion)


def _nodes(sites: Floats, wrist: Floats) -> Floats:
    nodes = np.full((len(NODES), 3), np.nan)
    nodes[:N_SITES], nodes[WRIST] = sites, wrist
    return nodes


def _radii(radii: list[float]) -> Floats:
    wrist = WRIST_RADIUS * radii[SITES.index("middle_mcp")]
    return np.array([*radii, wrist, FOREARM_RADIUS * wrist], dtype=float)


def _elbow(snapshot: dict[str, Any], wrist: Floats) -> Floats:
    """Return the end of the drawn forearm in the object frame [m], NaN where it is not known."""
    world = elbows([snapshot["q"]], np.zeros((1, 3)))[0]
    return np.asarray(wrist + _world_from_object(snapshot).T @ world)


def _object_up(up: Floats | None, snapshot: dict[str, Any]) -> Floats:
    """Return the lab's vertical in the object frame."""
    vertical = _world_from_object(snapshot).T @ up if up is not None else np.full(3, np.nan)
    return vertical if np.isfinite(vertical).all() else np.array([0.0, 0.0, 1.0])


def _world_from_object(snapshot: dict[str, Any]) -> Floats:
    return np.asarray(rotations_from_quaternions(array_of([snapshot["object_quaternion"]], (4,)))[0])
