"""A can that a hand reaches for, lifts and puts down again, in closed form: what pages and pictures show.

The hand is posed once and goes with the can from first contact on; before that it comes from the side. The
second trial is one instant of the same grasp, of a trial and an object whose names are HTML.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from handmade import rows
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from graspdb.store import Store
from graspdb_ingest.contact_map import contact_map
from graspdb_ingest.descriptor import describe, descriptor_kind
from graspdb_ingest.enclosure import enclosing_space
from graspdb_ingest.hand.dimensions import HandDimensions
from graspdb_ingest.hand.mjcf import build_hand
from graspdb_ingest.hand.model import HandModel
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.surface import HandPoints, hand_surface, key_points
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.vocabulary import SEGMENTS, SITES, Side

RADIUS, HEIGHT, SPACING = 0.03, 0.11, 0.004
THRESHOLD = 0.004
RATE, N_FRAMES = 30.0, 61
CONTACT, LIFT, TOP, RELEASE = 15, 25, 35, 50
"""Frames: first contact, onset of lift and snapshot, top of the lift, release."""

RISE = 0.2
"""How high the can is lifted [m]."""

LIFTED = "made/lift/right/0"
NAMED = "made/<script>alert(1)</script>/right/0"
CAN, NAMED_OBJECT = "can", '<img src=x onerror="alert(2)">\u2028'
WORLD_FROM_HAND = Rotation.from_euler("xyz", [80, 10, 30], degrees=True)


@dataclass(frozen=True, eq=False)
class Held:
    """The posed hand in the can's frame.

    Attributes
    ----------
    model : HandModel
        The hand.
    q : ndarray, shape (30,)
        Its configuration with the can's frame as the lab's.
    points, normals, areas : ndarray
        The can's cloud.
    """

    model: HandModel
    q: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray

    @cached_property
    def histograms(self) -> np.ndarray:
        """The points' FPFH, shape (n, 33)."""
        return point_histograms(
            ObjectCloud(self.points, self.normals, self.areas, SPACING), CloudParameters()
        )

    @property
    def sites(self) -> np.ndarray:
        """The spheres' centres [m], shape (20, 3)."""
        return self.model.forward(self.q).sites

    @property
    def gap(self) -> np.ndarray:
        """Their gaps to the cloud [m], shape (20,): equation 2."""
        return cKDTree(self.points).query(self.sites)[0] - self.model.radii


def held() -> Held:
    """Close a hand so that its fingers lie round the can."""
    model = build_hand(HandDimensions(0.19, 0.085), Side.RIGHT, {})
    q = model.neutral()
    for i, joint in enumerate(model.joints):
        if joint.startswith("thumb"):
            q[7 + i] = 0.5 if joint in ("thumb_cmc_flexion", "thumb_cmc_abduction") else 0.35
        elif joint.endswith("flexion") and not joint.startswith("wrist"):
            q[7 + i] = 0.8
    q[3:7] = WORLD_FROM_HAND.as_quat(scalar_first=True)
    digits = model.forward(q).sites[[SITES.index(s) for s in ("thumb_ip", "index_pip", "middle_dip")]]
    q[:3] = np.array([0.0, 0.0, HEIGHT / 2]) - digits.mean(axis=0)
    can = trimesh.creation.cylinder(radius=RADIUS, height=HEIGHT, sections=64)
    can.apply_translation([0, 0, HEIGHT / 2])
    points, faces = trimesh.sample.sample_surface_even(can, int(can.area / SPACING**2), seed=3)
    areas = np.full(len(points), can.area / len(points))
    return Held(model, q, np.asarray(points), np.asarray(can.face_normals[faces]), areas)


def build(folder: Path) -> Path:
    """Write the database of the lifted can and of the named one."""
    grip = held()
    store = Store.create_or_open(folder)
    store.commit_session(_shared(grip))
    store.commit_trials(
        [_trial(grip, LIFTED, CAN, _frames(grip)), _trial(grip, NAMED, NAMED_OBJECT, _still(grip))]
    )
    return folder


def _shared(grip: Held) -> TrialTables:
    count = len(grip.points)
    points = [
        {
            "session": "made",
            "object": name,
            "point": i,
            "position": grip.points[i].tolist(),
            "normal": grip.normals[i].tolist(),
            "area": float(grip.areas[i]),
            "fpfh": grip.histograms[i].tolist(),
        }
        for name in (CAN, NAMED_OBJECT)
        for i in range(count)
    ]
    described = [
        {"session": "made", "object": name, "mesh_sha256": name, "n_points": count, "cloud_spacing": SPACING}
        for name in (CAN, NAMED_OBJECT)
    ]
    hand = {
        "session": "made",
        "subject": "anna",
        "side": "right",
        "mjcf": grip.model.mjcf,
        "radii": grip.model.radii.tolist(),
    }
    return TrialTables(
        {
            "sessions": rows("sessions", {"session": "made", "up": [0, 0, 1], "manifest": "{}"}),
            "subjects": rows("subjects", {"session": "made", "subject": "anna", "hand": "right"}),
            "hands": rows("hands", hand),
            "objects": rows("objects", *described),
            "object_points": rows("object_points", *points),
        }
    )


