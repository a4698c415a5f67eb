"""Format ``hot3d``: HOT3D, two hands and many objects, by optical motion capture.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  an object in a recording: all objects of the scene are followed all the time
subject                ``participant_id`` of ``metadata.json``
hands                  ``umetrack_hand_pose_trajectory.jsonl`` on ``umetrack_hand_user_profile.json``;
                       with --mano, ``mano_hand_pose_trajectory.jsonl``, 15 principal components
                       about the mean hand
object                 ``<object_uid>.glb`` in ``assets`` (--objects), named by ``instance.json``
object pose            ``dynamic_objects.csv``: quaternion and translation
rate, frame            from the time stamps; metres, z up (Aria) or y up (Quest 3)
=====================  ===========================================================================

Both hand models are those of the data set's authors. UmeTrack's is complete in the files, and the better one,
for the poses were found with it; MANO's was fitted to it. The left MANO model's shape is mended, as they do.
"""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_bytes
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
    MOST_MISSING,
    matches,
    numbers,
    read_json,
    read_json_lines,
    rigid,
    rotations_by,
    word,
)
from graspdb_ingest.importers.mano import N_SHAPE, find_mano, mend_left_shape, read_mano
from graspdb_ingest.importers.meshes import find_mesh
from graspdb_ingest.importers.order import in_usual_order
from graspdb_ingest.importers.umetrack import N_HINGES, read_profile
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

UMETRACK: Final = "umetrack_hand_pose_trajectory.jsonl"
PROFILE: Final = "umetrack_hand_user_profile.json"
MANO: Final = "mano_hand_pose_trajectory.jsonl"
POSES: Final = "dynamic_objects.csv"
HANDS: Final[Mapping[Side, str]] = {Side.RIGHT: "1", Side.LEFT: "0"}
UP: Final[Mapping[str, tuple[float, float, float]]] = {"Aria": (0.0, 0.0, 1.0), "Quest3": (0.0, 1.0, 0.0)}
"""Vertical of the world by headset."""

SAME_TIME: Final = 5_000_000
"""Time stamps so near to each other belong to one frame, as those of two cameras of Aria do [ns]."""

FORMAT: Final = Format(
    name="hot3d",
    title="HOT3D",
    version="2024",
    licence="HOT3D licence agreement, see projectaria.com/datasets/hot3d/license",
    needs=(
        f"<recording>/metadata.json, {POSES}, {UMETRACK} and {PROFILE}",
        "assets/<object_uid>.glb and instance.json, or --objects",
        f"with --mano: {MANO}, MANO_RIGHT.pkl and MANO_LEFT.pkl",
    ),
    documentation="https://github.com/facebookresearch/hot3d",
)
_COLUMNS: Final = ("t_wo_x[m]", "t_wo_y[m]", "t_wo_z[m]", "q_wo_w", "q_wo_x", "q_wo_y", "q_wo_z")


