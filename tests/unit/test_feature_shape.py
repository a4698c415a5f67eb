"""Curvature, connected pieces, class and facing of closed forms: plane, edge, bar, sphere, torus."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from graspdb_ingest.feature_shape import (
    connected_patches,
    curvature_class,
    facing_sides,
    feature_shape,
    surface_neighbours,
)
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.curvature import principal_curvatures
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.parameters import CloudParameters
from graspdb_schemas.vocabulary import Side


def cloud_of(mesh, spacing=0.002):
    surface = Surface(
        np.array(mesh.vertices), np.array(mesh.faces), None, float(mesh.area), None, np.ones(3), True, "", ()
    )
    return sample_cloud(surface, CloudParameters(spacing=spacing))


def smooth(cloud, normals):
    return ObjectCloud(cloud.points, normals, cloud.areas, cloud.spacing)


def cylinder(radius, height=0.12, spacing=0.002):
    """Return the side of a cylinder about z, with its true normals."""
    cloud = cloud_of(trimesh.creation.cylinder(radius, height, sections=256), spacing)
    side = np.abs(cloud.normals[:, 2]) < 0.5
    points = cloud.points[side]
    normals = points * [1, 1, 0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ObjectCloud(points, normals, cloud.areas[side], spacing)


def sphere(radius):
    cloud = cloud_of(trimesh.creation.icosphere(5, radius))
    return smooth(cloud, cloud.points / np.linalg.norm(cloud.points, axis=1, keepdims=True))


def torus(across=0.008, around=0.03):
    cloud = cloud_of(trimesh.creation.torus(around, across, 128, 64))
    ring = cloud.points * [1, 1, 0]
    ring *= around / np.linalg.norm(ring, axis=1, keepdims=True)
    normals = cloud.points - ring
    return smooth(cloud, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def box(sides):
    return cloud_of(trimesh.creation.box(sides))


def curvatures_of(cloud):
    return principal_curvatures(cloud.points, cloud.normals, cloud.spacing)


def classed(cloud, chosen=slice(None)):
    return curvature_class(curvatures_of(cloud)[chosen], cloud.normals[chosen], cloud.areas[chosen])


@pytest.mark.parametrize("radius", [0.004, 0.01, 0.035, 0.08])
def test_a_cylinder_bends_one_way_by_its_radius(radius):
    cloud = cylinder(radius)
    inner = np.abs(cloud.points[:, 2]) < 0.05
    curvatures = curvatures_of(cloud)[inner]
    assert np.allclose(curvatures[:, 0], 1 / radius, rtol=0.01)
    assert np.abs(curvatures[:, 1]).max() < 0.05 / radius


@pytest.mark.parametrize("radius", [0.01, 0.03])
def test_a_sphere_bends_both_ways_by_its_radius(radius):
    assert np.allclose(curvatures_of(sphere(radius)), 1 / radius, rtol=0.01)


def test_a_plane_does_not_bend_and_a_hollow_bends_inwards():
    plate = box([0.1, 0.1, 0.03])
    middle = (np.abs(plate.points[:, :2]) < 0.03).all(axis=1)
    assert np.abs(curvatures_of(plate)[middle]).max() < 1e-6
    hollow = cylinder(0.03)
    assert curvatures_of(smooth(hollow, -hollow.normals))[:, 0].max() < -0.9 / 0.03


def test_a_torus_has_the_curvature_of_its_bar_and_of_its_ring():
    cloud = torus()
    curvatures = curvatures_of(cloud)
    assert np.median(curvatures[:, 0]) == pytest.approx(1 / 0.008, rel=0.03)
    outermost = np.linalg.norm(cloud.points[:, :2], axis=1) > 0.0378
    assert np.median(curvatures[outermost, 1]) == pytest.approx(1 / 0.038, rel=0.1)


@pytest.mark.parametrize("radius", [0.004, 0.008, 0.015, 0.024])
def test_a_bar_that_a_hand_can_wrap_is_a_handle(radius):
    assert classed(cylinder(radius)) == "handle"


def test_half_a_bar_is_a_handle_and_a_quarter_is_not():
    cloud = cylinder(0.015)
    assert classed(cloud, cloud.points[:, 0] > 0) == "handle"
    assert classed(cloud, (cloud.points[:, 0] > 0) & (cloud.points[:, 1] > 0)) != "handle"


def test_the_handle_of_a_mug_is_a_handle_and_its_wall_is_not():
    assert classed(torus()) == "handle"
    assert classed(cylinder(0.04)) == "rounded"


def test_bottles_and_balls_are_rounded():
    assert classed(cylinder(0.033)) == "rounded"
    assert classed(sphere(0.015)) == "rounded"
    assert classed(sphere(0.04)) == "rounded"


def test_the_faces_of_a_box_are_flat_and_its_edges_are_edges():
    cloud = box([0.1, 0.1, 0.1])
    inside = np.sort(np.abs(cloud.points), axis=1)[:, 1] < 0.04
    assert classed(cloud, inside) == "flat"
    from_edge = np.abs(cloud.points[:, [0, 2]] - 0.05).max(axis=1)
    for width in (0.008, 0.015, 0.03):
        assert classed(cloud, (from_edge < width) & (np.abs(cloud.points[:, 1]) < 0.03)) == "edge", width


def test_the_rim_of_a_thin_plate_is_an_edge():
    plate = box([0.12, 0.12, 0.004])
    assert classed(plate, plate.points[:, 0] > 0.045) == "edge"


def test_class_does_not_depend_on_the_spacing_of_the_cloud():
    for spacing in (0.001, 0.002, 0.0025):
        assert classed(cylinder(0.012, 0.08, spacing)) == "handle"
        assert classed(cylinder(0.035, 0.08, spacing)) == "rounded"


def neighbours_of(cloud):
    return surface_neighbours(cloud.points, cloud.normals, cloud.spacing)


def patches_of(cloud, chosen=slice(None)):
    return connected_patches(np.arange(len(cloud.points))[chosen], cloud.areas, neighbours_of(cloud))


def test_a_whole_box_is_one_piece_and_two_opposite_faces_are_two():
    cloud = box([0.06, 0.04, 0.03])
    assert patches_of(cloud).max() == 0
    ends = np.abs(cloud.points[:, 0]) > 0.0295
    ends &= np.abs(cloud.normals[:, 0]) > 0.5
    patches = patches_of(cloud, ends)
    assert np.bincount(patches).size == 2
    assert (np.bincount(patches, np.sign(cloud.points[ends, 0])) != 0).all()


@pytest.mark.parametrize("thickness", [0.0005, 0.001, 0.002, 0.003])
def test_two_sides_of_a_wall_are_two_pieces_and_with_the_rim_they_are_one(thickness):
    plate = box([0.08, 0.08, thickness])
    middle = (np.abs(plate.points[:, :2]) < 0.02).all(axis=1)
    patches = patches_of(plate, middle)
    assert patches.max() == 1
    for number in (0, 1):
        assert len(np.unique(np.sign(plate.normals[middle][patches == number][:, 2]))) == 1
    if thickness >= 0.002:  # a rim narrower than the spacing may have no point of its own
        assert patches_of(plate, plate.points[:, 0] > 0.02).max() == 0


def test_the_largest_piece_comes_first():
    cloud = box([0.06, 0.04, 0.03])
    big = cloud.points[:, 0] > 0.029
    small = (cloud.points[:, 0] < -0.029) & (np.abs(cloud.points[:, 1]) < 0.005)
    patches = patches_of(cloud, big | small)
    areas = np.bincount(patches, cloud.areas[big | small])
    assert (np.diff(areas) <= 0).all()
    assert (cloud.points[big | small][patches == 0][:, 0] > 0).all()


@pytest.mark.parametrize(("side", "name"), [(Side.RIGHT, "radial"), (Side.LEFT, "ulnar")])
def test_a_surface_faces_the_side_that_looks_against_its_normal(side, name):
    areas, hand = np.ones(1), np.eye(3)
    # the hand's frame: x distal, y radial of a right hand and ulnar of a left one, z dorsal
    assert facing_sides(np.array([[0, 0, 1.0]]), areas, hand, side)["palmar"] == 1
    assert facing_sides(np.array([[-1.0, 0, 0]]), areas, hand, side)["distal"] == 1
    assert facing_sides(np.array([[0, -1.0, 0]]), areas, hand, side)[name] == 1


def test_shape_turns_with_hand_and_object():
    cloud = torus()
    points = np.flatnonzero(cloud.points[:, 0] > 0)
    turn = Rotation.from_euler("xyz", [0.4, 1.0, -2.0])
    moved = ObjectCloud(turn.apply(cloud.points) + 1, turn.apply(cloud.normals), cloud.areas, cloud.spacing)
    here = feature_shape(cloud, curvatures_of(cloud), neighbours_of(cloud), points, np.eye(3), Side.RIGHT)
    there = feature_shape(
        moved, curvatures_of(moved), neighbours_of(moved), points, turn.as_matrix(), Side.RIGHT
    )
    assert here.curvature_class == there.curvature_class == "handle"
    assert here.hand_sides == pytest.approx(there.hand_sides, abs=0.01)
    assert np.array_equal(here.patches, there.patches)
    assert here.patch_areas.sum() == pytest.approx(cloud.areas[points].sum())
    assert sum(here.hand_sides.values()) == pytest.approx(1)


def test_an_empty_feature_and_a_single_point_have_a_shape():
    cloud = torus()
    nothing = feature_shape(
        cloud, curvatures_of(cloud), neighbours_of(cloud), np.empty(0, dtype=np.int64), np.eye(3), Side.RIGHT
    )
    assert (nothing.curvature_class, nothing.hand_side, len(nothing.patches)) == (None, None, 0)
    one = feature_shape(
        cloud, curvatures_of(cloud), neighbours_of(cloud), np.array([5]), np.full((3, 3), np.nan), Side.RIGHT
    )
    assert one.patches.tolist() == [0]
    assert (one.hand_side, one.hand_sides) == (None, {})
