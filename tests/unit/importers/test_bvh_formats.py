"""Hands and an object as BVH files: joints found by their names, tips flagged where there are none."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from graspdb_ingest.importers import bvh
from graspdb_ingest.importers.base import Clip, ImportOptions
from graspdb_schemas.errors import GraspDBError, ImportSourceError, RecordingError
from graspdb_schemas.vocabulary import DIGITS, KEY_POINTS, TIPS, Side

OPTIONS = ImportOptions()
N, RATE = 8, 60.0
ACROSS = {"thumb": 0.03, "index": 0.025, "middle": 0.0, "ring": -0.02, "little": -0.035}
BONES = {"thumb": (0.04, 0.03, 0.025), **dict.fromkeys(DIGITS[1:], (0.045, 0.027, 0.02))}


def skeleton(side: Side, tips: bool, prefix: str, metacarpal: bool = True) -> tuple[list[str], np.ndarray]:
    """Return the lines of a bent right or left hand's hierarchy, and its key points at rest [m]."""
    mirror = 1.0 if side is Side.RIGHT else -1.0
    lines = [f"ROOT {prefix}Wrist", "{", "OFFSET 0 0 0"]
    lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
    points = [np.zeros(3)]
    for digit in DIGITS:
        base = np.array([0.02 if digit == "thumb" else 0.085, 0.0, mirror * ACROSS[digit]])
        # Fingers point along x, bend towards -y; the thumb lies on the palm's side of its row.
        bends = zip(BONES[digit], (0.3, 0.8, 1.2), strict=True)
        bones = [np.array([b * np.cos(a), -b * np.sin(a), 0]) for b, a in bends]
        offsets = [base, *bones]
        name = "Pinky" if digit == "little" else digit.capitalize()
        depth = 0
        if metacarpal and digit != "thumb":
            lines += [f"JOINT {prefix}{name}0", "{", _offset(0.5 * base), _turns()]
            offsets[0] = 0.5 * base
            depth = 1
        for number, offset in enumerate(offsets[:3], 1):
            lines += [f"JOINT {prefix}{name}{number}", "{", _offset(offset), _turns()]
        end = offsets[3] if tips else np.zeros(3)
        lines += ["End Site", "{", _offset(end), "}", *["}"] * (3 + depth)]
        points += list(np.cumsum([base, *bones], axis=0))
    return [*lines, "}"], np.array(points)


def _offset(vector: np.ndarray) -> str:
    return "OFFSET " + " ".join(f"{value:.12g}" for value in vector)


def _turns() -> str:
    return "CHANNELS 3 Zrotation Xrotation Yrotation"


