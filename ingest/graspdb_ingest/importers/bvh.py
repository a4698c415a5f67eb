"""Formats ``bvh`` and ``manipnet``: motion of hands and an object as BVH files beside the object's mesh.

A folder is a clip. A file with the joints of five digits is a hand, or both; a file of one joint is an
object, whose mesh has the same name. BVH has no unit; its axes are right-handed with y upwards.

ManipNet (Zhang et al. 2021) has decimetres, and was written in a left-handed engine: seen as right-handed,
its right hands are left ones. x is negated throughout, of motion and so of the whole world; the object's
mesh, which the engine negates when it loads it, is right as it stands in its file.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.bvh import BvhMotion, read_bvh, read_skeleton
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
from graspdb_ingest.importers.bvh_hands import find_hands, hand_of, side_in
from graspdb_ingest.importers.meshes import find_mesh
from graspdb_schemas.errors import ImportSourceError, ParameterError
from graspdb_schemas.units import METRES_PER, metres_per

UP: Final = (0.0, 1.0, 0.0)
MIRROR: Final = np.array([-1.0, 1.0, 1.0])
MANIPNET_HANDS: Final = ("leftHand", "rightHand")

BVH: Final = Format(
    name="bvh",
    title="BVH motion of hands and an object",
    version="1",
    licence="",
    needs=("a folder a clip, with BVH files of hands and object, and <object>.obj or another mesh",),
    documentation="docs/import.md",
)
MANIPNET: Final = Format(
    name="manipnet",
    title="ManipNet",
    version="2021",
    licence="CC BY-NC 4.0",
    needs=("a folder a clip with leftHand.bvh, rightHand.bvh, <object>.bvh (or .bvh.gz) and <object>.obj",),
    documentation="https://github.com/cghezhang/ManipNet",
)


def recognises(path: Path) -> bool:
    """Whether a path has folders with BVH files."""
    return bool(_folders(path))


def recognises_manipnet(path: Path) -> bool:
    """Whether a path has folders with the files of ManipNet."""
    return any(_file(folder, MANIPNET_HANDS[0]) is not None for folder in _folders(path))


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the clips under a path: its folders with BVH files, or itself.

    Raises
    ------
    ImportSourceError
        If there is none, a folder has no hand or several objects, or a mesh is missing.
    """
    yield from _find(path, options, 1.0)


def find_manipnet(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the clips of ManipNet under a path; see `find`."""
    if not recognises_manipnet(path):
        raise ImportSourceError(path, "no folder with leftHand.bvh and rightHand.bvh", "Check the path.")
    yield from _find(path, replace(options, units=options.units or "dm"), METRES_PER["dm"])


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one clip.

    Raises
    ------
    RecordingError
        If a file is no BVH, or not all there.
    ImportSourceError
        If the files' frames differ.
    ParameterError
        If nothing says which hand it is.
    """
    return _read(source, options, options.units or "m")


def read_manipnet(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one clip of ManipNet; see `read`."""
    clip = _read(source, options, options.units or "dm")
    hands = tuple(replace(hand, key_points=hand.key_points * MIRROR) for hand in clip.hands)
    poses = clip.poses
    if poses is not None:
        mirror = np.diag([*MIRROR, 1.0])
        poses = np.asarray(mirror @ poses @ mirror)
    return replace(clip, hands=hands, poses=poses)


IMPORTER: Final = Importer(BVH, recognises, find, read)
MANIPNET_IMPORTER: Final = Importer(MANIPNET, recognises_manipnet, find_manipnet, read_manipnet)


def _find(path: Path, options: ImportOptions, default: float) -> Iterator[ClipSource]:
    folders = _folders(path)
    if not folders:
        what = "no BVH file in it, nor in its folders" if path.exists() else "there is no such path"
        raise ImportSourceError(path, what, "Check the path.")
    for folder in folders:
        hands, things = _sorted_files(folder)
        if not hands:
            what = "none of its BVH files has the joints of five digits"
            raise ImportSourceError(
                folder, what, "Names of joints must have thumb, index, middle, ring, little."
            )
        if len(things) > 1:
            what = f"several objects: {', '.join(_stem(file) for file in things)}"
            raise ImportSourceError(folder, what, "Give each clip a folder of its own, with one object.")
        source = None
        if things:
            name = _stem(things[0])
            mesh = find_mesh(name, folder, options)
            source = ObjectSource(name, mesh, scale=_scale(options.units, default))
        yield ClipSource(
            name=clip_name(folder.name),
            subject=options.subject or "unknown",
            files=(*hands, *things),
            object=source,
            part={"hands": len(hands)},
        )


def _folders(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    if _bvh_files(path):
        return [path]
    return [folder for folder in sorted(path.iterdir()) if folder.is_dir() and _bvh_files(folder)]


def _bvh_files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.name.lower().endswith((".bvh", ".bvh.gz")))


def _file(folder: Path, stem: str) -> Path | None:
    return next((file for file in _bvh_files(folder) if _stem(file) == stem), None)


def _stem(file: Path) -> str:
    return file.name.partition(".bvh")[0]


def _sorted_files(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the files of hands, and those of objects: skeletons of one joint."""
    hands, things = [], []
    for file in _bvh_files(folder):
        joints = read_skeleton(file)
        if find_hands(joints):
            hands.append(file)
        elif sum(bool(joint.channels) for joint in joints) == 1:
            things.append(file)
    return hands, things


def _read(source: ClipSource, options: ImportOptions, units: str) -> Clip:
    scale = _scale(units, 1.0)
    n_hands = source.part["hands"]
    motions = [read_bvh(file, scale) for file in source.files]
    for file, motion in zip(source.files, motions, strict=True):
        if (
            len(motion.positions) != len(motions[0].positions)
            or abs(motion.rate / motions[0].rate - 1) > 1e-3
        ):
            found = (
                f"{len(motion.positions)} frames at {motion.rate:g} Hz beside "
                f"{len(motions[0].positions)} at {motions[0].rate:g} Hz in {source.files[0].name}"
            )
            raise ImportSourceError(file, found, "Export all files of a clip together.")
    hands = [
        hand
        for file, motion in zip(source.files[:n_hands], motions[:n_hands], strict=True)
        for hand in _hands(file, motion, options, scale)
    ]
    poses = None
    if len(motions) > n_hands:
        thing = motions[n_hands]
        poses = np.tile(np.eye(4), (len(thing.positions), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = thing.rotations[:, 0], thing.positions[:, 0]
    return Clip(
        hands=tuple(hands),
        rate=motions[0].rate,
        identifier=source.files[0].parent.name,
        poses=poses,
        up=UP,
    )


def _hands(file: Path, motion: BvhMotion, options: ImportOptions, scale: float) -> Iterator[ClipHand]:
    for named, joints in find_hands(motion.joints).items():
        side = named or side_in(_stem(file)) or options.side
        if side is None:
            raise ParameterError("side", None, "right or left; say it with --side, or in the file's name")
        yield hand_of(motion, joints, side, scale)


def _scale(units: str | None, default: float) -> float:
    scale = default if units is None else metres_per(units)
    if scale is None:
        raise ParameterError("units", units, ", ".join(METRES_PER))
    return scale
