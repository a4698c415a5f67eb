"""The depth buffer against closed forms: silhouettes, depths, normals, and what hides what."""

import numpy as np
import pytest

from graspdb.thumbnails.raster import NOTHING, Raster

SIZE = 120


def test_a_sphere_has_its_silhouette_depth_and_normals() -> None:
    raster = Raster.empty(SIZE)
    raster.add_sphere(np.array([60.3, 50.7, 5.0]), 30.0, 1)
    there = raster.material == 1
    assert there.sum() == pytest.approx(np.pi * 30**2, rel=0.01)
    rows, columns = np.nonzero(there)
    x, y = columns + 0.5 - 60.3, rows + 0.5 - 50.7
    np.testing.assert_allclose(raster.depth[there], 5 + np.sqrt(900 - x**2 - y**2))
    np.testing.assert_allclose(np.linalg.norm(raster.normal[there], axis=1), 1)
    np.testing.assert_allclose(raster.normal[there][:, :2], np.stack([x, y], axis=1) / 30)


@pytest.mark.parametrize("tilt", [0.0, 0.4, 1.0])
def test_a_cylinder_is_as_wide_as_it_is_thick_and_as_long_as_it_looks(tilt: float) -> None:
    raster = Raster.empty(SIZE)
    half = 40 * np.array([np.cos(tilt), 0, np.sin(tilt)])
    middle = np.array([60.0, 60.0, 0.0])
    raster.add_cylinder(np.stack([middle - half, middle + half]), 8.0, 1)
    there = raster.material == 1
    assert (there[:, 60]).sum() == 16
    assert there[60].sum() == pytest.approx(80 * np.cos(tilt), abs=1.5)
    # On the line nearest to the eye the normal is that of the axis, turned by a right angle.
    np.testing.assert_allclose(raster.normal[60, 60], [-np.sin(tilt), 0, np.cos(tilt)], atol=0.07)


def test_discs_that_tile_a_tilted_plane_show_that_plane() -> None:
    raster = Raster.empty(SIZE)
    slope = 0.7
    grid = np.stack(np.meshgrid(np.arange(10, 110, 2.0), np.arange(10, 110, 2.0)), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, slope * grid[:, 0]])
    normal = np.array([-slope, 0, 1]) / np.hypot(slope, 1)
    raster.add_discs(points, np.tile(normal, (len(points), 1)), 2.5, np.ones(len(points), int))
    inside = raster.depth[12:108, 12:108]
    columns = np.arange(12, 108) + 0.5
    np.testing.assert_allclose(inside, np.tile(slope * columns, (96, 1)), atol=1e-9)


def test_either_side_of_a_disc_is_seen() -> None:
    one, other = Raster.empty(SIZE), Raster.empty(SIZE)
    centre, normal = np.array([[60.0, 60.0, 0.0]]), np.array([[0.6, 0.0, 0.8]])
    one.add_discs(centre, normal, 9.0, np.array([1]))
    other.add_discs(centre, -normal, 9.0, np.array([1]))
    assert one.material.any()
    np.testing.assert_array_equal(one.depth, other.depth)
    np.testing.assert_array_equal(one.normal, other.normal)


def test_what_is_nearer_hides_what_is_farther_in_whatever_order() -> None:
    rng = np.random.default_rng(0)
    spheres = [(rng.uniform(20, 100, 3), rng.uniform(5, 20), i + 1) for i in range(12)]
    pictures = []
    for order in (spheres, spheres[::-1]):
        raster = Raster.empty(SIZE)
        for sphere in order:
            raster.add_sphere(*sphere)
        pictures.append(raster.material)
    np.testing.assert_array_equal(*pictures)
    depths = np.full((len(spheres), SIZE, SIZE), -np.inf)
    for depth, (centre, radius, _) in zip(depths, spheres, strict=True):
        alone = Raster.empty(SIZE)
        alone.add_sphere(centre, radius, 1)
        depth[:] = alone.depth
    nearest = np.where(np.isfinite(depths).any(axis=0), depths.argmax(axis=0) + 1, NOTHING)
    np.testing.assert_array_equal(pictures[0], nearest)


def test_what_lies_outside_the_picture_is_cut_off() -> None:
    raster = Raster.empty(SIZE)
    raster.add_sphere(np.array([-50.0, 60.0, 0.0]), 20.0, 1)
    raster.add_cylinder(np.array([[200.0, 60, 0], [300, 60, 0]]), 9.0, 1)
    raster.add_discs(np.array([[60.0, 500, 0]]), np.array([[0.0, 0, 1]]), 9.0, np.array([1]))
    assert not raster.material.any()
    raster.add_sphere(np.array([0.0, 60.0, 0.0]), 20.0, 1)
    assert raster.material.sum() == pytest.approx(np.pi * 200, rel=0.03)