def recognises(path: Path) -> bool:
    """Whether a folder looks like HOT3D or one of its recordings."""
    return matches(path, POSES, f"*/{POSES}")


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the objects of all recordings with poses under the data set's folder, or of one recording.

    Raises
    ------
    ImportSourceError
        If there is none, or a mesh or a model file is missing.
    """
    motion = MANO if options.mano else UMETRACK
    folders = [file.parent for pattern in (POSES, f"*/{POSES}") for file in sorted(path.glob(pattern))]
    folders = [folder for folder in folders if (folder / motion).is_file()]
    if not folders:
        found = f"no recording of HOT3D with {POSES} and {motion} is in it"
        raise ImportSourceError(path, found, "Get ground truth and hand data of some recordings.")
    models = [find_mano(options.mano, side, path) for side in Side] if options.mano else []
    for folder in folders:
        hands = (folder / motion, *(models or [folder / PROFILE]))
        library = options.objects or next(
            (
                place
                for place in (folder.parent / "assets", folder.parent.parent / "assets")
                if place.is_dir()
            ),
            folder.parent,
        )
        names = _names(library)
        subject = word(read_json(folder / "metadata.json"), "participant_id", folder / "metadata.json")
        for uid in sorted(_rows(folder / POSES)):
            name = names.get(uid, uid)
            yield ClipSource(
                name=clip_name(folder.name, name),
                subject=subject,
                files=(folder / POSES, folder / "metadata.json", *hands),
                object=ObjectSource(name, find_mesh(uid, library, options), category=name),
                part={"uid": uid},
            )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one object of a recording, with both hands.

    Raises
    ------
    ImportSourceError
        If a file is missing, cut off or of another layout.
    """
    poses_file, metadata, motion = source.files[:3]
    placed = _rows(poses_file).get(source.part["uid"], {})
    lines = _lines(motion)
    times = _grid([*placed, *lines], options.rate, motion)
    rows = np.array([placed[time] for time in placed]).reshape(-1, len(_COLUMNS))
    poses = np.full((len(times), 4, 4), np.nan)
    frames = _frames(times, list(placed))
    poses[frames] = rigid(rotations_by(rows[:, 3:], poses_file), rows[:, :3])
    hands = tuple(hand for side in Side if (hand := _hand(side, lines, times, source.files[2:])) is not None)
    if not hands:
        raise ImportSourceError(motion, "it has neither hand", AGAIN)
    headset = word(read_json(metadata), "headset", metadata)
    return Clip(
        hands=hands,
        rate=1e9 / float(np.median(np.diff(times))) if len(times) > 1 else 30.0,
        identifier=f"{motion.parent.name}/{source.part['uid']}",
        poses=poses,
        up=UP.get(headset),
        attributes={"headset": headset, "hand_model": "MANO" if motion.name == MANO else "UmeTrack"},
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _names(library: Path) -> dict[str, str]:
    """Return the names of the objects by their identifiers, where the library says them."""
    file = library / "instance.json"
    if not file.is_file():
        return {}
    content = read_json(file)
    return {uid: word(content, f"{uid}.instance_name", file) for uid in content}


def _rows(path: Path) -> dict[str, dict[int, list[float]]]:
    """Return position [m] and quaternion (w, x, y, z) by object and time stamp [ns]."""
    table = csv.DictReader(io.StringIO(read_bytes(path).decode("utf-8", errors="replace")))
    missing = [
        name for name in ("object_uid", "timestamp[ns]", *_COLUMNS) if name not in (table.fieldnames or ())
    ]
    if missing:
        raise ImportSourceError(path, f"it has no column {missing[0]!r}; there is {table.fieldnames}", AGAIN)
    rows: dict[str, dict[int, list[float]]] = {}
    for number, row in enumerate(table, start=2):
        try:
            values = [float(row[name]) for name in _COLUMNS]
            rows.setdefault(row["object_uid"], {})[int(row["timestamp[ns]"])] = values
        except (TypeError, ValueError) as error:
            raise ImportSourceError(path, f"line {number} is no whole row of numbers", AGAIN) from error
    return rows


def _lines(path: Path) -> dict[int, Mapping[str, Any]]:
    """Return what each line says of the hands, by time stamp [ns]."""
    lines: dict[int, Mapping[str, Any]] = {}
    for number, line in enumerate(read_json_lines(path), start=1):
        if not isinstance(line, dict) or not isinstance(line.get("timestamp_ns"), int):
            raise ImportSourceError(path, f"line {number} has no timestamp_ns", AGAIN)
        poses = line.get("hand_poses")
        if not isinstance(poses, dict):
            raise ImportSourceError(path, f"line {number} has no hand_poses", AGAIN)
        lines[line["timestamp_ns"]] = poses
    return lines


def _grid(stamps: Sequence[int], rate: float | None, path: Path) -> Floats:
    """Return evenly spaced times [ns] that the stamps belong to, shape (n_frames,)."""
    ordered = np.unique(np.array(stamps, dtype=np.int64))
    if not len(ordered):
        raise ImportSourceError(path, "it has no frames", AGAIN)
    kept = ordered[np.concatenate(([True], np.diff(ordered) > SAME_TIME))]
    if len(kept) == 1:
        return kept.astype(np.float64)
    span = float(kept[-1] - kept[0])
    period = 1e9 / rate if rate else span / round(span / float(np.median(np.diff(kept))))
    n_frames = round(span / period) + 1
    if n_frames > MOST_MISSING * len(kept):
        raise ImportSourceError(
            path, f"its {len(kept)} time stamps span {n_frames} frames", "Check their unit, ns."
        )
    return np.asarray(float(kept[0]) + period * np.arange(n_frames))


def _frames(times: Floats, stamps: Sequence[int]) -> list[int]:
    """Return the frame that each time stamp belongs to."""
    if len(times) == 1:
        return [0] * len(stamps)
    period = (times[-1] - times[0]) / (len(times) - 1)
    return [min(max(round((stamp - times[0]) / period), 0), len(times) - 1) for stamp in stamps]


def _hand(
    side: Side, lines: Mapping[int, Mapping[str, Any]], times: Floats, files: Sequence[Path]
) -> ClipHand | None:
    """Return one hand in all frames; None if it is in none."""
    motion, *models = files
    seen = {stamp: poses[HANDS[side]] for stamp, poses in lines.items() if HANDS[side] in poses}
    if not seen:
        return None
    said = list(seen.values())
    places = np.array([numbers(hand, "wrist_xform.t_xyz", (3,), motion) for hand in said])
    turns = np.array([numbers(hand, "wrist_xform.q_wxyz", (4,), motion) for hand in said])
    wrists = rigid(rotations_by(turns, motion), places)
    find_points = _by_mano if motion.name == MANO else _by_umetrack
    points = np.full((len(times), 21, 3), np.nan)
    points[_frames(times, list(seen))] = find_points(side, said, wrists, motion, models)
    return ClipHand(side, points)


def _by_umetrack(
    side: Side, said: Sequence[Any], wrists: Floats, motion: Path, models: Sequence[Path]
) -> Floats:
    angles = np.array(
        [numbers(hand, "joint_angles", ((22,), (N_HINGES,)), motion)[:N_HINGES] for hand in said]
    )
    return read_profile(models[0]).key_points(angles, wrists, side)


def _by_mano(side: Side, said: Sequence[Any], wrists: Floats, motion: Path, models: Sequence[Path]) -> Floats:
    from scipy.spatial.transform import Rotation

    right, left = (read_mano(path, which) for path, which in zip(models, Side, strict=True))
    model = right if side is Side.RIGHT else mend_left_shape(left, right)
    pose = np.array([numbers(hand, "pose", (15,), motion) for hand in said])
    shape = np.array([numbers(hand, "betas", (N_SHAPE,), motion) for hand in said])
    full = model.full_pose(pose, components=True, flat_hand_mean=False)
    orientation = Rotation.from_matrix(wrists[:, :3, :3]).as_rotvec()
    return in_usual_order(model.key_points(full, orientation, wrists[:, :3, 3], shape), "mano")
