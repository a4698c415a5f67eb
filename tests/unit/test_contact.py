"""Gaps and contacts agree exactly with equations 2 and 3 evaluated for every point."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.contact import Contacts, signed_gaps
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.rigid import inverse_transform_points, transform_points
from graspdb_ingest.surface import HandPoints, key_points
from graspdb_ingest.surface.touch import pose_hand, touching
from graspdb_schemas.vocabulary import SITES, Side

RADII = np.linspace(0.013, 0.007, 20)


def cloud_of(points: np.ndarray) -> ObjectCloud:
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return ObjectCloud(points, normals, np.ones(len(points)), 0.002)


def contacts_of(sites: np.ndarray, radii: np.ndarray, threshold: float, cloud: ObjectCloud) -> Contacts:
    """Return the contacts of one frame of spheres with a bare cloud."""
    bare = Surface(cloud.points, None, None, None, None, np.ptp(cloud.points, axis=0), False, "", ())
    hand = HandPoints(key_points(np.full((1, 3), -1.0), sites[None]), radii, Side.RIGHT)
    place = ObjectDistance(bare, cloud)
    return touching(pose_hand(hand, "spheres", place).frame(0), threshold, place)


def brute_force(sites: np.ndarray, radii: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gaps and nearest points by the equations as they stand, over all points."""
    distances = np.linalg.norm(points - sites[:, :, None, :], axis=-1)
    return distances.min(axis=2) - radii, distances.argmin(axis=2)


@given(st.integers(0, 2**32 - 1), st.integers(1, 400))
@settings(max_examples=40, deadline=None)
def test_identical_to_brute_force(seed: int, n_points: int) -> None:
    rng = np.random.default_rng(seed)
    cloud = cloud_of(rng.uniform(-0.1, 0.1, (n_points, 3)))
    sites = rng.uniform(-0.15, 0.15, (5, 20, 3))
    gaps = signed_gaps(sites, RADII, cloud)
    expected, nearest = brute_force(sites, RADII, cloud.points)
    assert np.array_equal(gaps.gap, expected)
    assert np.array_equal(gaps.nearest, nearest)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_equally_near_points_give_the_lowest_index(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, grid])[rng.permutation(128)] * 0.25
    sites = rng.integers(0, 14, (3, 20, 3)) * 0.125  # on points, edges, faces and centres of the grid
    gaps = signed_gaps(sites, RADII, cloud_of(points))
    expected, nearest = brute_force(sites, RADII, points)
    assert np.array_equal(gaps.gap, expected)
    assert np.array_equal(gaps.nearest, nearest)


def test_a_ring_of_points_told_apart_by_rounding_alone() -> None:
    angles = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles), np.zeros(500)], axis=1) * 0.03
    sites = np.zeros((1, 20, 3))
    gaps = signed_gaps(sites, RADII, cloud_of(points))
    expected, nearest = brute_force(sites, RADII, points)
    assert np.array_equal(gaps.gap, expected)
    assert np.array_equal(gaps.nearest, nearest)


def test_a_sphere_over_a_plane_by_hand() -> None:
    plane = np.stack(np.meshgrid(np.arange(-20, 21), np.arange(-20, 21)), axis=-1).reshape(-1, 2) * 0.001
    cloud = cloud_of(np.pad(plane, ((0, 0), (0, 1))))
    sites = np.zeros((1, 20, 3))
    sites[0, :, 2] = np.linspace(0.0, 0.019, 20)
    gaps = signed_gaps(sites, np.full(20, 0.01), cloud)
    assert gaps.gap[0] == pytest.approx(np.linspace(-0.01, 0.009, 20))
    contacts = contacts_of(sites[0], np.full(20, 0.01), 0.004, cloud)
    assert contacts.sites.tolist() == list(range(14))
    assert contacts.positions == pytest.approx(0)
    assert contacts.normals == pytest.approx(np.tile([0.0, 0, 1], (14, 1)))
    assert contacts.gap == pytest.approx(gaps.gap[0, :14])
    assert contacts.site_names == SITES[:14]
    assert contacts.digits == ("thumb", "index", "middle", "ring")
    assert np.array_equal(cloud.points[contacts.points], contacts.positions)


def test_contact_is_strictly_below_the_threshold() -> None:
    cloud = cloud_of(np.zeros((1, 3)))
    sites = np.full((1, 20, 3), np.nan)
    sites[0, 0] = [0.5, 0, 0]
    radii = np.full(20, 0.25)
    assert contacts_of(sites[0], radii, 0.25, cloud).sites.tolist() == []
    assert contacts_of(sites[0], radii, np.nextafter(0.25, 1), cloud).sites.tolist() == [0]


def test_unknown_sites_have_no_gap_and_no_contact() -> None:
    cloud = cloud_of(np.random.default_rng(0).uniform(-0.01, 0.01, (50, 3)))
    sites = np.zeros((4, 20, 3))
    sites[1, 3:6, 1] = np.nan
    sites[2] = np.nan
    sites[3, 0] = np.inf
    gaps = signed_gaps(sites, RADII, cloud)
    unknown = ~np.isfinite(sites).all(axis=2)
    assert np.array_equal(np.isnan(gaps.gap), unknown)
    assert np.array_equal(gaps.nearest == -1, unknown)
    assert len(contacts_of(sites[0], RADII, 0.004, cloud).sites) == 20
    assert set(range(20)) - set(contacts_of(sites[1], RADII, 0.004, cloud).sites.tolist()) == {3, 4, 5}
    nothing = contacts_of(sites[2], RADII, 0.004, cloud)
    assert nothing.positions.shape == nothing.normals.shape == (0, 3)
    assert nothing.digits == ()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_moving_hand_and_object_together_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cloud = cloud_of(rng.uniform(-0.05, 0.05, (300, 3)))
    sites = rng.uniform(-0.08, 0.08, (6, 20, 3))
    rotations = Rotation.random(6, rng=rng).as_matrix()
    positions = rng.normal(size=(6, 3))
    in_lab = transform_points(rotations, positions, sites)
    gaps = signed_gaps(sites, RADII, cloud)
    again = signed_gaps(inverse_transform_points(rotations, positions, in_lab), RADII, cloud)
    assert again.gap == pytest.approx(gaps.gap, abs=1e-12)


def test_the_gap_to_a_sphere_approaches_the_true_distance() -> None:
    points, _ = trimesh.sample.sample_surface(trimesh.creation.icosphere(5, 0.05), 50_000, seed=1)
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(1, 20, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    away = np.linspace(0.052, 0.09, 20)
    gaps = signed_gaps(directions * away[:, None], RADII, cloud_of(np.array(points)))
    assert gaps.gap[0] == pytest.approx(away - 0.05 - RADII, abs=0.0005)


def test_a_trial_without_frames_has_no_gaps() -> None:
    gaps = signed_gaps(np.zeros((0, 20, 3)), RADII, cloud_of(np.eye(3)))
    assert gaps.gap.shape == gaps.nearest.shape == (0, 20)
