"""A database of a mug in one hand: a tracked trial with markers, an imported one, and a static grasp."""

from pathlib import Path
from typing import Any

import numpy as np
from handmade import rows
from mug_database import mug, write
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from graspdb.store import Store
from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.mesh import load_surface
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import SITES, Side

RATE = 50.0
N_FRAMES = 40
SNAPSHOT = 20
LOST = slice(3, 6)
"""Frames of the tracked trial in which the object is not known."""
UNTRACKED = slice(0, 2)
"""Frames of it in which the hand is not known."""
MARKERS = ("dorsum", "tip")
TOUCHING = (3, 7, 11)
"""Sites that touch: the tips of thumb, index and middle finger."""
TRACKED, IMPORTED, STATIC = "lab/a mug?.1/right/0", "set/clip/right/0", "set/photo/right/0"
GRASPS = (TRACKED, IMPORTED, STATIC)


def hand() -> HandModel:
    """Return a right hand with two markers."""
    placements = {"dorsum": MarkerPlacement("hand"), "tip": MarkerPlacement("index_distal", at="index_tip")}
    return build_hand(HandDimensions(0.19, 0.085), Side.RIGHT, placements)


def motion() -> dict[str, np.ndarray]:
    """Return q, sites and markers of the hand, and the pose of the object, in every frame; lab frame."""
    model, time = hand(), np.arange(N_FRAMES) / RATE
    q = np.tile(model.neutral(), (N_FRAMES, 1))
    turn = Rotation.from_euler("xyz", np.array([1.5, 0.2, 0.4]) + np.outer(time, [0.3, 0.2, -0.1]))
    q[:, :3] = np.array([-0.14, -0.07, 0.06]) + np.outer(time, [0.02, 0.0, 0.1])
    q[:, 3:7] = turn.as_quat(scalar_first=True)
    q[:, 7:] = 0.25 + 0.15 * np.sin(np.arange(23) + 2 * time[:, None])
    pose = model.forward(q)
    poses = np.tile(np.eye(4), (N_FRAMES, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", (0.5 * time + 0.1)[:, None]).as_matrix()
    poses[:, :3, 3] = np.array([0.02, 0.01, 0.0]) + np.outer(time, [0.0, 0.01, 0.1])
    return {"time": 2.0 + time, "q": q, "sites": pose.sites, "markers": pose.markers, "object": poses}


def cloud(folder: Path) -> ObjectCloud:
    """Return the mug's cloud, wider spaced than usual."""
    surface = load_surface(write(folder / "mug.stl", mug().mesh), 1.0)
    return sample_cloud(surface, CloudParameters(spacing=0.004))


def build(folder: Path) -> Path:
    """Write the database."""
    points = cloud(folder.parent)
    moved = motion()
    store = Store.create_or_open(folder)
    for session, up, model in (("lab", [0.0, 0.0, 1.0], hand().mjcf), ("set", None, None)):
        store.commit_session(_shared(session, up, model, points))
    store.commit_trials(
        [
            _trial("lab", "a mug?.1", moved, points, tracked=True),
            _trial("set", "clip", moved, points, licence="CC BY-NC 4.0", data_set="Hands"),
            _trial("set", "photo", {n: v[SNAPSHOT : SNAPSHOT + 1] for n, v in moved.items()}, points),
        ]
    )
    return folder


def _shared(session: str, up: list[float] | None, mjcf: str | None, points: ObjectCloud) -> TrialTables:
    columns = {"position": points.points, "normal": points.normals, "area": points.areas}
    of_points = [
        {"session": session, "object": "mug", "point": i}
        | {name: values[i].tolist() for name, values in columns.items()}
        for i in range(len(points.points))
    ]
    described = {
        "session": session, "object": "mug", "mass": 0.3, "friction": 0.5, "n_points": len(points.points),
        "cloud_spacing": 0.004, "center_of_mass": points.points.mean(axis=0).tolist(),
    }  # fmt: skip
    hands = {
        "session": session,
        "subject": "anna",
        "side": "right",
        "radii": hand().radii.tolist(),
        "mjcf": mjcf,
    }
    return TrialTables(
        {
            "sessions": rows("sessions", {"session": session, "up": up}),
            "subjects": rows("subjects", {"session": session, "subject": "anna", "hand": "right"}),
            "objects": rows("objects", described),
            "hands": rows("hands", hands),
            "object_points": rows("object_points", *of_points),
        }
    )


def _trial(
    session: str,
    name: str,
    moved: dict[str, np.ndarray],
    points: ObjectCloud,
    tracked: bool = False,
    **trial: Any,
) -> TrialTables:
    n = len(moved["time"])
    key = f"{session}/{name}"
    common = {"session": session, "trial": key, "subject": "anna", "object": "mug", "task": "lift"}
    described = {**common, "rate": RATE if n > 1 else None, "n_frames": n, "input_key": key, "status": "ok"}
    tables = _grasp(f"{key}/right/0", common, moved, min(SNAPSHOT, n - 1), points, tracked)
    tables["frames"] = rows("frames", *[_frame(key, i, moved, tracked) for i in range(n)])
    if tracked:
        seen = [[None if i == 7 else place.tolist() for place in moved["markers"][i]] for i in range(n)]
        recorded = [
            {
                "trial": key,
                "frame": i,
                "time": moved["time"][i],
                "labels": list(MARKERS),
                "positions": seen[i],
            }
            for i in range(n)
        ]
        tables["markers"] = rows("markers", *recorded)
    return TrialTables({"trials": rows("trials", {**described, "n_grasps": 1, **trial}), **tables})


def _frame(trial: str, i: int, moved: dict[str, np.ndarray], tracked: bool) -> dict[str, Any]:
    lost = tracked and i in range(N_FRAMES)[LOST]
    unknown = tracked and i in range(N_FRAMES)[UNTRACKED]
    quaternion = Rotation.from_matrix(moved["object"][i, :3, :3]).as_quat(scalar_first=True)
    return {
        "trial": trial,
        "side": "right",
        "frame": i,
        "time": moved["time"][i] if len(moved["time"]) > 1 else None,
        "q": moved["q"][i].tolist() if tracked and not unknown else None,
        "sites": None if unknown else moved["sites"][i].tolist(),
        "object_position": None if lost else moved["object"][i, :3, 3].tolist(),
        "object_quaternion": None if lost else quaternion.tolist(),
    }


def _grasp(
    key: str,
    common: dict[str, Any],
    moved: dict[str, np.ndarray],
    at: int,
    points: ObjectCloud,
    tracked: bool,
) -> dict[str, Any]:
    object_from_world = np.linalg.inv(moved["object"][at])
    place, rotation = hand().palm(moved["q"][at])
    world_from_hand = np.eye(4)
    world_from_hand[:3, :3], world_from_hand[:3, 3] = rotation, place
    sites = moved["sites"][at] @ object_from_world[:3, :3].T + object_from_world[:3, 3]
    tree = cKDTree(points.points)
    distances, nearest = tree.query(sites)
    hull = ConvexHull(sites)
    corners = np.sort(hull.vertices)
    own = {"grasp": key, **{name: common[name] for name in ("trial", "session", "object")}}
    contact_sites = [SITES[i] for i in TOUCHING]
    described = {
        **common, "grasp": key, "side": "right", "snapshot_frame": at,
        "snapshot_kind": "lift_onset" if tracked else "static",
        "snapshot_time": moved["time"][at] if tracked else None,
        "onset_time": moved["time"][15] if tracked else None,
        "lift_time": moved["time"][at] if tracked else None,
        "digits": ["thumb", "index", "middle"], "contact_sites": contact_sites, "n_contacts": len(TOUCHING),
        "q": moved["q"][at].tolist() if tracked else None, "sites_object": sites.tolist(),
        "object_from_hand": (object_from_world @ world_from_hand).tolist(),
        "gap": (distances - hand().radii).tolist(), "hull_volume": float(hull.volume),
        "quality": [("epsilon", 0.1)], "grasp_type": "tripod",
        "virtual_fingers": [["thumb"], ["index", "middle"], []],
    }  # fmt: skip
    contacts = [
        {"grasp": key, "trial": common["trial"], "site": SITES[i],
         "position": points.points[nearest[i]].tolist(), "normal": points.normals[nearest[i]].tolist()}
        for i in TOUCHING
    ]  # fmt: skip
    feature = {
        **own, "points": np.arange(5, 95).tolist(), "hull_vertices": sites[corners].tolist(),
        "hull_faces": np.searchsorted(corners, hull.simplices).tolist(),
    }  # fmt: skip
    near = np.arange(0, 200, 2)
    gaps = np.linspace(-0.002, 0.02, len(near)).astype(np.float32)
    contact_map = {**own, "surface": "spheres", "points": near.tolist(), "gaps": gaps.tolist()}
    return {
        "grasps": rows("grasps", described),
        "contacts": rows("contacts", *contacts),
        "features": rows("features", feature),
        "contact_maps": rows("contact_maps", contact_map),
    }
