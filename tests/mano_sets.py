"""Small data sets in the layouts of DexYCB, HO-3D, GRAB, ARCTIC, OakInk-Image and HOT3D, and what is in them.

Each writer makes up a hand that reaches for an object and lifts it, writes it the way the data set's own
documentation says, and returns what an importer has to find again.
"""

import json
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from mano_file import USUAL_OF_MANO, mano_content, python2_pickle, slow_key_points, write_mano
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, build_hand
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import DIGITS, JOINT_ANGLES, KEY_POINTS, SEGMENT_OF_SITE, SITES, Side

N_FRAMES = 8
OPENGL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Truth:
    """What is in a data set of one clip.

    Key points by hand (n, 21, 3) and object poses (n, 4, 4), both NaN where they are not known [m].
    """

    trial: str
    subject: str
    object: str
    identifier: str
    rate: float
    key_points: Mapping[Side, np.ndarray]
    poses: np.ndarray
    up: tuple[float, float, float] | None = None
    task: str | None = None
    mano: Path | None = None
    contact: np.ndarray | None = None
    more: Mapping[str, Any] = field(default_factory=dict)


def grasping_hand(side: Side, bend: float = 0.6) -> np.ndarray:
    """Return the key points of a hand with bent fingers, wrist at the origin, shape (21, 3)."""
    size = HandDimensions(hand_length=0.19, hand_breadth=0.084)
    hand = build_hand(size, side, {site: MarkerPlacement(SEGMENT_OF_SITE[site], at=site) for site in SITES})
    q = hand.neutral()
    q[7:] = [bend if "flexion" in name and "wrist" not in name else 0.0 for name in JOINT_ANGLES]
    pose = hand.forward(q)
    wrist = pose.positions[hand.segments.index("hand")]
    return np.asarray(np.vstack([wrist, pose.sites]) - wrist)


def motion(n: int, seed: int = 5) -> np.ndarray:
    """Return a path of rigid poses, shape (n, 4, 4)."""
    rng = np.random.default_rng(seed)
    start, turn = rng.normal(size=3), 0.1 * rng.normal(size=3)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(start + turn * np.arange(n)[:, None]).as_matrix()
    poses[:, :3, 3] = [0.3, 0.2, 0.1] + 0.01 * np.arange(n)[:, None] * rng.normal(size=3)
    return poses


