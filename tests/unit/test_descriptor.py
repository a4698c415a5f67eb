"""Descriptors: pose does not matter, size does, distributions with one mean are told apart."""

from itertools import combinations, product

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import norm, qmc

from graspdb_ingest.descriptor import BANDWIDTH, LENGTH, N_FOURIER, PAIR_BINS, PAIR_DISTANCES, describe


def sphere(n, radius):
    height = 1 - (2 * np.arange(n) + 1) / n
    angle = np.arange(n) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - height**2)
    normals = np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
    return radius * normals, normals, np.full(n, 4 * np.pi * radius**2 / n)


def histograms(n, seed=0):
    return np.random.default_rng(seed).uniform(0, 20, (n, 33)).astype(np.float32)


def test_pose_does_not_matter():
    points, normals, areas = sphere(500, 0.03)
    turn, shift = Rotation.random(rng=np.random.default_rng(1)), np.array([1.0, 2.0, -0.5])
    here = describe(points, normals, histograms(500), areas)
    there = describe(turn.apply(points) + shift, turn.apply(normals), histograms(500), areas)
    assert here.shape == (LENGTH,)
    assert here.dtype == np.float32
    assert np.allclose(here, there, atol=1e-5)


def test_size_matters_in_the_pairs_alone():
    small = describe(*sphere(400, 0.02)[:2], histograms(400), np.ones(400))
    large = describe(*sphere(400, 0.04)[:2], histograms(400), np.ones(400))
    assert np.array_equal(small[:N_FOURIER], large[:N_FOURIER])
    assert np.linalg.norm(small[N_FOURIER:] - large[N_FOURIER:]) > 0.3


def test_density_does_not_matter():
    dense, sparse = sphere(1000, 0.03), sphere(250, 0.03)
    one = np.full((1, 33), 5, np.float32)
    first = describe(*dense[:2], np.repeat(one, 1000, axis=0), dense[2])
    second = describe(*sparse[:2], np.repeat(one, 250, axis=0), sparse[2])
    assert np.linalg.norm(first - second) < 0.1


def test_distributions_with_one_mean_are_told_apart():
    points, normals, areas = sphere(400, 0.03)
    low, high = np.zeros(33, np.float32), np.zeros(33, np.float32)
    low[:11], high[11:22] = 1, 1
    mixed = np.tile((low + high) / 2, (400, 1))
    split = np.where(np.arange(400)[:, None] % 2, 2 * low, 2 * high).astype(np.float32)
    assert np.allclose(mixed.mean(axis=0), split.mean(axis=0) / 2)
    apart = describe(points, normals, mixed, areas) - describe(points, normals, split, areas)
    assert np.linalg.norm(apart[:N_FOURIER]) > 0.3


def test_fourier_features_are_those_of_a_gaussian_kernel():
    rng = np.random.default_rng(3)
    first = rng.uniform(0.5, 1, (60, 33)).astype(np.float32)
    second = (first * rng.uniform(0.9, 1.1, first.shape)).astype(np.float32)
    point, up, one = np.zeros((1, 3)), np.eye(3)[:1], np.ones(1)
    for a, b in zip(first, second, strict=True):
        ours = describe(point, up, a[None], one)[:N_FOURIER] @ describe(point, up, b[None], one)[:N_FOURIER]
        roots = [np.sqrt(h.astype(float) / h.sum()) for h in (a, b)]
        kernel = np.exp(-np.sum((roots[0] - roots[1]) ** 2) / (2 * BANDWIDTH**2))
        assert abs(ours - kernel) < 0.15
    assert norm.ppf(qmc.Sobol(34, scramble=False).random(256)[1:129]).std() > 0.9


def test_a_single_point_has_no_pairs():
    found = describe(np.zeros((1, 3)), np.eye(3)[:1], histograms(1), np.ones(1))
    assert not found[N_FOURIER:].any()
    assert np.isfinite(found).all()


def pairs_one_by_one(points, normals, areas):
    """Share every pair among the eight cells around it, as the definition says."""
    cells = np.zeros(PAIR_BINS)
    ranges = (np.sqrt(PAIR_DISTANCES), (-1, 1), (-2, 2))
    for i, j in combinations(range(len(points)), 2):
        step = points[j] - points[i]
        distance = np.linalg.norm(step)
        values = (np.sqrt(distance), normals[i] @ normals[j], (normals[j] - normals[i]) @ step / distance)
        places = [
            np.clip((v - low) / (high - low) * (bins - 1), 0, bins - 1)
            for v, (low, high), bins in zip(values, ranges, PAIR_BINS, strict=True)
        ]
        for cell in product(*(range(bins) for bins in PAIR_BINS)):
            shares = [max(0.0, 1 - abs(place - c)) for place, c in zip(places, cell, strict=True)]
            cells[cell] += areas[i] * areas[j] * np.prod(shares)
    return np.sqrt(cells / cells.sum()).ravel()


def test_pairs_are_those_of_the_definition():
    rng = np.random.default_rng(5)
    points, areas = rng.normal(size=(12, 3)) * 0.03, rng.uniform(1, 2, 12)
    normals = rng.normal(size=(12, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = describe(points, normals, histograms(12), areas)[N_FOURIER:]
    np.testing.assert_allclose(found, pairs_one_by_one(points, normals, areas), rtol=0, atol=1e-6)
