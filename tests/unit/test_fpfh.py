"""Point feature histograms: the same for the same surface, wherever and whenever it is."""

import numpy as np
import open3d
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.fpfh import fpfh
from graspdb_schemas.errors import ParameterError


def torus() -> ObjectCloud:
    mesh = trimesh.creation.torus(0.05, 0.02)
    points, face = trimesh.sample.sample_surface(mesh, 3000, seed=0)
    return ObjectCloud(np.array(points), np.array(mesh.face_normals[face]), np.full(3000, 1e-6), 0.002)


def test_each_of_three_histograms_is_complete() -> None:
    features = fpfh(torus(), 0.01)
    assert features.shape == (3000, 33)
    assert features.dtype == np.float32
    # A point's own histogram and the weighted mean of its neighbours' hold 100 each.
    assert features.reshape(-1, 3, 11).sum(axis=2) == pytest.approx(200, rel=1e-4)


def test_histograms_are_those_of_open3d() -> None:
    cloud = torus()
    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points))
    points.normals = open3d.utility.Vector3dVector(cloud.normals)
    search = open3d.geometry.KDTreeSearchParamRadius(0.01)
    expected = open3d.pipelines.registration.compute_fpfh_feature(points, search).data.T
    assert fpfh(cloud, 0.01) == pytest.approx(expected, abs=1e-4)


def test_twice_gives_the_same_bits() -> None:
    assert fpfh(torus(), 0.01).tobytes() == fpfh(torus(), 0.01).tobytes()


def test_rigid_motion_changes_nothing() -> None:
    cloud = torus()
    turn = Rotation.from_rotvec([0.4, -1.1, 2.0])
    points = turn.apply(cloud.points) + np.array([0.2, 0.1, -0.3])
    moved = ObjectCloud(points, turn.apply(cloud.normals), cloud.areas, cloud.spacing)
    difference = np.abs(fpfh(cloud, 0.01) - fpfh(moved, 0.01))
    assert np.median(difference) < 1e-3  # a pair on the border of two bins may change sides by rounding
    assert np.percentile(difference, 99) < 1


def test_the_order_of_points_is_the_order_of_features() -> None:
    cloud = torus()
    order = np.random.default_rng(1).permutation(3000)
    shuffled = ObjectCloud(cloud.points[order], cloud.normals[order], cloud.areas, 0.002)
    assert fpfh(shuffled, 0.01) == pytest.approx(fpfh(cloud, 0.01)[order], rel=1e-3, abs=0.05)


def test_flat_and_round_surfaces_differ() -> None:
    grid = np.stack(np.meshgrid(np.arange(40), np.arange(40)), axis=-1).reshape(-1, 2) * 0.002
    flat = ObjectCloud(np.pad(grid, ((0, 0), (0, 1))), np.tile([0.0, 0, 1], (1600, 1)), np.ones(1600), 0.002)
    assert fpfh(flat, 0.01).std(axis=0).max() < 1
    assert np.abs(fpfh(flat, 0.01).mean(axis=0) - fpfh(torus(), 0.01).mean(axis=0)).max() > 20


def test_a_point_without_neighbours_has_zeros() -> None:
    cloud = ObjectCloud(np.eye(3), np.eye(3), np.ones(3), 1.0)
    assert not fpfh(cloud, 0.01).any()


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan")])
def test_a_radius_that_is_none_is_an_error(radius: float) -> None:
    with pytest.raises(ParameterError, match="fpfh_radius"):
        fpfh(torus(), radius)
