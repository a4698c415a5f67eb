"""Format ``dexycb``: DexYCB, grasps of 20 YCB objects seen by eight cameras.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  a sequence, ``<date>-<subject>/<sequence>``
subject                the part of the sequence's folder behind the date
hand, side             ``joint_3d`` of ``labels_*.npz``, ``mano_sides`` of ``meta.yml``
object                 ``ycb_ids[ycb_grasp_ind]``, in ``models/<name>/textured_simple.obj``
object pose            ``pose_y`` of ``labels_*.npz``
frame                  that of the calibration tag on the table, z up, by ``calibration/extrinsics_*``
rate                   30 Hz
=====================  ===========================================================================

Labels are in the axes of their camera. A hand of -1 or an object of 0 is not seen there, and then the next
camera is asked.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_npz
from graspdb_ingest.importers.base import (
    Clip,
    ClipHand,
    ClipSource,
    Format,
    Importer,
    ImportOptions,
    ObjectSource,
    clip_name,
)
from graspdb_ingest.importers.fields import (
    AGAIN,
    entry,
    find_ycb_mesh,
    matches,
    metres_in,
    numbers,
    read_yaml,
    whole,
    word,
)
from graspdb_ingest.rigid import Array, transform_points
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

RATE: Final = 30.0
OBJECTS: Final = dict(
    enumerate(
        (
            "002_master_chef_can",
            "003_cracker_box",
            "004_sugar_box",
            "005_tomato_soup_can",
            "006_mustard_bottle",
            "007_tuna_fish_can",
            "008_pudding_box",
            "009_gelatin_box",
            "010_potted_meat_can",
            "011_banana",
            "019_pitcher_base",
            "021_bleach_cleanser",
            "024_bowl",
            "025_mug",
            "035_power_drill",
            "036_wood_block",
            "037_scissors",
            "040_large_marker",
            "051_large_clamp",
            "052_extra_large_clamp",
            "061_foam_brick",
        ),
        start=1,
    )
)
"""Names of the objects by their numbers in ``ycb_ids``."""

FORMAT: Final = Format(
    name="dexycb",
    title="DexYCB",
    version="2021",
    licence="CC BY-NC 4.0",
    needs=(
        "<date>-<subject>/<sequence>/meta.yml and <camera>/labels_*.npz",
        "calibration/extrinsics_*/extrinsics.yml",
        "models/<object>/textured_simple.obj, or --objects",
    ),
    documentation="https://github.com/NVlabs/dex-ycb-toolkit",
)
_LABELS: Final = re.compile(r"labels_(\d{6})\.npz")


def recognises(path: Path) -> bool:
    """Whether a folder looks like DexYCB, one of its subjects or one of its sequences."""
    return matches(path, "meta.yml", "*/meta.yml", "*/*/meta.yml")


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the sequences under the data set's folder, a subject's, or one of their own.

    Raises
    ------
    ImportSourceError
        If there is none, or a mesh or a calibration is missing.
    """
    metas = [
        meta for pattern in ("meta.yml", "*/meta.yml", "*/*/meta.yml") for meta in sorted(path.glob(pattern))
    ]
    if not metas:
        found = "no sequence of DexYCB is in it"
        raise ImportSourceError(path, found, "Give the folder that holds calibration/.")
    for meta in metas:
        root = meta.parent.parent.parent
        content = read_yaml(meta)
        name = _object(content, meta)
        folder = f"extrinsics_{word(content, 'extrinsics', meta)}"
        extrinsics = root / "calibration" / folder / "extrinsics.yml"
        if not extrinsics.is_file():
            found = f"it is missing, for {meta}"
            raise ImportSourceError(extrinsics, found, "Get the data set's calibration folder.")
        labels = sorted(meta.parent.glob("*/labels_*.npz"))
        sequence = meta.parent
        yield ClipSource(
            name=clip_name(sequence.parent.name, sequence.name),
            subject=sequence.parent.name.partition("-")[2] or sequence.parent.name,
            files=(meta, extrinsics, *labels),
            object=ObjectSource(name, find_ycb_mesh(name, root, options), category=name.partition("_")[2]),
        )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one sequence.

    Raises
    ------
    ImportSourceError
        If a file is missing, cut off or of another layout.
    """
    meta, extrinsics = source.files[:2]
    content = read_yaml(meta)
    cameras, tag = _cameras(extrinsics)
    n_frames = whole(content, "num_frames", meta)
    grasped = whole(content, "ycb_grasp_ind", meta)
    by_camera = _labels(source, n_frames)
    points = np.full((n_frames, 21, 3), np.nan)
    poses = np.full((n_frames, 4, 4), np.nan)
    for serial in _serials(content, meta):
        for frame, file in by_camera.get(serial, {}).items():
            if np.isnan(points[frame, 0, 0]) or np.isnan(poses[frame, 0, 0]):
                if serial not in cameras:
                    raise ImportSourceError(extrinsics, f"it has no camera {serial}", AGAIN)
                label = _label(file, grasped, metres_in(options))
                _fill(points[frame], poses[frame], label, cameras[serial])
    return Clip(
        hands=(ClipHand(_side(content, meta), points),),
        rate=options.rate or RATE,
        identifier=f"{meta.parent.parent.name}/{meta.parent.name}",
        poses=poses,
        up=(0.0, 0.0, 1.0) if tag else None,
        task="pick up",
        attributes={"ycb_ids": entry(content, "ycb_ids", meta)},
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _object(content: object, meta: Path) -> str:
    """Return the name of the object that is grasped."""
    ids, grasped = entry(content, "ycb_ids", meta), whole(content, "ycb_grasp_ind", meta)
    try:
        return OBJECTS[ids[grasped]]
    except (KeyError, IndexError, TypeError) as error:
        found = f"ycb_ids {ids} with ycb_grasp_ind {grasped} name no object"
        raise ImportSourceError(meta, found, f"There are objects 1 to {len(OBJECTS)}. {AGAIN}") from error


def _serials(content: object, meta: Path) -> list[str]:
    serials = entry(content, "serials", meta)
    if not isinstance(serials, list):
        raise ImportSourceError(meta, f"serials is {serials!r:.60}, not a list of cameras", AGAIN)
    return [str(serial) for serial in serials]


def _side(content: object, meta: Path) -> Side:
    sides = entry(content, "mano_sides", meta)
    if not isinstance(sides, list) or len(sides) != 1 or sides[0] not in tuple(Side):
        raise ImportSourceError(meta, f"mano_sides is {sides!r:.60}", "One hand, right or left, is read.")
    return Side(sides[0])


def _cameras(path: Path) -> tuple[dict[str, Array], bool]:
    """Return tag_from_camera (4, 4) by serial number, and whether there is a tag; else master_from_camera."""
    content = entry(read_yaml(path), "extrinsics", path)
    if not isinstance(content, Mapping):
        raise ImportSourceError(path, "extrinsics are no cameras", AGAIN)
    poses = {str(name): np.eye(4) for name in content}
    for name in content:
        pose = numbers({str(name): content[name]}, str(name), (12,), path).reshape(3, 4)
        if not np.allclose(pose[:, :3] @ pose[:, :3].T, np.eye(3), atol=1e-3):
            raise ImportSourceError(path, f"the rotation of {name} is none", AGAIN)
        poses[str(name)][:3] = pose
    tag = poses.pop("apriltag", None)
    if tag is None:
        return poses, False
    return {name: np.linalg.inv(tag) @ pose for name, pose in poses.items()}, True


def _labels(source: ClipSource, n_frames: int) -> dict[str, dict[int, Path]]:
    """Return the label files by camera and frame."""
    found: dict[str, dict[int, Path]] = {}
    for file in source.files[2:]:
        match = _LABELS.fullmatch(file.name)
        if match and int(match[1]) < n_frames:
            found.setdefault(file.parent.name, {})[int(match[1])] = file
    folder = source.files[0].parent
    if not found:
        raise ImportSourceError(folder, "no camera has labels_*.npz", "Get the labels of the sequence.")
    for camera, frames in found.items():
        if len(frames) != n_frames:
            missing = f"camera {camera} has {len(frames)} of {n_frames} label files"
            raise ImportSourceError(folder, missing, AGAIN)
    return found


def _label(file: Path, grasped: int, scale: float) -> tuple[Floats, Floats]:
    """Return the joints (21, 3) and the pose (3, 4) of the object that is grasped, in the camera's axes."""
    label = read_npz(file, ("joint_3d", "pose_y"))
    joints = numbers(label, "joint_3d", (1, 21, 3), file)[0]
    objects = numbers(label, "pose_y", (None, 3, 4), file)
    if grasped >= len(objects):
        raise ImportSourceError(file, f"pose_y has {len(objects)} objects, not number {grasped}", AGAIN)
    pose = objects[grasped].copy()
    pose[:, 3] *= scale
    return np.where((joints == -1).all(), np.nan, scale * joints), pose


def _fill(points: Floats, pose: Floats, label: tuple[Floats, Floats], camera: Array) -> None:
    """Write hand (21, 3) and object pose (4, 4) of one label in the common frame, where they are missing."""
    joints, placed = label
    if np.isnan(points[0, 0]):
        points[:] = transform_points(camera[:3, :3], camera[:3, 3], np.asarray(joints, dtype=np.float64))
    if np.isnan(pose[0, 0]) and placed.any():
        pose[:] = camera @ np.vstack([placed, [0.0, 0.0, 0.0, 1.0]])
