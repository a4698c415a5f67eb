"""Contacts: equation 2 by brute force, ties, unknown centres, the threshold, rigid motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.contact import NO_POINT, find_contacts, signed_gaps
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_schemas.vocabulary import SITES

RADII = np.linspace(0.006, 0.013, 20)


def cloud_of(points):
    normals = np.zeros_like(points)
    normals[:, 2] = 1
    return ObjectCloud(points, normals, np.full(len(points), 4e-6), 0.002)


def brute_force(centres, radii, points):
    """Return equation 2 over all points of the cloud, the first of equally near ones."""
    distances = np.sqrt(np.sum((points - centres[..., None, :]) ** 2, axis=-1))
    nearest = np.argmin(distances, axis=-1)
    return np.take_along_axis(distances, nearest[..., None], axis=-1)[..., 0] - radii, nearest


@given(seed=st.integers(0, 2**32 - 1), n_points=st.integers(1, 400))
def test_gaps_are_equation_2_to_the_last_bit(seed, n_points):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.05, 0.05, (n_points, 3))
    points = points[rng.integers(0, n_points, n_points)]  # some of them more than once
    centres = rng.uniform(-0.08, 0.08, (3, 20, 3))
    gaps = signed_gaps(centres, RADII, cloud_of(points))
    gap, nearest = brute_force(centres, RADII, points)
    assert np.array_equal(gaps.nearest, nearest)
    assert np.array_equal(gaps.gap, gap)


@given(seed=st.integers(0, 2**32 - 1))
def test_first_of_equally_near_points_is_the_contact_point(seed):
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3) / 128
    points = np.repeat(grid, 2, axis=0)[rng.permutation(2 * len(grid))]
    centres = rng.integers(0, 9, (20, 3)) / 256  # on the grid's points, edges, faces and cells' middles
    gaps = signed_gaps(centres, RADII, cloud_of(points))
    gap, nearest = brute_force(centres, RADII, points)
    assert np.array_equal(gaps.nearest, nearest)
    assert np.array_equal(gaps.gap, gap)


def test_cloud_of_one_place_many_times_gives_its_first_point():
    gaps = signed_gaps(np.zeros((20, 3)), RADII, cloud_of(np.full((50, 3), 0.01)))
    assert np.all(gaps.nearest == 0)


def test_gap_is_below_zero_inside_a_sphere_and_its_distance_outside():
    points = np.array([[0.0, 0, 0], [0.1, 0, 0]])
    centres = np.zeros((20, 3))
    centres[:, 2] = np.linspace(0, 0.03, 20)
    gaps = signed_gaps(centres, np.full(20, 0.01), cloud_of(points))
    assert np.allclose(gaps.gap, centres[:, 2] - 0.01, atol=1e-15)
    assert np.all(gaps.nearest == 0)


def test_unknown_centre_has_no_gap_and_no_point():
    rng = np.random.default_rng(1)
    points, centres = rng.normal(0, 0.05, (100, 3)), rng.normal(0, 0.05, (4, 20, 3))
    centres[1, 7] = np.nan
    centres[2, 3, 1] = np.nan
    centres[3] = np.nan
    gaps = signed_gaps(centres, RADII, cloud_of(points))
    unknown = np.isnan(centres).any(axis=-1)
    assert np.array_equal(np.isnan(gaps.gap), unknown)
    assert np.array_equal(gaps.nearest == NO_POINT, unknown)
    assert NO_POINT == -1
    assert np.array_equal(gaps.gap[0], brute_force(centres[0], RADII, points)[0])


def test_hand_never_seen_touches_nothing():
    cloud = cloud_of(np.zeros((5, 3)))
    gaps = signed_gaps(np.full((20, 3), np.nan), RADII, cloud)
    contacts = find_contacts(gaps.gap, gaps.nearest, 0.004, cloud)
    assert contacts.sites.shape == (0,)
    assert contacts.positions.shape == contacts.normals.shape == (0, 3)
    assert contacts.digits == contacts.site_names == ()


def test_spheres_nearer_than_the_threshold_touch():
    cloud = cloud_of(np.random.default_rng(2).normal(0, 0.03, (300, 3)))
    gap = np.full(20, 0.05)
    gap[[4, 7, 19]] = (0.0039, -0.002, 0.0)
    gap[8], gap[12] = 0.004, np.nan  # not below h; not known
    nearest = np.arange(20) * 10
    nearest[12] = NO_POINT
    contacts = find_contacts(gap, nearest, 0.004, cloud)
    assert contacts.sites.tolist() == [4, 7, 19]
    assert contacts.points.tolist() == [40, 70, 190]
    assert np.array_equal(contacts.positions, cloud.points[[40, 70, 190]])
    assert np.array_equal(contacts.normals, cloud.normals[[40, 70, 190]])
    assert np.array_equal(contacts.gap, gap[[4, 7, 19]])
    assert contacts.site_names == (SITES[4], SITES[7], SITES[19]) == ("index_mcp", "index_tip", "little_tip")
    assert contacts.digits == ("index", "little")


@pytest.mark.parametrize("threshold", [0.0, 0.002, 0.004, 0.02])
def test_more_spheres_touch_as_the_threshold_grows(threshold):
    rng = np.random.default_rng(3)
    cloud = cloud_of(rng.normal(0, 0.02, (500, 3)))
    gaps = signed_gaps(rng.normal(0, 0.04, (20, 3)), RADII, cloud)
    few = find_contacts(gaps.gap, gaps.nearest, threshold, cloud)
    more = find_contacts(gaps.gap, gaps.nearest, threshold + 0.005, cloud)
    assert set(few.sites) <= set(more.sites)
    assert len(few.sites) == np.sum(gaps.gap < threshold)


def test_contacts_do_not_depend_on_where_hand_and_object_are():
    rng = np.random.default_rng(4)
    points, centres = rng.normal(0, 0.03, (800, 3)), rng.normal(0, 0.04, (20, 3))
    turn, shift = Rotation.random(rng=rng), rng.normal(0, 1, 3)
    here = signed_gaps(centres, RADII, cloud_of(points))
    there = signed_gaps(turn.apply(centres) + shift, RADII, cloud_of(turn.apply(points) + shift))
    assert np.array_equal(here.nearest, there.nearest)
    assert np.allclose(here.gap, there.gap, atol=1e-12)
