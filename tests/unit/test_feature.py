"""Graspable features: a cube's corner in closed form, the empty feature, rigid motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.descriptor import LENGTH, N_FOURIER, describe, local_features
from graspdb_ingest.enclosure import EnclosingSpace, enclosing_space
from graspdb_ingest.feature import graspable_feature
from graspdb_ingest.objects.cloud import ObjectCloud

SIDE, N = 0.06, 60
PITCH = SIDE / N


def cube():
    """Return a cube from the origin to (SIDE, SIDE, SIDE), its faces tiled by small squares."""
    ticks = (np.arange(N) + 0.5) * PITCH
    across, along = (a.ravel() for a in np.meshgrid(ticks, ticks))
    points, normals = [], []
    for axis in range(3):
        for end in (0.0, SIDE):
            points.append(np.insert(np.column_stack([across, along]), axis, end, axis=1))
            normals.append(np.tile(np.sign(end - SIDE / 2) * np.eye(3)[axis], (N * N, 1)))
    count = 6 * N * N
    return ObjectCloud(np.concatenate(points), np.concatenate(normals), np.full(count, PITCH**2), PITCH)


def histograms_of(cloud):
    rng = np.random.default_rng(1)
    return rng.uniform(0, 100, (len(cloud.points), 33)).astype(np.float32)


def features_of(cloud):
    return local_features(histograms_of(cloud))


def box(low, high):
    """Return the enclosing space of spheres without radius in the corners of a box."""
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    return enclosing_space(corners, np.zeros(8), 1)


def moved(cloud, turn, shift):
    return ObjectCloud(
        turn.apply(cloud.points) + shift, turn.apply(cloud.normals), cloud.areas, cloud.spacing
    )


def test_corner_of_a_cube_has_three_squares():
    cloud, reach = cube(), 0.02
    feature = graspable_feature(cloud, features_of(cloud), box([-0.01] * 3, [reach] * 3))
    assert feature.area == pytest.approx(3 * reach**2, rel=0.01)
    # Each square's middle lies at (0, 1/2, 1/2) of the reach, in turn.
    assert np.allclose(feature.centroid, reach / 3, atol=PITCH / 2)
    assert np.all(cloud.points[feature.points] <= reach + 1e-9)
    assert np.array_equal(feature.points, np.unique(feature.points))
    assert len(feature.points) == 3 * 20**2


def test_whole_cube_has_its_area_and_its_sides():
    cloud = cube()
    feature = graspable_feature(cloud, features_of(cloud), box([-0.01] * 3, [0.07] * 3))
    assert feature.area == pytest.approx(6 * SIDE**2, rel=1e-9)
    assert len(feature.points) == len(cloud.points)
    assert np.allclose(feature.centroid, SIDE / 2, atol=1e-12)
    assert np.all((feature.extents >= SIDE - 1e-9) & (feature.extents <= np.sqrt(3) * SIDE + 1e-9))


def test_extents_of_a_strip_are_its_length_width_and_thickness():
    cloud = cube()
    space = box([-0.001, 0.01, 0.02], [0.001, 0.05, 0.03])
    feature = graspable_feature(cloud, features_of(cloud), space)
    assert feature.area == pytest.approx(0.04 * 0.01, rel=0.02)
    assert np.allclose(feature.extents, [0.04 - PITCH, 0.01 - PITCH, 0], atol=1e-9)


def test_areas_weigh_the_points():
    whole = cube()
    areas = np.random.default_rng(2).uniform(1e-6, 5e-6, len(whole.points))
    cloud = ObjectCloud(whole.points, whole.normals, areas, PITCH)
    histograms = histograms_of(cloud)
    feature = graspable_feature(cloud, local_features(histograms), box([-0.01] * 3, [0.02] * 3))
    inside = np.flatnonzero(np.all(cloud.points <= 0.02, axis=1))
    assert np.array_equal(feature.points, inside)
    described = describe(cloud.points[inside], cloud.normals[inside], histograms[inside], areas[inside])
    assert np.allclose(feature.descriptor, described, rtol=0, atol=1e-6)
    assert feature.area == pytest.approx(areas[inside].sum())
    assert np.allclose(feature.centroid, np.average(cloud.points[inside], axis=0, weights=areas[inside]))


@pytest.mark.parametrize("where", ["beside the cube", "inside the cube", "nowhere"])
def test_hull_without_a_point_gives_the_empty_feature(where):
    cloud = cube()
    spaces = {
        "beside the cube": box([0.1] * 3, [0.2] * 3),
        "inside the cube": box([0.02] * 3, [0.04] * 3),
        "nowhere": enclosing_space(np.empty((0, 3)), np.empty(0), 64),
    }
    feature = graspable_feature(cloud, features_of(cloud), spaces[where])
    assert feature.points.shape == (0,)
    assert feature.area == 0
    assert np.isnan(feature.centroid).all()
    assert np.array_equal(feature.extents, np.zeros(3))
    assert feature.descriptor.shape == (LENGTH,)
    assert np.isnan(feature.descriptor).all()


def test_feature_of_one_point_has_no_extent():
    cloud = cube()
    x = 0.5 * PITCH
    space = box([-1e-4, x - 1e-4, x - 1e-4], [1e-4, x + 1e-4, x + 1e-4])
    feature = graspable_feature(cloud, features_of(cloud), space)
    assert len(feature.points) == 1
    assert np.array_equal(feature.extents, np.zeros(3))
    assert np.array_equal(feature.descriptor[N_FOURIER:], np.zeros(LENGTH - N_FOURIER))


def test_feature_moves_with_hand_and_object():
    cloud, rng = cube(), np.random.default_rng(3)
    histograms = histograms_of(cloud)
    centres, radii = (
        np.array([[0, 0, 0.01], [0.031, 0.002, 0], [0.003, 0.042, 0.013], [0, 0.02, 0.05]]),
        0.007,
    )
    space: EnclosingSpace = enclosing_space(centres, np.full(4, radii), 64)
    turn, shift = Rotation.random(rng=rng), np.array([0.4, -1.0, 0.2])
    vertices = turn.apply(space.vertices) + shift
    there_space = enclosing_space(vertices, np.zeros(len(vertices)), 1)
    here = graspable_feature(cloud, local_features(histograms), space)
    there = graspable_feature(moved(cloud, turn, shift), local_features(histograms), there_space)
    assert len(here.points) > 500
    assert np.array_equal(here.points, there.points)
    assert there.area == pytest.approx(here.area, rel=1e-12)
    assert np.allclose(there.extents, here.extents, atol=1e-6)
    assert np.allclose(there.centroid, turn.apply(here.centroid) + shift, atol=1e-12)
    assert np.allclose(here.descriptor, there.descriptor, atol=1e-5)