def carried(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (m, 3) carried along by poses (n, 4, 4), shape (n, m, 3)."""
    return np.asarray(points @ np.swapaxes(poses[:, :3, :3], 1, 2) + poses[:, None, :3, 3])


def object_beside(hands: np.ndarray) -> np.ndarray:
    """Return the poses of an object between thumb and fingers by the poses of the hand."""
    held = np.eye(4)
    held[:3, 3] = grasping_hand(Side.RIGHT)[[4, 8, 12]].mean(axis=0)
    held[:3, :3] = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    return np.asarray(hands @ held)


def write_box(
    path: Path, scale: float = 1.0, middle: tuple[float, float, float] = (0, 0, 0)
) -> trimesh.Trimesh:
    """Write a mesh of a box of 5 x 6 x 9 cm."""
    path.parent.mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box((0.05, 0.06, 0.09)).subdivide()
    box.apply_translation(middle)
    box.apply_scale(scale)
    box.export(path)
    return box


def write_dexycb(root: Path, n: int = N_FRAMES, side: Side = Side.LEFT) -> Truth:
    """Write a sequence that two cameras saw; in some frames one or both do not see the hand."""
    sequence = root / "20200709-subject-01" / "20200709_141754"
    serials = ["836212060125", "839512060362"]
    hands = motion(n)
    points, poses = carried(hands, grasping_hand(side)), object_beside(hands)
    master_from_tag, *tag_from_cameras = motion(3, seed=9)
    extrinsics = {"apriltag": master_from_tag[:3].ravel().tolist()}
    for serial, camera in zip(serials, tag_from_cameras, strict=True):
        extrinsics[serial] = (master_from_tag @ camera)[:3].ravel().tolist()
    unseen = {serials[0]: (2, 3, 5), serials[1]: (5,)}
    for serial, camera in zip(serials, tag_from_cameras, strict=True):
        (sequence / serial).mkdir(parents=True)
        camera_from_tag = np.linalg.inv(camera)
        for frame in range(n):
            hidden = frame in unseen[serial]
            joints = carried(camera_from_tag[None], points[frame])
            pose = (camera_from_tag @ poses[frame])[None, :3]
            np.savez_compressed(
                sequence / serial / f"labels_{frame:06d}.npz",
                seg=np.zeros((48, 64), np.uint8),
                pose_y=np.concatenate([np.zeros((1, 3, 4)), pose * (frame != 6)]).astype(np.float32),
                pose_m=np.zeros((1, 51), np.float32),
                joint_3d=np.where(hidden, -1.0, joints).astype(np.float32),
                joint_2d=np.full((1, 21, 2), -1, np.float32),
            )
    meta = {
        "serials": serials,
        "num_frames": n,
        "extrinsics": "20200702_151821",
        "ycb_ids": [1, 14],
        "ycb_grasp_ind": 1,
        "mano_sides": [str(side)],
        "mano_calib": ["20200709-subject-01_left"],
    }
    (sequence / "meta.yml").write_text(yaml.safe_dump(meta))
    calibration = root / "calibration" / "extrinsics_20200702_151821"
    calibration.mkdir(parents=True)
    content = {"master": serials[0], "extrinsics": extrinsics}
    (calibration / "extrinsics.yml").write_text(yaml.safe_dump(content))
    write_box(root / "models" / "025_mug" / "textured_simple.obj")
    points[5], poses[6] = np.nan, np.nan
    return Truth(
        trial="20200709-subject-01_20200709_141754",
        subject="subject-01",
        object="025_mug",
        identifier="20200709-subject-01/20200709_141754",
        rate=30.0,
        key_points={side: points},
        poses=poses,
        up=(0.0, 0.0, 1.0),
        task="pick up",
    )


def write_ho3d(root: Path, n: int = N_FRAMES) -> Truth:
    """Write a sequence with a gap in its numbers and a frame without annotation."""
    folder = root / "train" / "ABF10" / "meta"
    folder.mkdir(parents=True)
    hands = motion(n)
    points, poses = carried(hands, grasping_hand(Side.RIGHT)), object_beside(hands)
    shape = np.linspace(-1, 1, 10).astype(np.float32)
    for frame in range(n):
        rotation = OPENGL @ poses[frame, :3, :3]
        content = {
            "camMat": np.eye(3, dtype=np.float32),
            "handBeta": shape,
            "handJoints3D": (points[frame][list(USUAL_OF_MANO)] @ OPENGL).astype(np.float32),
            "handPose": np.zeros(48, np.float32),
            "handTrans": np.zeros(3, np.float32),
            "objCorners3DRest": np.zeros((8, 3)),
            "objName": "021_bleach_cleanser",
            "objLabel": 12,
            "objRot": Rotation.from_matrix(rotation).as_rotvec()[:, None],
            "objTrans": OPENGL @ poses[frame, :3, 3],
        }
        if frame == 3:
            content = dict.fromkeys(content) | {"camMat": content["camMat"]}
        if frame != 5:
            (folder / f"{frame + 40:04d}.pkl").write_bytes(python2_pickle(content))
    write_box(root / "models" / "021_bleach_cleanser" / "textured_simple.obj")
    points[[3, 5]], poses[[3, 5]] = np.nan, np.nan
    return Truth(
        trial="ABF10",
        subject="shape_",
        object="021_bleach_cleanser",
        identifier="ABF10",
        rate=20.0,
        key_points={Side.RIGHT: points},
        poses=poses,
    )


@dataclass(frozen=True)
class ManoMotion:
    """A hand's parameters over time and the key points that they give the long way."""

    pose: np.ndarray
    orientation: np.ndarray
    place: np.ndarray
    shape: np.ndarray
    key_points: np.ndarray


def mano_motion(
    n: int, side: Side, components: int | None, mean: bool, shape: np.ndarray, content: Mapping[str, Any]
) -> ManoMotion:
    """Return a hand that moves: pose as so many components or as rotation vectors, about the mean or not."""
    rng = np.random.default_rng(len(side))
    pose = 0.05 * rng.normal(size=(n, components or 45))
    vectors = pose if components is None else pose @ content["hands_components"][:components]
    vectors = vectors + (content["hands_mean"] if mean else 0.0)
    poses = motion(n, seed=2)
    orientation, place = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec(), poses[:, :3, 3]
    moved = zip(vectors, orientation, place, strict=True)
    points = np.array([slow_key_points(content, *frame, shape) for frame in moved])
    return ManoMotion(pose, orientation, place, shape, points)


def soft_content(side: Side) -> dict[str, Any]:
    """Return a MANO model of a hand with bent fingers, and with a mean pose that bends them little more."""
    content = mano_content(side, grasping_hand(side))
    content["hands_mean"] = 0.1 * content["hands_mean"]
    return content


def write_grab(root: Path, n: int = N_FRAMES) -> Truth:
    """Write a sequence of both hands with contact on the object's vertices."""
    tools, params = root / "tools", {}
    points = {}
    for side, name in ((Side.RIGHT, "rhand"), (Side.LEFT, "lhand")):
        content = soft_content(side)
        write_mano(root.parent / "mano", side, content)
        template = tools / "subject_meshes" / "male" / f"s1_{name}.ply"
        template.parent.mkdir(parents=True, exist_ok=True)
        own = (1.05 * content["v_template"]).astype(np.float32)
        trimesh.Trimesh(own, content["f"][:50], process=False).export(template)
        moved = mano_motion(n, side, 24, False, np.zeros(10), content | {"v_template": own})
        points[side] = moved.key_points
        params[name] = {
            "params": {
                "global_orient": moved.orientation,
                "hand_pose": moved.pose,
                "transl": moved.place,
                "fullpose": np.zeros((n, 45)),
            },
            "vtemp": str(template.relative_to(root)),
        }
    mesh = tools / "object_meshes" / "contact_meshes" / "mug.ply"
    box = write_box(mesh)
    poses = object_beside(motion(n, seed=2))
    # GRAB multiplies rows of vertices by the rotation, so it stores the inverse rotation's vector.
    vectors = Rotation.from_matrix(poses[:, :3, :3]).inv().as_rotvec()
    parts = np.zeros((n, len(box.vertices)), dtype=np.int8)
    parts[4:, :5], parts[4:, 5], parts[2, 7] = 43, 21, 16
    folder = root / "grab" / "s1"
    folder.mkdir(parents=True)
    np.savez(
        folder / "mug_drink_1.npz",
        gender="male",
        sbj_id="s1",
        obj_name="mug",
        motion_intent="drink",
        framerate=120.0,
        n_frames=n,
        n_comps=24,
        object=_object(
            {
                "params": {"transl": poses[:, :3, 3], "global_orient": vectors},
                "object_mesh": str(mesh.relative_to(root)),
            }
        ),
        contact=_object({"body": np.zeros((n, 10), np.int8), "object": parts}),
        rhand=_object(params["rhand"]),
        lhand=_object(params["lhand"]),
    )
    touched = (parts == 43) | (parts == 21)
    return Truth(
        trial="s1_mug_drink_1",
        subject="s1",
        object="mug",
        identifier="s1/mug_drink_1",
        rate=120.0,
        key_points=points,
        poses=poses,
        up=(0.0, 0.0, 1.0),
        task="drink",
        mano=root.parent / "mano",
        contact=touched,
    )


def write_arctic(root: Path, n: int = N_FRAMES) -> Truth:
    """Write a sequence of both hands with a box whose lid opens; the truth is that of the lid."""
    rng = np.random.default_rng(4)
    hands, points = {}, {}
    for side in Side:
        content = soft_content(side)
        write_mano(root.parent / "mano", side, content)
        moved = mano_motion(n, side, None, True, rng.normal(size=10), content)
        points[side] = moved.key_points
        hands[str(side)] = {
            "rot": moved.orientation,
            "pose": moved.pose,
            "trans": moved.place,
            "shape": moved.shape,
            "fitting_err": np.zeros(n),
        }
    folder = root / "raw_seqs" / "s01"
    folder.mkdir(parents=True)
    poses = object_beside(motion(n, seed=2))
    angles = np.linspace(0, 0.5, n)
    states = np.column_stack(
        [angles, Rotation.from_matrix(poses[:, :3, :3]).as_rotvec(), 1000 * poses[:, :3, 3]]
    )
    np.save(folder / "box_grab_01.mano.npy", _object(hands), allow_pickle=True)
    np.save(folder / "box_grab_01.object.npy", states)
    for part in ("top", "bottom"):
        write_box(root / "meta" / "object_vtemplates" / "box" / f"{part}.obj", scale=1000.0)
    opened = np.tile(np.eye(4), (n, 1, 1))
    opened[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * [0, 0, -1]).as_matrix()
    return Truth(
        trial="s01_box_grab_01_top",
        subject="s01",
        object="box_top",
        identifier="s01/box_grab_01",
        rate=30.0,
        key_points=points,
        poses=poses @ opened,
        up=(0.0, 0.0, 1.0),
        task="grab",
        mano=root.parent / "mano",
        more={"s01_box_grab_01_bottom": poses},
    )


def write_oakink(root: Path, n: int = N_FRAMES) -> Truth:
    """Write a handover seen by two cameras; the truth is that of the receiver."""
    anno = root / "image" / "anno"
    for name in ("hand_j", "obj_transf", "general_info"):
        (anno / name).mkdir(parents=True)
    middle = (0.02, -0.01, 0.03)
    write_box(root / "image" / "obj" / "A01001.obj", middle=middle)
    hands = motion(n)
    points, poses = carried(hands, grasping_hand(Side.RIGHT)), object_beside(hands)
    centred = np.eye(4)
    centred[:3, 3] = middle
    frames = {1: range(10, 10 + n), 0: range(10, 13)}
    for camera, seen in frames.items():
        for flag in (0, 1):
            for place, frame in enumerate(seen):
                if frame == 14:
                    continue
                name = f"A01001_0004_0003_0007__2021-09-26-19-59-58__{flag}__{frame}__{camera}.pkl"
                (anno / "hand_j" / name).write_bytes(pickle.dumps(points[place].astype(np.float32)))
                transform = (poses[place] @ centred).astype(np.float32)
                (anno / "obj_transf" / name).write_bytes(pickle.dumps(transform))
                (anno / "general_info" / name).write_bytes(b"\x80\x04never read.")
    (anno / "seq_all.json").write_text("[]")
    points[4], poses[4] = np.nan, np.nan
    return Truth(
        trial="A01001_0004_0003_0007_2021-09-26-19-59-58_1",
        subject="0007",
        object="A01001",
        identifier="A01001_0004_0003_0007/2021-09-26-19-59-58",
        rate=30.0,
        key_points={Side.RIGHT: points},
        poses=poses,
        task="handover",
    )


def hot3d_profile() -> dict[str, Any]:
    """Return a hand profile of UmeTrack's layout: a left hand at rest, fingers along x, thumb towards z."""
    hand = 1000 * grasping_hand(Side.LEFT, bend=0.1)
    axes, to_profile = [], np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    rest = hand @ to_profile.T
    chains = rest[1:].reshape(5, 4, 3)
    places = []
    for digit, chain in zip(DIGITS, chains, strict=True):
        first = [chain[0], chain[0] + [20, 2, 8]] if digit == "thumb" else [chain[0], chain[0]]
        places += [*first, chain[1], chain[2]]
        flexion = np.array([0.1, 0.2, -1.0]) if digit != "thumb" else np.array([0.4, 0.9, 0.1])
        axes += [[0.0, -1.0, 0.05], flexion, flexion, flexion]
    bones = [[4, 4, 4], [7, 7, 7], [10, 10, 10], [13, 13, 13], [16, 16, 16], [1, 1, 1], [2, 2, 2], [3, 3, 3]]
    landmarks = [*chains[:, 3], rest[0], chains[0, 1], chains[0, 2]]
    for i in range(1, 5):
        bones += [[1, 1, 1], [2 + 3 * i, 0, 0], [3 + 3 * i, 0, 0]]
        landmarks += list(chains[i, :3])
    bones.append([1, 8, 5])
    landmarks.append(chains[:, 0].mean(axis=0))
    unit = np.array([a / np.linalg.norm(a) for a in np.array(axes, dtype=float)])
    return {
        "hand_model": {
            "joint_rotation_axes": [*unit.tolist(), [0, 1, 0], [0, 0, 1]],
            "joint_rest_positions": [*np.array(places).tolist(), [0, 0, 0], [0, 0, 0]],
            "landmark_rest_positions": np.array(landmarks).tolist(),
            "landmark_rest_bone_indices": bones,
            "landmark_rest_bone_weights": [[1.0, 0.0, 0.0]] * 20 + [[0.8, 0.1, 0.1]],
        }
    }


def slow_umetrack(
    profile: Mapping[str, Any], angles: np.ndarray, wrist: np.ndarray, side: Side
) -> np.ndarray:
    """Return the key points of one frame by turning each point about its hinges, from the outermost in."""
    model = profile["hand_model"]
    places, axes = np.array(model["joint_rest_positions"]), np.array(model["joint_rotation_axes"])
    by_name = {"thumb_cmc": (places[0], 1)}
    names = [*(f"{digit}_tip" for digit in DIGITS), "wrist", "thumb_mcp", "thumb_ip"]
    names += [f"{digit}_{joint}" for digit in DIGITS[1:] for joint in ("mcp", "pip", "dip")]
    bones = np.array(model["landmark_rest_bone_indices"])[:20, 0]
    for name, rest, bone in zip(names, np.array(model["landmark_rest_positions"])[:20], bones, strict=True):
        by_name[name] = (rest, int(bone))
    points = []
    for name in KEY_POINTS:
        point, bone = by_name[name]
        if bone > 1:
            digit, segment = divmod(bone - 2, 3)
            for hinge in range(4 * digit + segment + 1, 4 * digit - 1, -1):
                turn = Rotation.from_rotvec(axes[hinge] * angles[hinge])
                point = turn.apply(point - places[hinge]) + places[hinge]
        mirrored = point / 1000 * ([-1, 1, 1] if side is Side.RIGHT else [1, 1, 1])
        points.append(wrist[:3, :3] @ mirrored + wrist[:3, 3])
    return np.array(points)


def write_hot3d(root: Path, n: int = N_FRAMES, mano: bool = False) -> Truth:
    """Write a recording of Aria: two objects, doubled time stamps, a lost frame; the truth is the mug's."""
    folder = root / "P0003_c701bd11"
    folder.mkdir(parents=True)
    rng = np.random.default_rng(8)
    profile = hot3d_profile()
    poses = object_beside(motion(n, seed=2))
    points = {side: np.full((n, 21, 3), np.nan) for side in Side}
    stamps = 56_752_108_188_860 + np.round(np.arange(n) * 1e9 / 30).astype(np.int64)
    contents = {side: soft_content(side) for side in Side}
    for side in Side:
        write_mano(root.parent / "mano", side, contents[side])
    shape = rng.normal(size=10)
    lines: list[dict[str, Any]] = []
    rows = ["object_uid,timestamp[ns],t_wo_x[m],t_wo_y[m],t_wo_z[m],q_wo_w,q_wo_x,q_wo_y,q_wo_z"]
    hands = motion(n, seed=2)
    for frame, stamp in enumerate(stamps):
        if frame == 5:
            continue
        said = {}
        for side, key in ((Side.LEFT, "0"), (Side.RIGHT, "1")):
            if side is Side.LEFT and frame < 2:
                continue
            wrist = hands[frame]
            quaternion = Rotation.from_matrix(wrist[:3, :3]).as_quat(scalar_first=True)
            xform = {"t_xyz": wrist[:3, 3].tolist(), "q_wxyz": quaternion.tolist()}
            if mano:
                pose = 0.05 * rng.normal(size=15)
                content = dict(contents[side])
                if side is Side.LEFT:
                    content["shapedirs"] = content["shapedirs"] * [[-1.0], [1.0], [1.0]]
                full = pose @ content["hands_components"][:15] + content["hands_mean"]
                turn = Rotation.from_matrix(wrist[:3, :3]).as_rotvec()
                points[side][frame] = slow_key_points(content, full, turn, wrist[:3, 3], shape)
                said[key] = {"wrist_xform": xform, "pose": pose.tolist(), "betas": shape.tolist()}
            else:
                angles = np.concatenate([rng.uniform(0, 0.8, 20), [0, 0]])
                points[side][frame] = slow_umetrack(profile, angles, wrist, side)
                said[key] = {"wrist_xform": xform, "joint_angles": angles.tolist(), "hand_confidence": 1.0}
        for late in (0, 90_813):
            lines.append({"timestamp_ns": int(stamp + late), "hand_poses": said})
            for uid, shift in ((265826671143948, 0.0), (37787722328019, 0.4)):
                numbers = [
                    *(poses[frame, :3, 3] + shift),
                    *Rotation.from_matrix(poses[frame, :3, :3]).as_quat(scalar_first=True),
                ]
                rows.append(",".join([str(uid), str(stamp + late), *map(repr, map(float, numbers))]))
    name = "mano" if mano else "umetrack"
    (folder / f"{name}_hand_pose_trajectory.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
    (folder / "umetrack_hand_user_profile.json").write_text(json.dumps(profile))
    (folder / "dynamic_objects.csv").write_text("\n".join(rows) + "\n")
    metadata = {"headset": "Aria", "participant_id": "P0003", "recording_name": "P0003_c701bd11"}
    (folder / "metadata.json").write_text(json.dumps(metadata))
    for uid in (265826671143948, 37787722328019):
        write_box(root / "assets" / f"{uid}.glb")
    names = {"265826671143948": {"instance_name": "mug"}, "37787722328019": {"instance_name": "keyboard"}}
    (root / "assets" / "instance.json").write_text(json.dumps(names))
    poses[5] = np.nan
    return Truth(
        trial="P0003_c701bd11_mug",
        subject="P0003",
        object="mug",
        identifier="P0003_c701bd11/265826671143948",
        rate=30.0,
        key_points=points,
        poses=poses,
        up=(0.0, 0.0, 1.0),
        mano=root.parent / "mano" if mano else None,
    )


def write_hot3d_mano(root: Path, n: int = N_FRAMES) -> Truth:
    """Write the same with MANO's parameters."""
    return replace(write_hot3d(root, n, mano=True), trial="P0003_c701bd11_mug")


WRITERS: Mapping[str, Callable[..., Truth]] = {
    "dexycb": write_dexycb,
    "ho3d": write_ho3d,
    "grab": write_grab,
    "arctic": write_arctic,
    "oakink": write_oakink,
    "hot3d": write_hot3d,
}
"""A writer for each format."""


def _object(content: object) -> np.ndarray:
    array = np.empty((), dtype=object)
    array[()] = content
    return array
