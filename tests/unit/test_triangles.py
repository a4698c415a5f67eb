"""The tree of a mesh's triangles: nearest points are those of all triangles one by one, inside is inside."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from graspdb_ingest.objects.triangles import RAYS, inside, nearest_points, triangle_tree

SHAPES = {
    "box": trimesh.creation.box((0.05, 0.07, 0.1)),
    "torus": trimesh.creation.torus(0.05, 0.015),
    "mug": trimesh.creation.annulus(0.03, 0.034, 0.09),
    "triangle": trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]], process=False),
}


def nearest_of_all(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Return the least distance to any triangle: of its plane, where the foot lies on it, or of its edges."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    least = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        axis = end - start
        arm = points[:, None] - start
        share = np.clip(np.sum(arm * axis, axis=2) / np.sum(axis * axis, axis=1), 0, 1)
        least = np.minimum(least, np.linalg.norm(arm - share[..., None] * axis, axis=2).min(axis=1))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = np.sum((points[:, None] - a) * normals, axis=2)
    feet = points[:, None] - heights[..., None] * normals
    edges = ((a, b), (b, c), (c, a))
    over = [np.sum(np.cross(end - start, feet - start) * normals, axis=2) >= 0 for start, end in edges]
    return np.minimum(least, np.where(np.all(over, axis=0), np.abs(heights), np.inf).min(axis=1))


@pytest.mark.parametrize("shape", SHAPES)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
@settings(max_examples=10, deadline=None)
def test_the_nearest_point_is_that_of_all_triangles_one_by_one(shape: str, seed: int, paths: int) -> None:
    mesh = SHAPES[shape]
    points = np.random.default_rng(seed).uniform(-0.15, 0.15, (20, paths, 3))
    tree = triangle_tree(mesh.vertices, mesh.faces)
    positions, triangles = nearest_points(tree, points)
    distances = np.linalg.norm(positions - points, axis=2)
    assert distances.ravel() == pytest.approx(nearest_of_all(mesh, points.reshape(-1, 3)), abs=1e-12)
    weights = trimesh.triangles.points_to_barycentric(
        tree.corners[triangles].reshape(-1, 3, 3), positions.reshape(-1, 3)
    )
    assert weights.min() > -1e-9


def test_on_its_corners_and_edges_a_mesh_is_at_no_distance() -> None:
    mesh = SHAPES["torus"]
    tree = triangle_tree(mesh.vertices, mesh.faces)
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges].mean(axis=1)])[None]
    assert nearest_points(tree, points)[0] == pytest.approx(points, abs=1e-15)


def test_triangles_without_an_area_do_no_harm() -> None:
    mesh = SHAPES["box"]
    flat = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]])
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (1, 50, 3))
    found = nearest_points(triangle_tree(mesh.vertices, np.concatenate([mesh.faces, flat])), points)[0]
    assert found == pytest.approx(nearest_points(triangle_tree(mesh.vertices, mesh.faces), points)[0])


@pytest.mark.parametrize("step", [0.001, 0.02, 0.1])
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_inside_is_inside_however_long_the_steps(step: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.1, 0.1, (1, 20, 3)) + rng.normal(0, step, (50, 20, 3)).cumsum(axis=0)
    points[:, 0] *= 0.0  # the middle, whose rays may lead through corners
    box, mug = SHAPES["box"], SHAPES["mug"]
    assert np.array_equal(found_inside(box, points), np.all(np.abs(points) < box.extents / 2, axis=2))
    across = np.linalg.norm(points[..., :2], axis=2)
    clear = np.minimum(np.abs(across - 0.03), np.abs(across - 0.034)) > 0.001  # of the facets' sagitta
    walls = (across > 0.03) & (across < 0.034) & (np.abs(points[..., 2]) < 0.045)
    assert np.array_equal(found_inside(mug, points)[clear], walls[clear])


def found_inside(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    tree = triangle_tree(mesh.vertices, mesh.faces)
    distances = np.linalg.norm(points - nearest_points(tree, points)[0], axis=2)
    return inside(tree, points, distances, RAYS)
