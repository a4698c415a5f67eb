"""A simulated mug, held by made-up hands whose sites stand on boxes around its parts."""

from itertools import product
from pathlib import Path

import numpy as np
import trimesh
from handmade import rows
from scipy.spatial import ConvexHull

from graspdb.simulate.objects import SimulatedObject, make_mug
from graspdb.store import Store
from graspdb_ingest.descriptor import describe, descriptor_kind
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.objects.mesh import load_surface
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.vocabulary import SITES

EDGES = np.array([c for c in product((-1, 0, 1), repeat=3) if np.abs(c).sum() >= 2], dtype=float)
"""Corners and middles of the edges of a cube: 20, as many as a hand has sites."""


def mug(seed: int = 1) -> SimulatedObject:
    return make_mug(np.random.default_rng(seed))


def handle(body: SimulatedObject) -> np.ndarray:
    """Return the middle of a mug's handle."""
    return np.array([body.measures["handle"], 0.0, body.measures["handle_middle"]])


def write(path: Path, mesh: trimesh.Trimesh, pose: np.ndarray | None = None, scale: float = 1.0) -> Path:
    """Write a mesh, moved first and then brought to the file's unit."""
    moved = mesh.copy()
    if pose is not None:
        moved.apply_transform(pose)
    moved.apply_transform(np.diag([scale, scale, scale, 1.0]))
    moved.export(path)
    return path


def build(folder: Path) -> Path:
    """Write the database: three grasps of the handle, three of the side, two of the rim."""
    body = mug()
    surface = load_surface(write(folder.parent / "mug.stl", body.mesh), 1.0)
    cloud = sample_cloud(surface, CloudParameters())
    histograms = point_histograms(cloud, CloudParameters())
    high = body.measures["height"]
    boxes = {
        f"handle{i}": (handle(body) + np.array([0, 0, 0.006 * (i - 1)]), [0.016, 0.016, 0.022 + 0.003 * i])
        for i in range(3)
    }
    boxes |= {f"side{i}": (np.array([-0.02, 0, 0.04 + 0.01 * i]), [0.03, 0.05, 0.02]) for i in range(3)}
    boxes |= {f"rim{i}": (np.array([-0.038, 0, high - 0.005 * i]), [0.014, 0.02, 0.015]) for i in range(2)}
    store = Store.create_or_open(folder)
    store.commit_session(_shared(cloud, histograms))
    store.commit_trials([_trial(name, *box, cloud, histograms) for name, box in boxes.items()])
    return folder


def _shared(cloud: ObjectCloud, histograms: np.ndarray) -> TrialTables:
    points = [
        {
            "session": "made",
            "object": "mug",
            "point": i,
            "position": cloud.points[i].tolist(),
            "normal": cloud.normals[i].tolist(),
            "area": float(cloud.areas[i]),
            "fpfh": histograms[i].tolist(),
        }
        for i in range(len(cloud.points))
    ]
    described = {"session": "made", "object": "mug", "mesh_sha256": "mug", "n_points": len(cloud.points)}
    return TrialTables(
        {
            "sessions": rows("sessions", {"session": "made"}),
            "subjects": rows("subjects", {"session": "made", "subject": "anna", "hand": "right"}),
            "objects": rows("objects", described),
            "object_points": rows("object_points", *points),
        }
    )


def _trial(
    name: str, centre: np.ndarray, half: list[float], cloud: ObjectCloud, histograms: np.ndarray
) -> TrialTables:
    key = f"made/{name}/right/0"
    sites = centre + EDGES * half
    hull = ConvexHull(sites)
    inside = (cloud.points @ hull.equations[:, :3].T + hull.equations[:, 3] <= 1e-9).all(axis=1)
    points = np.flatnonzero(inside)
    common = {"session": "made", "trial": f"made/{name}", "subject": "anna", "object": "mug"}
    grasp = {
        **common,
        "grasp": key,
        "side": "right",
        "contact_sites": [SITES[0], SITES[4]],
        "sites_object": sites.tolist(),
        "feature_points": len(points),
        "q": np.linspace(0, 1, 30).tolist(),
    }
    feature = {
        "trial": common["trial"],
        "session": "made",
        "object": "mug",
        "grasp": key,
        "points": points.tolist(),
        "hull_vertices": sites[hull.vertices].tolist(),
        "descriptor": describe(
            cloud.points[points], cloud.normals[points], histograms[points], cloud.areas[points]
        ).tolist(),
        "descriptor_kind": descriptor_kind(CloudParameters()),
    }
    contacts = [
        {"grasp": key, "trial": common["trial"], "site": site, "position": cloud.points[row].tolist()}
        for site, row in ((SITES[0], points[0]), (SITES[4], points[-1]))
    ]
    return TrialTables(
        {
            "trials": rows("trials", {**common, "input_key": name, "status": "ok", "n_grasps": 1}),
            "grasps": rows("grasps", grasp),
            "contacts": rows("contacts", *contacts),
            "features": rows("features", feature),
        }
    )
