"""A database of parts of made-up surfaces, held by made-up hands."""

from pathlib import Path

import numpy as np
from handmade import rows
from scipy.spatial.transform import Rotation

from graspdb.store import Store
from graspdb_ingest.descriptor import describe, descriptor_kind
from graspdb_ingest.feature import principal_extents
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.vocabulary import SITES

KIND = descriptor_kind(CloudParameters())
N_GRASPS = 36
EMPTY = "made/empty/right/0"


def surface(bend: float, seed: int) -> ObjectCloud:
    """Return a sheet of 100 mm by 80 mm that bends more and more along one side."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 0.1, 1800), rng.uniform(0, 0.08, 1800)
    points = np.stack([x, y, bend * x**2 + 2 * x * y], axis=1).astype(np.float32).astype(float)
    normals = np.stack([-2 * bend * x - 2 * y, -2 * x, np.ones(1800)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ObjectCloud(points, normals, np.full(1800, 0.1 * 0.08 / 1800), 0.002)


def sheets() -> dict[str, ObjectCloud]:
    return {"flat": surface(0.5, 1), "round": surface(8.0, 2)}


def build(folder: Path) -> Path:
    """Write the database: grasps of two objects by two subjects, left hands among them, one empty."""
    rng = np.random.default_rng(0)
    clouds = sheets()
    histograms = {name: point_histograms(cloud, CloudParameters()) for name, cloud in clouds.items()}
    store = Store.create_or_open(folder)
    store.commit_session(_shared(clouds, histograms))
    trials = []
    hand = rng.uniform((0.05, -0.05, -0.05), (0.15, 0.05, 0.05), (len(SITES), 3))
    for i in range(N_GRASPS):
        name = ("flat", "round")[i % 2]
        cloud = clouds[name]
        centre = cloud.points[rng.integers(len(cloud.points))]
        points = np.flatnonzero(np.linalg.norm(cloud.points - centre, axis=1) < rng.uniform(0.015, 0.03))
        size = rng.uniform(0.8, 1.2)
        shape = hand * size + rng.normal(size=hand.shape) * 0.002 * (i % 5)
        trials.append(_trial(i, name, cloud, histograms[name], points, shape, rng))
    trials.append(_empty())
    store.commit_trials(trials)
    return folder


def _shared(clouds, histograms):
    objects = [
        {"session": "made", "object": name, "mesh_sha256": name, "n_points": len(cloud.points), "area": 0.008}
        for name, cloud in clouds.items()
    ]
    points = [
        {
            "session": "made",
            "object": name,
            "point": i,
            "position": cloud.points[i].tolist(),
            "normal": cloud.normals[i].tolist(),
            "area": float(cloud.areas[i]),
            "fpfh": histograms[name][i].tolist(),
        }
        for name, cloud in clouds.items()
        for i in range(len(cloud.points))
    ]
    subjects = [{"session": "made", "subject": s, "hand": "both"} for s in ("anna", "ben")]
    return TrialTables(
        {
            "sessions": rows("sessions", {"session": "made"}),
            "subjects": rows("subjects", *subjects),
            "objects": rows("objects", *objects),
            "object_points": rows("object_points", *points),
        }
    )


def _trial(i, name, cloud, histograms, points, shape, rng):
    subject, side = ("anna", "ben")[i // 2 % 2], ("right", "left")[i % 3 == 0]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 0.05
    mirrored = shape * [1, -1 if side == "left" else 1, 1]
    sites = mirrored @ pose[:3, :3].T + pose[:3, 3]
    touching = [SITES[j] for j in sorted(rng.choice(len(SITES), 2 + i % 4, replace=False))]
    common = {"session": "made", "trial": f"made/{i}", "subject": subject, "object": name, "task": "lift"}
    key = f"made/{i}/{side}/0"
    described = {
        **common,
        "grasp": key,
        "side": side,
        "contact_sites": touching,
        "n_contacts": len(touching),
        "q": np.linspace(0, 1, 30).tolist() if i % 2 else None,
        "sites_object": sites.tolist(),
        "object_from_hand": pose.tolist(),
        "feature_points": len(points),
    }
    contacts = [
        {
            "grasp": key,
            "trial": common["trial"],
            "site": site,
            "position": cloud.points[points[j]].tolist(),
        }
        for j, site in enumerate(touching)
    ]
    described_feature = describe(
        cloud.points[points], cloud.normals[points], histograms[points], cloud.areas[points]
    )
    feature = {
        **{column: common[column] for column in ("trial", "session", "object")},
        "grasp": key,
        "points": points.tolist(),
        "extents": principal_extents(cloud.points[points], cloud.areas[points]).tolist(),
        "area": float(cloud.areas[points].sum()),
        "descriptor": described_feature.tolist(),
        "descriptor_kind": KIND,
    }
    return TrialTables(
        {
            "trials": rows("trials", {**common, "input_key": str(i), "status": "ok", "n_grasps": 1}),
            "grasps": rows("grasps", described),
            "contacts": rows("contacts", *contacts),
            "features": rows("features", feature),
        }
    )


def _empty():
    common = {"session": "made", "trial": "made/empty", "subject": "anna", "object": "flat"}
    grasp = {**common, "grasp": EMPTY, "side": "right", "contact_sites": [], "feature_points": 0}
    feature = {"trial": "made/empty", "session": "made", "object": "flat", "grasp": EMPTY, "points": []}
    return TrialTables(
        {
            "trials": rows("trials", {**common, "input_key": "empty", "status": "ok", "n_grasps": 1}),
            "grasps": rows("grasps", grasp),
            "features": rows("features", feature),
        }
    )
