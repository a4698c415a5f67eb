"""What exports of files are made of: paths, surfaces, even choices, grips."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from graspdb.export.closed_surface import closed_surface
from graspdb.export.even import even_choice
from graspdb.export.grip import SAFETY, grip_forces
from graspdb.export.names import path_of, with_ending
from graspdb.export.opensim import free_body_coordinates
from graspdb.export.posed import moved
from graspdb_ingest.enclosure import sphere_vertices


@given(st.lists(st.text(min_size=1).filter(lambda text: "/" not in text), min_size=1, max_size=3))
def test_no_key_leaves_the_folder_and_none_shares_a_path(parts: list[str]) -> None:
    folder = Path("out")
    path = _path(folder, "/".join(parts))
    assert path.parts[0] == "out"
    assert len(path.parts) == len(parts) + 1
    assert not {"..", "."} & set(path.parts)
    other = "/".join([*parts[:-1], parts[-1] + "%2E"])
    assert _path(folder, other) != path


def _path(folder: Path, key: str) -> Path:
    """Return the path that a key gets, with no folder made."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "mkdir", lambda *_, **__: None)
        return path_of(folder, "", key)


def test_an_ending_goes_behind_dots() -> None:
    assert with_ending(Path("a/v1.2"), ".trc") == Path("a/v1.2.trc")


def test_the_surface_through_a_spheres_cloud_encloses_it() -> None:
    normals = sphere_vertices(2000)
    radius, spacing = 0.03, 0.0024
    found = closed_surface(radius * normals, normals, spacing, faces=4000)
    assert found is not None
    assert len(found.faces) <= 4000
    assert found.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.01)
    edges = np.sort(found.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert closed_surface(radius * normals[:10], normals[:10], spacing) is None


@pytest.mark.parametrize("count", [1, 7, 60])
def test_an_even_choice_leaves_no_point_further_than_its_own_are_apart(count: int) -> None:
    points = np.random.default_rng(0).normal(size=(200, 3))
    chosen = even_choice(points, count)
    assert len(set(chosen.tolist())) == count
    if count > 1:
        apart = cdist(points[chosen], points[chosen]) + 1e9 * np.eye(count)
        assert cdist(points, points[chosen]).min(axis=1).max() <= apart.min()


def test_an_even_choice_of_too_few_points_takes_them_in_turn() -> None:
    assert even_choice(np.eye(3), 7).tolist() == [0, 1, 2, 0, 1, 2, 0]


def test_a_grip_of_two_sides_carries_the_weight_within_friction() -> None:
    normals = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    points, weight = 0.02 * normals, np.array([0, 0, -2.0])
    forces = grip_forces(points, normals, np.zeros(3), weight, 0.5, 1.0)
    np.testing.assert_allclose(forces.sum(axis=0), -weight, atol=0.1)
    np.testing.assert_allclose(np.cross(points, forces).sum(axis=0), 0, atol=1e-3)
    inward = -np.einsum("ij,ij->i", forces, normals)
    sideways = np.linalg.norm(forces + inward[:, None] * normals, axis=1)
    assert (inward >= 1.0 - 1e-9).all()
    assert (sideways <= SAFETY * 0.5 * inward + 1e-9).all()


def test_a_moved_configuration_is_the_same_hand_in_another_frame() -> None:
    rng = np.random.default_rng(1)
    turn, own = Rotation.random(rng=rng), Rotation.random(rng=rng)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.as_matrix(), rng.normal(size=3)
    q = np.concatenate([rng.normal(size=3), own.as_quat(scalar_first=True), rng.normal(size=23)])
    there = moved(q, pose)
    np.testing.assert_allclose(there[:3], pose[:3, :3] @ q[:3] + pose[:3, 3])
    wanted = (turn * own).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(there[3:7], scalar_first=True).as_matrix(), wanted)
    np.testing.assert_array_equal(there[7:], q[7:])


def test_coordinates_of_a_body_that_turns_on_and_on_do_not_jump() -> None:
    angle = np.linspace(0, 4 * np.pi, 200)
    quaternions = np.zeros((200, 4))
    quaternions[:, 0], quaternions[:, 3] = np.cos(angle / 2), np.sin(angle / 2)
    quaternions[50] = np.nan
    coordinates = free_body_coordinates(np.zeros((200, 3)), quaternions)
    assert np.isnan(coordinates[50]).all()
    np.testing.assert_allclose(np.delete(coordinates[:, 2], 50), np.delete(angle, 50), atol=1e-9)
