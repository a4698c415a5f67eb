"""Units and sides that key points themselves give away."""

from pathlib import Path

import numpy as np
import pytest
from posed_hands import postures
from scipy.spatial.transform import Rotation

from graspdb_ingest.importers.base import Clip, ClipHand
from graspdb_ingest.importers.plausible import SURE, check_clip, chirality, side_found
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.units import METRES_PER
from graspdb_schemas.vocabulary import Side

FILE = Path("clip.npz")


def clip(points: np.ndarray, side: Side = Side.RIGHT, poses: np.ndarray | None = None) -> Clip:
    return Clip((ClipHand(side, points),), None, "clip", poses)


@pytest.mark.parametrize("side", Side)
def test_sides_of_usual_postures_are_found(side: Side) -> None:
    every = postures(side, 200)
    found = [side_found(points[None]) for points in every]
    assert found.count(side) >= 190
    assert found.count(Side.LEFT if side is Side.RIGHT else Side.RIGHT) <= 2
    assert side_found(every) is side


def test_the_mirror_image_is_the_other_hand_and_a_turned_one_the_same() -> None:
    points = postures(Side.RIGHT, 20)
    turned = points @ Rotation.random(rng=np.random.default_rng(1)).as_matrix() + [1, 2, 3]
    assert chirality(turned) == pytest.approx(chirality(points), abs=1e-9)
    assert chirality(1000 * points) == pytest.approx(chirality(points), abs=1e-9)
    assert chirality(points * [1, -1, 1]) == pytest.approx(-chirality(points), abs=1e-9)
    assert chirality(points) > SURE


def test_no_frame_tells_nothing() -> None:
    assert side_found(np.full((3, 21, 3), np.nan)) is None
    assert side_found(np.zeros((0, 21, 3))) is None


def test_a_wrong_side_is_reported_as_declared_and_found() -> None:
    with pytest.raises(ImportSourceError, match="declared to be of the left hand are those of a right"):
        check_clip(clip(postures(Side.RIGHT, 20), Side.LEFT), FILE, None)


@pytest.mark.parametrize("true", METRES_PER)
@pytest.mark.parametrize("said", METRES_PER)
def test_a_wrong_unit_is_seen_and_the_right_one_suggested(true: str, said: str) -> None:
    points = postures(Side.RIGHT, 5) / METRES_PER[true] * METRES_PER[said]
    if true == said:
        assert check_clip(clip(points), FILE, said).clip.n_frames == 5
        return
    with pytest.raises(ImportSourceError, match=f"--units {true}$"):
        check_clip(clip(points), FILE, said)


def test_frames_in_another_unit_are_named() -> None:
    points = postures(Side.RIGHT, 9)
    points[[4, 7]] *= 1000
    with pytest.raises(ImportSourceError, match=r"mixed units.* 2 of 9, the first of them frame 4"):
        check_clip(clip(points), FILE, None)


def test_frames_that_are_no_hand_are_left_out_and_noted() -> None:
    points = postures(Side.RIGHT, 9)
    points[2] *= 0.02
    points[5, 3] = np.nan
    found = check_clip(clip(points), FILE, None)
    assert np.isnan(found.clip.hands[0].key_points[[2, 5]]).all()
    assert np.array_equal(found.clip.hands[0].key_points[0], points[0])
    assert [note.partition(" frames ")[0] for note in found.notes] == ["right hand: 1"] * 2


def test_a_clip_without_a_hand_is_refused() -> None:
    with pytest.raises(ImportSourceError, match="no frame shows a hand"):
        check_clip(clip(np.full((3, 21, 3), np.nan)), FILE, None)


def test_an_object_in_another_unit_is_refused() -> None:
    points = postures(Side.RIGHT, 4)
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, :3, 3] = points[:, 0] + [0, 0, 0.1]
    assert check_clip(clip(points, poses=poses), FILE, None)
    poses[:, :3, 3] *= 1000
    with pytest.raises(ImportSourceError, match=r"nearer than .* to the object"):
        check_clip(clip(points, poses=poses), FILE, None)