def can_pose(frame: int) -> tuple[Rotation, np.ndarray]:
    """Return rotation and position of world_from_object: the can rises, and turns as it does."""
    share = float(np.clip((frame - LIFT) / (TOP - LIFT), 0, 1))
    share -= float(np.clip((frame - 40) / (RELEASE - 40), 0, 1))
    turn = Rotation.from_euler("z", 20 + 30 * share, degrees=True)
    return turn, np.array([0.3, 0.1, 0.02 + RISE * share])


def hand_away(frame: int) -> np.ndarray:
    """Return how far the hand is from its place at the can, lab frame [m]."""
    far = max((CONTACT - frame) / CONTACT, (frame - RELEASE) / (N_FRAMES - RELEASE), 0.0)
    return np.array([-0.15, 0.05, 0.1]) * far


def _frames(grip: Held) -> list[dict[str, Any]]:
    frames = []
    touching = (grip.gap < THRESHOLD).tolist()
    for frame in range(N_FRAMES):
        turn, place = can_pose(frame)
        away = hand_away(frame)
        holds = CONTACT <= frame <= RELEASE
        q = grip.q.copy()
        q[:3] = turn.apply(grip.q[:3]) + place + away
        q[3:7] = (turn * WORLD_FROM_HAND).as_quat(scalar_first=True)
        frames.append(
            {
                "frame": frame,
                "time": frame / RATE,
                "q": q.tolist(),
                "sites": (turn.apply(grip.sites) + place + away).tolist(),
                "object_position": place.tolist(),
                "object_quaternion": turn.as_quat(scalar_first=True).tolist(),
                "gap": (grip.gap + np.linalg.norm(away)).tolist(),
                "touching": touching if holds else [False] * len(SITES),
            }
        )
    return frames


def _still(grip: Held) -> list[dict[str, Any]]:
    return [{**_frames(grip)[LIFT], "frame": 0, "time": 0.0}]


def _trial(grip: Held, key: str, name: str, frames: list[dict[str, Any]]) -> TrialTables:
    trial = key.removesuffix("/right/0")
    common = {"session": "made", "trial": trial, "subject": "anna", "object": name, "task": "lift <b>up</b>"}
    moves = len(frames) > 1
    touching = np.flatnonzero(grip.gap < THRESHOLD)
    nearest = cKDTree(grip.points).query(grip.sites)[1]
    space = enclosing_space(grip.sites[touching], grip.model.radii[touching], 64)
    feature = np.flatnonzero(space.contains(grip.points))
    pose = grip.model.forward(grip.q)
    palm = np.eye(4)
    index = grip.model.segments.index(SEGMENTS[1])
    palm[:3, :3], palm[:3, 3] = pose.rotations[index], pose.positions[index]
    near = contact_map(
        grip.points,
        grip.normals,
        hand_surface(
            HandPoints(key_points(palm[:3, 3], grip.sites), grip.model.radii, Side.RIGHT), "spheres"
        ),
        0.02,
    )
    grasp = {
        **common,
        "grasp": key,
        "side": "right",
        "repetition": 1,
        "snapshot_kind": "lift_onset" if moves else "static",
        "snapshot_frame": LIFT if moves else 0,
        "snapshot_time": LIFT / RATE if moves else 0.0,
        "onset_time": CONTACT / RATE if moves else None,
        "lift_time": LIFT / RATE if moves else None,
        "release_time": RELEASE / RATE if moves else None,
        "digits": list(dict.fromkeys(SITES[i].partition("_")[0] for i in touching)),
        "contact_sites": [SITES[i] for i in touching],
        "n_contacts": len(touching),
        "contact_threshold": THRESHOLD,
        "q": frames[LIFT if moves else 0]["q"],
        "sites_object": grip.sites.tolist(),
        "object_from_hand": palm.tolist(),
        "gap": grip.gap.tolist(),
        "hull_volume": space.volume,
        "feature_points": len(feature),
        "quality": [("epsilon", 0.1)],
    }
    contacts = [
        {
            "grasp": key,
            "trial": trial,
            "site": SITES[i],
            "digit": SITES[i].partition("_")[0],
            "point": int(nearest[i]),
            "position": grip.points[nearest[i]].tolist(),
            "normal": grip.normals[nearest[i]].tolist(),
            "gap": float(grip.gap[i]),
        }
        for i in touching
    ]
    placed = {"grasp": key, "trial": trial, "session": "made", "object": name}
    described = {
        **placed,
        "points": feature.tolist(),
        "hull_vertices": space.vertices.tolist(),
        "hull_faces": space.faces.tolist(),
        "descriptor": describe(
            grip.points[feature], grip.normals[feature], grip.histograms[feature], grip.areas[feature]
        ).tolist(),
        "descriptor_kind": descriptor_kind(CloudParameters()),
    }
    mapped = {
        **placed,
        "surface": "spheres",
        "points": near.points.tolist(),
        "gaps": near.gaps.tolist(),
        "facing": near.facing.tolist(),
    }
    own = {"trial": trial, "side": "right"}
    return TrialTables(
        {
            "trials": rows(
                "trials",
                {
                    **common,
                    "repetition": 1,
                    "input_key": key,
                    "status": "ok",
                    "n_grasps": 1,
                    "rate": RATE,
                    "n_frames": len(frames),
                },
            ),
            "frames": rows("frames", *({**own, **frame} for frame in frames)),
            "grasps": rows("grasps", grasp),
            "contacts": rows("contacts", *contacts),
            "features": rows("features", described),
            "contact_maps": rows("contact_maps", mapped),
        }
    )
