"""BVH files: a skeleton of joints, and how it moves (Biovision hierarchy)."""

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import RecordingError

AXES: Final = "XYZ"


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of a skeleton.

    Attributes
    ----------
    name : str
        Its name; that of an end site is its joint's with `` end``.
    parent : int
        Place of the joint that carries it; -1 for the root.
    offset : ndarray, shape (3,)
        Its place in the parent's frame [file's unit].
    channels : tuple of str
        What of it moves, such as ``Xposition`` or ``Zrotation``, in the order in which it is applied.
    """

    name: str
    parent: int
    offset: Array
    channels: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class BvhMotion:
    """The joints of a skeleton in every frame.

    Attributes
    ----------
    joints : tuple of Joint
        The joints, each after its parent.
    rate : float
        Frames per second [Hz].
    positions : ndarray, shape (n_frames, n_joints, 3)
        Where the joints are [m].
    rotations : ndarray, shape (n_frames, n_joints, 3, 3)
        world_from_joint rotations.
    """

    joints: tuple[Joint, ...]
    rate: float
    positions: Array
    rotations: Array

    def index(self, name: str) -> int:
        """Return the place of a joint by its name."""
        return [joint.name for joint in self.joints].index(name)


def read_bvh(path: Path, scale: float) -> BvhMotion:
    """Read a BVH file, plain or packed with gzip.

    Parameters
    ----------
    path : Path
        The file.
    scale : float
        Factor from the file's lengths to metres.

    Raises
    ------
    RecordingError
        If the file is no BVH, or its frames do not fit its skeleton.
    """
    head, motion, body = _text(path).partition("MOTION")
    joints = _joints(path, head)
    try:
        rate, values = _frames(body)
    except (ValueError, IndexError) as error:
        found = "its frames are not all there, or not numbers"
        raise RecordingError(path, found, "Export the motion again.") from error
    n_channels = sum(len(joint.channels) for joint in joints)
    if not motion or values.shape[1:] != (n_channels,) or not np.isfinite(values).all():
        found = (
            f"frames of {values.shape[-1]} numbers for {n_channels} channels, or numbers that are not finite"
        )
        raise RecordingError(path, found, "Export the motion again.")
    positions, rotations = _forward(joints, values, scale)
    return BvhMotion(joints, rate, positions, rotations)


def read_skeleton(path: Path) -> tuple[Joint, ...]:
    """Read the joints of a BVH file alone.

    Raises
    ------
    RecordingError
        If the file is no BVH.
    """
    return _joints(path, _text(path).partition("MOTION")[0])


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
        return (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode("utf-8")
    except (OSError, EOFError, UnicodeDecodeError, zlib.error) as error:
        raise RecordingError(path, f"it cannot be read: {error}", "Give a BVH file.") from error


def _joints(path: Path, head: str) -> tuple[Joint, ...]:
    try:
        return tuple(_skeleton(iter(head.split())))
    except (RuntimeError, ValueError, IndexError) as error:
        raise RecordingError(path, "it is not a BVH file", "Export the motion again.") from error


def _skeleton(words: Iterator[str]) -> Iterator[Joint]:
    """Yield the joints of a hierarchy; one that breaks off raises RuntimeError, as generators do."""
    if next(words, "") != "HIERARCHY":
        raise ValueError("no hierarchy")
    stack: list[int] = []
    number, name, names = -1, "", list[str]()
    for word in words:
        if word in ("ROOT", "JOINT"):
            name = next(words)
        elif word == "End":
            next(words)
            name = f"{names[stack[-1]]} end"
        elif word == "{":
            number += 1
            names.append(name)
            offset, channels = _description(words, name.endswith(" end"))
            yield Joint(name, stack[-1] if stack else -1, offset, channels)
            stack.append(number)
        elif word == "}":
            stack.pop()
        else:
            raise ValueError(word)


def _description(words: Iterator[str], is_end: bool) -> tuple[Array, tuple[str, ...]]:
    if next(words) != "OFFSET":
        raise ValueError("no offset")
    offset = np.array([float(next(words)) for _ in range(3)])
    if is_end:
        return offset, ()
    if next(words) != "CHANNELS":
        raise ValueError("no channels")
    return offset, tuple(next(words) for _ in range(int(next(words))))


def _frames(body: str) -> tuple[float, Array]:
    """Return frames per second, and the numbers of every frame, shape (n_frames, n_channels)."""
    lines = [line for line in body.splitlines() if line.strip()]
    n_frames, duration = int(lines[0].split(":")[1]), float(lines[1].split(":")[1])
    values = np.array([line.split() for line in lines[2:]], dtype=np.float64)
    if len(values) != n_frames or not duration > 0:
        raise ValueError("frames are missing")
    return 1 / duration, values


def _forward(joints: tuple[Joint, ...], values: Array, scale: float) -> tuple[Array, Array]:
    """Return positions [m] and rotations of all joints in all frames."""
    positions = np.empty((len(values), len(joints), 3))
    rotations = np.empty((len(values), len(joints), 3, 3))
    column = 0
    for i, joint in enumerate(joints):
        own = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        moved = np.tile(scale * joint.offset, (len(values), 1))
        turned = np.tile(np.eye(3), (len(values), 1, 1))
        for channel, value in zip(joint.channels, own.T, strict=True):
            axis, kind = channel[0], channel[1:]
            if kind == "position":
                moved[:, AXES.index(axis)] += scale * value
            else:
                turned = turned @ Rotation.from_euler(axis, value[:, None], degrees=True).as_matrix()
        if joint.parent >= 0:
            above = rotations[:, joint.parent]
            moved = positions[:, joint.parent] + np.einsum("fij,fj->fi", above, moved)
            turned = above @ turned
        positions[:, i], rotations[:, i] = moved, turned
    return positions, rotations
