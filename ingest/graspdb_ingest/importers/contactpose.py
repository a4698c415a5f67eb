"""Format ``contactpose``: ContactPose, static grasps with both hands and thermal contact maps.

Layout, from the data set's documentation and its loader: a folder ``full<participant>_<intent>`` a session,
in it a folder an object with ``annotations.json`` and, where contact maps were downloaded, ``<object>.ply``.
Joints are 21 in the order of OpenPose, metres, in the object's frame, or in a hand's own frame where the
hand is ``moving``; then each frame has ``hTo``, hand_from_object. Each frame has ``oTw``, object_from_world,
quaternions w x y z, and the cameras' times. A contact map is a mesh in metres, whose red channel is heat.
Files of the same content named ``full<participant>_<intent>_<object>*.json``, as the data set's web page
has them, are read, too; contact then is an NPZ file ``*_contact*.npz`` with ``vertices_m``, ``contact01``.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_npz
from graspdb_ingest.importers.base import (
    Clip,
    ClipHand,
    ClipSource,
    Format,
    Importer,
    ImportOptions,
    MeasuredContact,
    ObjectSource,
    clip_name,
)
from graspdb_ingest.importers.meshes import MESH_ENDINGS, find_mesh
from graspdb_ingest.rigid import rotations_from_quaternions, transform_points
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import KEY_POINTS, Side

SIDES: Final = (Side.LEFT, Side.RIGHT)
"""Which hand is which in a file."""

FORMAT: Final = Format(
    name="contactpose",
    title="ContactPose",
    version="2020 (with the corrections of its data changelog)",
    licence="MIT, without the objects' models, which have their own",
    needs=(
        "full<participant>_<intent>/<object>/annotations.json, with <object>.ply for contact",
        "the objects' models in object_models/, or --objects (else the contact maps' meshes)",
    ),
    documentation="https://github.com/facebookresearch/ContactPose/blob/main/docs/doc.md",
)

_SESSION: Final = re.compile(r"full(\d+)_(use|handoff)")
_FILE: Final = re.compile(r"full(\d+)_(use|handoff)_(.+?)(?:\.annotations.*)?\.json")
_PATTERNS: Final = (
    "annotations.json",
    "*/annotations.json",
    "full*_*/*/annotations.json",
    "contactpose_data/full*_*/*/annotations.json",
    "full*_*_*.json",
)


def recognises(path: Path) -> bool:
    """Whether a path has annotations of ContactPose."""
    return next(iter(_annotations(path)), None) is not None


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the grasps under a path.

    Raises
    ------
    ImportSourceError
        If there is none.
    """
    found = list(_annotations(path))
    if not found:
        what = "no annotations of ContactPose" if path.exists() else "there is no such path"
        raise ImportSourceError(path, what, "Check the path.")
    maps: dict[str, Path] = {}
    for file, (_, _, thing) in found:
        if (own := file.with_name(f"{thing}.ply")).is_file():
            maps.setdefault(thing, own)
    for file, (participant, intent, thing) in found:
        mesh = _mesh(thing, path, file, maps, options)
        contact = _contact_file(file, thing)
        yield ClipSource(
            name=clip_name(f"full{participant}", intent, thing),
            subject=participant,
            files=(file,) if contact is None else (file, contact),
            object=None if mesh is None else ObjectSource(thing, mesh, category=thing),
            part={"intent": intent, "object": thing},
        )