def path(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and Euler angles z, x, y [deg] of a root."""
    rng = np.random.default_rng(seed)
    return rng.normal(0, 0.2, (N, 3)), rng.uniform(-60, 60, (N, 3))


def write(
    file: Path, hierarchy: list[str], root: tuple[np.ndarray, np.ndarray], scale: float, n_frames: int = N
) -> None:
    """Write a BVH file in which only the root moves; lengths are divided by the scale."""
    n_joints = sum(line.startswith("JOINT") for line in hierarchy)
    text = [
        _offset(np.array(line.split()[1:], dtype=float) / scale) if line.startswith("OFFSET") else line
        for line in hierarchy
    ]
    text = ["HIERARCHY", *text, "MOTION", f"Frames: {n_frames}", f"Frame Time: {1 / RATE:.9f}"]
    for position, angles in zip(*(part[:n_frames] for part in root), strict=True):
        numbers = [*(position / scale), *angles, *[0.0] * (3 * n_joints)]
        text.append(" ".join(f"{number:.12g}" for number in numbers))
    file.write_text("\n".join(text) + "\n")


OBJECT = ["ROOT mug", "{", "OFFSET 0 0 0",
          "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
          "End Site", "{", "OFFSET 0 0 0", "}", "}"]  # fmt: skip


def placed(root: tuple[np.ndarray, np.ndarray], points: np.ndarray) -> np.ndarray:
    turns = Rotation.from_euler("ZXY", root[1], degrees=True).as_matrix()
    return np.einsum("fij,kj->fki", turns, points) + root[0][:, None]


def only(folder: Path, options: ImportOptions = OPTIONS, importer: bvh.Importer = bvh.IMPORTER) -> Clip:
    sources = list(importer.find(folder, options))
    assert len(sources) == 1
    return importer.read(sources[0], options)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("metacarpal", [True, False])
def test_key_points_are_the_joints(tmp_path: Path, side: Side, metacarpal: bool) -> None:
    hierarchy, points = skeleton(side, tips=True, prefix=f"{side.capitalize()}Hand", metacarpal=metacarpal)
    write(tmp_path / "take.bvh", hierarchy, path(1), 1.0)
    clip = only(tmp_path)
    (hand,) = clip.hands
    assert (hand.side, hand.extrapolated, hand.dimensions) == (side, (), None)
    np.testing.assert_allclose(hand.key_points, placed(path(1), points), atol=1e-8)
    assert clip.rate == pytest.approx(RATE, rel=1e-6)
    assert clip.up == (0, 1, 0)


def test_missing_tips_go_on_along_the_last_bone_and_are_flagged(tmp_path: Path) -> None:
    hierarchy, points = skeleton(Side.RIGHT, tips=False, prefix="")
    write(tmp_path / "right_hand.bvh", hierarchy, path(1), 0.1)
    (hand,) = only(tmp_path, ImportOptions(units="dm")).hands
    assert hand.extrapolated == tuple(f"{digit}_tip" for digit in DIGITS)
    expected = placed(path(1), points)
    others = [i for i in range(21) if not KEY_POINTS[i].endswith("_tip")]
    np.testing.assert_allclose(hand.key_points[:, others], expected[:, others], atol=1e-8)
    tips = 1 + np.array(TIPS)
    last, before = expected[:, tips - 1], expected[:, tips - 2]
    along = hand.key_points[:, tips] - last
    bone = last - before
    cosine = np.einsum("nki,nki->nk", along, bone)
    cosine /= np.linalg.norm(along, axis=2) * np.linalg.norm(bone, axis=2)
    np.testing.assert_allclose(cosine, 1, atol=1e-9)
    assert (np.linalg.norm(along, axis=2) > 0.005).all()
    assert (np.linalg.norm(along, axis=2) < 0.035).all()
    assert hand.dimensions is not None


def write_manipnet(folder: Path) -> dict[Side, np.ndarray]:
    """Write two hands and an object as a left-handed engine does, in decimetres; return true key points."""
    folder.mkdir()
    truth = {}
    for side, seed in ((Side.RIGHT, 1), (Side.LEFT, 2)):
        other = Side.LEFT if side is Side.RIGHT else Side.RIGHT
        # In the engine's axes, read as right-handed ones, each hand is its mirror image.
        hierarchy, points = skeleton(other, tips=False, prefix="")
        write(folder / f"{side}Hand.bvh", hierarchy, path(seed), 0.1)
        truth[side] = placed(path(seed), points) * [-1, 1, 1]
    write(folder / "mug.bvh", OBJECT, path(3), 0.1)
    trimesh.creation.box((1.0, 0.6, 0.4)).export(folder / "mug.obj")
    return truth


def test_manipnet_is_mirrored_as_a_whole(tmp_path: Path) -> None:
    truth = write_manipnet(tmp_path / "mug1")
    clip = only(tmp_path, importer=bvh.MANIPNET_IMPORTER)
    joints = [i for i in range(21) if not KEY_POINTS[i].endswith("_tip")]
    for hand in clip.hands:
        np.testing.assert_allclose(hand.key_points[:, joints], truth[hand.side][:, joints], atol=1e-8)
    assert clip.poses is not None
    np.testing.assert_allclose(clip.poses[:, :3, 3], path(3)[0] * [-1, 1, 1], atol=1e-8)
    np.testing.assert_allclose(np.linalg.det(clip.poses[:, :3, :3]), 1, atol=1e-9)
    # A point of the mesh keeps its distance from the hand, whichever axes both are seen in.
    corner = np.array([0.05, 0.03, 0.02])
    seen = np.einsum("fij,j->fi", clip.poses[:, :3, :3], corner) + clip.poses[:, :3, 3]
    in_engine = placed(path(3), (corner * [-1, 1, 1])[None])[:, 0]
    right = next(hand for hand in clip.hands if hand.side is Side.RIGHT).key_points[:, 0]
    distance = np.linalg.norm(in_engine - path(1)[0], axis=1)
    np.testing.assert_allclose(np.linalg.norm(seen - right, axis=1), distance, atol=1e-8)


def test_files_of_a_clip_must_belong_together(tmp_path: Path) -> None:
    hierarchy, _ = skeleton(Side.RIGHT, tips=True, prefix="Right")
    write(tmp_path / "hand.bvh", hierarchy, path(1), 1.0)
    write(tmp_path / "mug.bvh", OBJECT, path(3), 1.0, n_frames=N - 1)
    with pytest.raises(ImportSourceError, match="no mesh of object 'mug'"):
        only(tmp_path)
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "mug.obj")
    with pytest.raises(ImportSourceError, match="7 frames at 60 Hz beside 8"):
        only(tmp_path)
    write(tmp_path / "cup.bvh", OBJECT, path(3), 1.0)
    with pytest.raises(ImportSourceError, match="several objects: cup, mug"):
        only(tmp_path)


def test_half_a_file_is_named(tmp_path: Path) -> None:
    hierarchy, _ = skeleton(Side.RIGHT, tips=True, prefix="Right")
    file = tmp_path / "hand.bvh"
    write(file, hierarchy, path(1), 1.0)
    text = file.read_text()
    file.write_text(text[: text.index("MOTION") + 200])
    with pytest.raises(RecordingError, match=r"hand.bvh: its frames are not all there"):
        only(tmp_path)
    file.write_text(text[:100])
    with pytest.raises(RecordingError, match=r"hand.bvh: it is not a BVH file"):
        only(tmp_path)


def test_without_hands_or_a_side_it_is_said_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(ImportSourceError, match="no BVH file"):
        only(tmp_path)
    with pytest.raises(ImportSourceError, match=r"leftHand.bvh and rightHand.bvh"):
        only(tmp_path, importer=bvh.MANIPNET_IMPORTER)
    write(tmp_path / "mug.bvh", OBJECT, path(3), 1.0)
    with pytest.raises(ImportSourceError, match="five digits"):
        only(tmp_path)
    (tmp_path / "mug.bvh").unlink()
    hierarchy, _ = skeleton(Side.RIGHT, tips=True, prefix="")
    write(tmp_path / "take.bvh", hierarchy, path(1), 1.0)
    with pytest.raises(GraspDBError, match="--side"):
        only(tmp_path)
    assert only(tmp_path, ImportOptions(side=Side.RIGHT)).hands[0].side is Side.RIGHT
