"""The MANO hand in numpy against one computed the long way, and the files that it is read from."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mano_file import mano_content, rest_key_points, slow_key_points, write_mano
from scipy.spatial.transform import Rotation

from graspdb_ingest.importers.mano import ManoModel, find_mano, mend_left_shape, read_mano
from graspdb_ingest.importers.order import in_usual_order
from graspdb_schemas.errors import ImportSourceError, ParameterError, UnsafeFileError
from graspdb_schemas.vocabulary import Side


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with model files of both hands."""
    folder = tmp_path_factory.mktemp("mano")
    for side in Side:
        write_mano(folder, side)
    return folder


@pytest.fixture(scope="module")
def right(folder: Path) -> ManoModel:
    return read_mano(folder / "MANO_RIGHT.pkl", Side.RIGHT)


def parameters(n: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return (
        rng.normal(scale=0.4, size=(n, 45)),
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 10)),
    )


@pytest.mark.parametrize("side", Side)
def test_key_points_are_those_of_skinning_every_vertex(folder: Path, side: Side) -> None:
    model = read_mano(folder / f"MANO_{side.upper()}.pkl", side)
    pose, orientation, place, shape = parameters(4)
    fast = in_usual_order(model.key_points(pose, orientation, place, shape), "mano")
    content = mano_content(side)
    slow = [slow_key_points(content, *frame) for frame in zip(pose, orientation, place, shape, strict=True)]
    assert np.allclose(fast, slow, atol=1e-12)


def test_zero_pose_is_the_template(right: ManoModel) -> None:
    zero = np.zeros((1, 45)), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(10)
    points = in_usual_order(right.key_points(*zero), "mano")
    assert np.allclose(points[0], rest_key_points(Side.RIGHT), atol=1e-12)


def test_orientation_and_translation_move_the_hand_rigidly_about_its_wrist(right: ManoModel) -> None:
    pose, orientation, place, shape = parameters(5)
    still = right.key_points(pose, np.zeros((5, 3)), np.zeros((5, 3)), shape)
    moved = right.key_points(pose, orientation, place, shape)
    turns = Rotation.from_rotvec(orientation).as_matrix()
    wrist = still[:, :1]
    expected = np.einsum("ncd,nkd->nkc", turns, still - wrist) + wrist + place[:, None]
    assert np.allclose(moved, expected, atol=1e-12)


def test_one_shape_serves_all_frames(right: ManoModel) -> None:
    pose, orientation, place, shape = parameters(3)
    once = right.key_points(pose, orientation, place, shape[0])
    each = right.key_points(pose, orientation, place, np.tile(shape[0], (3, 1)))
    assert np.array_equal(once, each)


def test_components_and_either_mean_give_the_full_pose(right: ManoModel) -> None:
    content = mano_content(Side.RIGHT)
    coefficients = np.random.default_rng(0).normal(size=(2, 24))
    vectors = coefficients @ content["hands_components"][:24]
    flat = right.full_pose(coefficients, components=True, flat_hand_mean=True)
    mean = right.full_pose(coefficients, components=True, flat_hand_mean=False)
    assert np.allclose(flat, vectors)
    assert np.allclose(mean - flat, content["hands_mean"])
    assert np.allclose(right.full_pose(vectors, components=False, flat_hand_mean=False), mean)
    with pytest.raises(ParameterError, match="MANO pose"):
        right.full_pose(coefficients, components=False, flat_hand_mean=True)


def test_a_persons_template_replaces_the_mean_hand(right: ManoModel) -> None:
    larger = right.with_template(1.1 * right.template)
    zero = np.zeros((1, 45)), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(10)
    assert np.allclose(larger.key_points(*zero), 1.1 * right.key_points(*zero))
    with pytest.raises(ParameterError, match=r"\(777, 3\)"):
        right.with_template(right.template[1:])


def test_the_left_models_unmirrored_shape_is_mended_once(right: ManoModel, folder: Path) -> None:
    content = mano_content(Side.LEFT)
    left = read_mano(folder / "MANO_LEFT.pkl", Side.LEFT)
    assert np.array_equal(left.shape_directions, content["shapedirs"])
    mended = mend_left_shape(left, right)
    assert np.array_equal(mended.shape_directions[:, 0], -left.shape_directions[:, 0])
    assert np.array_equal(mended.shape_directions[:, 1:], left.shape_directions[:, 1:])
    assert mend_left_shape(mended, right) is mended


def test_the_file_is_found_in_a_folder_beside_another_and_by_itself(folder: Path, tmp_path: Path) -> None:
    for given in (folder, folder / "MANO_RIGHT.pkl", folder / "MANO_LEFT.pkl"):
        assert find_mano(given, Side.LEFT, tmp_path) == folder / "MANO_LEFT.pkl"
    renamed = tmp_path / "hand.pkl"
    renamed.write_bytes((folder / "MANO_RIGHT.pkl").read_bytes())
    assert find_mano(renamed, Side.RIGHT, tmp_path) == renamed


@pytest.mark.parametrize("given", [None, "empty", "MANO_RIGHT.pkl"])
def test_a_missing_model_says_where_to_get_it(tmp_path: Path, given: str | None) -> None:
    (tmp_path / "empty").mkdir()
    write_mano(tmp_path, Side.RIGHT)
    with pytest.raises(ImportSourceError, match=r"MANO_LEFT.pkl.*mano.is.tue.mpg.de.*--mano"):
        find_mano(None if given is None else tmp_path / given, Side.LEFT, tmp_path / "data")


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"v_template": np.zeros((10475, 3))}, r"v_template is \(10475, 3\)"),
        ({"hands_mean": None}, "hands_mean is nothing"),
        ({"weights": np.full((778, 16), "x")}, r"weights is \(778, 16\), not numbers"),
        ({"kintree_table": np.zeros((2, 24), int)}, "kintree_table"),
        ({"kintree_table": np.array([[0, *range(2, 17)], range(16)])}, "no tree"),
    ],
)
def test_another_models_file_is_named(tmp_path: Path, change: dict[str, Any], found: str) -> None:
    content = mano_content(Side.RIGHT) | change
    content["J_regressor"] = content["J_regressor"].toarray()
    path = tmp_path / "MANO_RIGHT.pkl"
    path.write_bytes(pickle.dumps(content))
    with pytest.raises(ImportSourceError, match=found):
        read_mano(path, Side.RIGHT)


def test_half_a_model_file_is_named(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "MANO_RIGHT.pkl"
    path.write_bytes((folder / "MANO_RIGHT.pkl").read_bytes()[:100_000])
    with pytest.raises(ImportSourceError, match="no whole pickle") as caught:
        read_mano(path, Side.RIGHT)
    assert not isinstance(caught.value, UnsafeFileError)