def read(source: ClipSource, _options: ImportOptions) -> Clip:
    """Read one grasp.

    Raises
    ------
    ImportSourceError
        If the file is not all there, or does not say what it should.
    """
    file = source.files[0]
    try:
        said = json.loads(file.read_bytes())
        frames = said.get("frames", [])
        rate, places, n = _timing(frames)
        poses = _poses(frames, places, n) if frames else None
        hands = tuple(_hands(said["hands"], frames, places, poses))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        found = f"not the annotations of a grasp ({type(error).__name__}: {error})"
        raise ImportSourceError(file, found, "Download it again.") from error
    if not hands:
        raise ImportSourceError(file, "no hand in it is valid", "Leave this grasp out.")
    notes: tuple[str, ...] = ()
    if source.object is None:
        missing = f"no mesh of object {source.part['object']!r}: postures alone, no contact"
        notes = (f"{missing}. Name a folder that has it with --objects and import again.",)
    return Clip(
        hands=hands,
        rate=rate,
        identifier=f"full{source.subject}_{source.part['intent']}/{source.part['object']}",
        poses=poses,
        task=str(source.part["intent"]),
        measured=_measured(source.files[1]) if len(source.files) > 1 else None,
        attributes={"object": source.part["object"], "recorded_frames": len(frames)},
        notes=notes,
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _annotations(path: Path) -> Iterator[tuple[Path, tuple[str, str, str]]]:
    """Yield the files of annotations under a path, with participant, intent and object."""
    if path.is_file():
        match = _FILE.fullmatch(path.name)
        if match:
            yield path, (match[1], match[2], match[3])
        return
    for pattern in _PATTERNS:
        for file in sorted(path.glob(pattern)):
            resolved = file.resolve()
            match = _FILE.fullmatch(file.name)
            session = _SESSION.fullmatch(resolved.parent.parent.name)
            if match:
                yield file, (match[1], match[2], match[3])
            elif session:
                yield file, (session[1], session[2], resolved.parent.name)


def _mesh(
    thing: str, path: Path, file: Path, maps: Mapping[str, Path], options: ImportOptions
) -> Path | None:
    """Return the mesh of an object, which all its grasps share; None where there is none."""
    root = path if path.is_dir() else path.parent
    for folder in (options.objects, root / "object_models", root.parent / "object_models", file.parent):
        if folder is None or not folder.exists():
            continue
        if folder == file.parent and thing in maps:
            return maps[thing]
        if folder.is_file() or any((folder / f"{thing}{ending}").is_file() for ending in MESH_ENDINGS):
            return find_mesh(thing, folder, options)
    return maps.get(thing)


def _contact_file(file: Path, thing: str) -> Path | None:
    if file.name == "annotations.json":
        own = file.with_name(f"{thing}.ply")
        return own if own.is_file() else None
    beside = sorted(file.parent.glob(f"{file.name.partition('.')[0]}*_contact*.npz"))
    return beside[0] if beside else None


def _timing(frames: list[Any]) -> tuple[float | None, np.ndarray, int]:
    """Return rate [Hz], place of each recorded frame on an even grid of time, and the grid's length.

    The cameras drop frames; what they dropped is a gap.
    """
    if len(frames) < 2:
        return None, np.zeros(1, dtype=np.int64), 1
    times = np.array([_time(frame) for frame in frames])
    step = float(np.median(np.diff(times)))
    places = np.round((times - times[0]) / step).astype(np.int64)
    if step <= 0 or (np.diff(places) < 0).any() or places[-1] > 100 * len(frames):
        raise ValueError("times that do not rise evenly")
    return 1 / step, places, int(places[-1]) + 1


def _time(frame: Mapping[str, Any]) -> float:
    return float(np.mean([clock["sec"] + 1e-9 * clock["nsec"] for clock in frame["time"].values()]))


def _poses(frames: list[Any], places: np.ndarray, n: int) -> Floats:
    """Return world_from_object on the grid, shape (n, 4, 4); NaN in its gaps."""
    poses = np.full((n, 4, 4), np.nan)
    poses[places] = [np.linalg.inv(_matrix(frame["oTw"])) for frame in frames]
    return poses


def _matrix(pose: Mapping[str, Any]) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3] = rotations_from_quaternions(np.array([pose["rotation"]], dtype=np.float64))[0]
    matrix[:3, 3] = pose["translation"]
    return matrix


def _hands(
    said: list[Any], frames: list[Any], places: np.ndarray, poses: Floats | None
) -> Iterator[ClipHand]:
    """Yield the valid hands in the world's frame, or the object's where there are no frames."""
    for number, (side, hand) in enumerate(zip(SIDES, said, strict=True)):
        if not hand["valid"]:
            continue
        joints = np.array(hand["joints"], dtype=np.float64)
        if joints.shape != (len(KEY_POINTS), 3):
            raise ValueError(f"joints of shape {joints.shape}")
        if poses is None:
            yield ClipHand(side, joints[None])
            continue
        world = poses.copy()
        if hand.get("moving", False):
            world[places] = [
                poses[place] @ np.linalg.inv(_matrix(frame["hTo"][number]))
                for place, frame in zip(places, frames, strict=True)
            ]
        yield ClipHand(side, _placed(world, joints))


def _placed(poses: Floats, joints: Floats) -> Floats:
    rotations, positions = (
        np.asarray(part, dtype=np.float64) for part in (poses[:, :3, :3], poses[:, :3, 3])
    )
    return transform_points(rotations, positions, np.asarray(joints, dtype=np.float64))


def _measured(file: Path) -> MeasuredContact:
    """Read a contact map: a mesh with heat as its vertices' red, or an NPZ file.

    Raises
    ------
    ImportSourceError
        If it is not all there.
    """
    try:
        if file.suffix == ".npz":
            arrays: Any = read_npz(file)
            positions, contact = arrays["vertices_m"], arrays["contact01"]
        else:
            mesh: Any = trimesh.load(file, process=False)
            positions, contact = mesh.vertices, mesh.visual.vertex_colors[:, 0] / 255.0
        measured = MeasuredContact(
            "thermal", np.asarray(positions, dtype=np.float64), np.asarray(contact, dtype=np.float64)
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ImportSourceError(file, f"not a contact map ({error})", "Download it again.") from error
    if measured.positions.shape != (len(measured.contact), 3):
        found = f"{len(measured.contact)} values for positions of shape {measured.positions.shape}"
        raise ImportSourceError(file, found, "Download it again.")
    return measured
