"""The ManipNet sequences: two hands and an object as motion files, from the folder of recordings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.bvh import BvhMotion, read_bvh
from graspdb_ingest.hand.dimensions import SEGMENT_LENGTH_PER_HAND_LENGTH, HandDimensions
from graspdb_ingest.objects.cloud import sample_cloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.rigid import inverse_transform_points
from graspdb_ingest.surface import HandPoints
from graspdb_schemas.vocabulary import DIGITS, Side

DECIMETRE: Final = 0.1
JOINTS: Final = {
    "thumb": ("THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
    **{
        f: tuple(f"{f.upper()}_{j}" for j in ("MCP", "PIP_FE", "DIP_FE")) for f in ("index", "middle", "ring")
    },
    "little": ("PINKY_MCP", "PINKY_PIP_FE", "PINKY_DIP_FE"),
}


@dataclass(frozen=True, eq=False)
class Sequence:
    """Two hands in an object's frame, and the object's motion in the lab frame (y is up)."""

    rate: float
    target: ObjectDistance
    hands: dict[Side, HandPoints]
    object_positions: np.ndarray
    object_rotations: np.ndarray


def load_sequence(folder: Path) -> Sequence:
    """Read one object's sequence; finger tips, which the files lack, continue the last bone."""
    name = folder.name
    thing = read_bvh(folder / f"{name}.bvh.gz", DECIMETRE)
    positions, rotations = thing.positions[:, 0], thing.rotations[:, 0]
    read = load_surface(folder / f"{name}.obj", DECIMETRE)
    assert read.faces is not None
    # Mirrored: x is negated, and with it the order of the corners.
    surface = Surface(
        read.vertices * [-1, 1, 1], read.faces[:, ::-1], None, read.area, read.volume, read.extents,
        read.watertight, read.sha256, read.warnings,
    )  # fmt: skip
    hands = {}
    for side in Side:
        motion = read_bvh(folder / f"{side}Hand.bvh.gz", DECIMETRE)
        radii, in_lab = _key_points(motion)
        hands[side] = HandPoints(inverse_transform_points(rotations, positions, in_lab), radii, side)
    return Sequence(thing.rate, ObjectDistance(surface, sample_cloud(surface)), hands, positions, rotations)


def rises(sequence: Sequence) -> list[float]:
    """Return when the object leaves the table, by its height alone [s]: first 5 mm above it for good."""
    height = sequence.object_positions[:, 1]
    table = np.quantile(height[: round(sequence.rate)], 0.5)
    raised, found, frame = height > table + 0.02, [], 0
    while raised[frame:].any():
        up = frame + int(raised[frame:].argmax())
        low = np.flatnonzero(height[frame : up + 1] < table + 0.005)
        if len(low):
            found.append((frame + int(low[-1])) / sequence.rate)
        down = np.flatnonzero(height[up:] < table + 0.005)
        if not len(down):
            break
        frame = up + int(down[0])
    return found


def _key_points(motion: BvhMotion) -> tuple[np.ndarray, np.ndarray]:
    """Return radii (20,) of a hand of this size, and key points (n, 21, 3) in the lab frame [m]."""
    chains = {digit: [motion.index(joint) for joint in JOINTS[digit]] for digit in DIGITS}
    middle = motion.positions[0, [0, *chains["middle"]]]
    shares = 0.446 + sum(SEGMENT_LENGTH_PER_HAND_LENGTH["middle"][:2])
    length = float(np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()) / shares
    radii = HandDimensions(length, 0.449 * length).radii
    points = [motion.positions[:, 0]]
    for number, digit in enumerate(DIGITS):
        points += [motion.positions[:, joint] for joint in chains[digit]]
        points.append(_tip(motion, chains[digit][-1], digit, float(radii[4 * number + 3])))
    return radii, np.stack(points, axis=1)


def _tip(motion: BvhMotion, last: int, digit: str, radius: float) -> np.ndarray:
    """Return the centre of a finger's tip: straight on, as at rest, by the usual length of the last bone."""
    bone = DECIMETRE * motion.joints[last].offset
    _, before, distal = SEGMENT_LENGTH_PER_HAND_LENGTH[digit]
    length = float(np.linalg.norm(bone))
    reach = bone / length * (length * distal / before - radius)
    return np.asarray(motion.positions[:, last] + np.einsum("fij,j->fi", motion.rotations[:, last], reach))
