"""Smoothing: planes and spheres come back from noise, thin walls stay two."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.smooth import MOST_NEIGHBOURS, PASSES, smoothed

RADIUS, NOISE = 0.008, 0.0005


def plane(n=40, pitch=0.002):
    ticks = (np.arange(n) - n / 2) * pitch
    points = np.stack([*(a.ravel() for a in np.meshgrid(ticks, ticks)), np.zeros(n * n)], axis=1)
    return points, np.tile([0.0, 0.0, 1.0], (n * n, 1))


def sphere(n=3000, radius=0.03):
    height = 1 - (2 * np.arange(n) + 1) / n
    angle = np.arange(n) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - height**2)
    normals = np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
    return radius * normals, normals


def test_a_plane_stays():
    points, normals = plane()
    moved, turned = smoothed(points, normals, RADIUS)
    assert np.allclose(moved, points, atol=1e-12)
    assert np.allclose(turned, normals, atol=1e-9)


@pytest.mark.parametrize("surface", [plane, sphere])
def test_noise_goes(surface):
    points, normals = surface()
    noisy = points + np.random.default_rng(0).normal(size=points.shape) * NOISE
    moved, turned = smoothed(noisy, normals, RADIUS)
    inside = np.linalg.norm(points[:, :2], axis=1) < 0.03 if surface is plane else slice(None)
    height = moved[:, 2] if surface is plane else np.linalg.norm(moved, axis=1) - 0.03
    assert height[inside].std() < NOISE / 2.5
    expected = normals if surface is plane else moved / np.linalg.norm(moved, axis=1, keepdims=True)
    angles = np.degrees(np.arccos(np.clip(np.sum(turned * expected, axis=1), -1, 1)))
    assert np.mean(angles[inside]) < 3


def test_sides_of_a_thin_wall_do_not_mix():
    points, normals = plane()
    wall = np.concatenate([points, points - [0, 0, 0.0015]])
    moved, turned = smoothed(wall, np.concatenate([normals, -normals]), RADIUS)
    assert np.allclose(moved, wall, atol=1e-9)
    assert np.allclose(turned[: len(points)], normals, atol=1e-9)


def test_it_moves_with_the_cloud():
    points, normals = sphere()
    points = points + np.random.default_rng(1).normal(size=points.shape) * NOISE
    turn, shift = Rotation.random(rng=np.random.default_rng(2)), np.array([0.3, -1.0, 2.0])
    here, up = smoothed(points, normals, RADIUS)
    there, turned = smoothed(turn.apply(points) + shift, turn.apply(normals), RADIUS)
    assert np.allclose(there, turn.apply(here) + shift, atol=1e-9)
    assert np.allclose(turned, turn.apply(up), atol=1e-6)


@pytest.mark.parametrize("n", [800, 8000])  # some 14 and some 140 points within the radius
def test_points_lie_on_quadrics_through_their_nearest_neighbours(n):
    points, normals = sphere(n)
    points = points + np.random.default_rng(3).normal(size=points.shape) * NOISE
    expected, up = points, normals
    for _ in range(PASSES):
        expected, up = (np.array(a) for a in zip(*fitted(expected, up), strict=True))
    moved, turned = smoothed(points, normals, RADIUS)
    assert np.allclose(moved, expected, atol=1e-12)
    assert np.allclose(turned, up, atol=1e-9)


def fitted(points, normals):
    """Yield each point on the quadric of least squares through its neighbours, and the normal there."""
    distances, neighbours = cKDTree(points).query(points, k=MOST_NEIGHBOURS)
    for point, up, near, index in zip(points, normals, distances, neighbours, strict=True):
        own = index[near < RADIUS]
        own = own[normals[own] @ up > 0]
        axes = np.linalg.svd(up[None])[2][1:]
        arms = (points[own] - point) / RADIUS
        x, y = axes @ arms.T
        root = 1 - np.sum(arms**2, axis=1)
        terms = root * np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        stiff = np.diag([0, 0, 0, 1e-3, 5e-4, 1e-3])
        fit = np.linalg.solve(terms @ terms.T + stiff, terms @ (root * (arms @ up)))
        normal = up - fit[1:3] @ axes
        yield point + RADIUS * fit[0] * up, normal / np.linalg.norm(normal)
