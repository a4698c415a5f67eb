"""Rigid transforms: equation 1, its inverse, quaternions and the weighted fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.rigid import (
    continuous_signs,
    fit_rigid,
    inverse_transform_points,
    quaternions_from_rotations,
    rotations_from_quaternions,
    transform_points,
)

seeds = st.integers(0, 2**32 - 1)


def random_rotations(rng: np.random.Generator, n: int) -> np.ndarray:
    return Rotation.random(n, rng=rng).as_matrix()


def test_equation_1_by_hand() -> None:
    quarter_turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = transform_points(quarter_turn, np.array([10.0, 20, 30]), np.array([[1.0, 2, 3]]))
    assert moved == pytest.approx(np.array([[8.0, 21, 33]]))


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_inverse_undoes_the_transform_in_every_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations, positions = random_rotations(rng, 4), rng.normal(size=(4, 3))
    points = rng.normal(size=(4, 6, 3))
    moved = transform_points(rotations, positions, points)
    for frame in range(4):
        for point in range(6):
            by_hand = rotations[frame] @ points[frame, point] + positions[frame]
            assert moved[frame, point] == pytest.approx(by_hand)
    assert inverse_transform_points(rotations, positions, moved) == pytest.approx(points)


def test_quaternions_are_scalar_first_and_keep_nan() -> None:
    half_turn_about_y = np.diag([-1.0, 1, -1])
    unknown = np.full((3, 3), np.nan)
    quaternions = quaternions_from_rotations(np.stack([np.eye(3), unknown, half_turn_about_y]))
    assert quaternions[0] == pytest.approx([1, 0, 0, 0])
    assert np.isnan(quaternions[1]).all()
    assert np.abs(quaternions[2]) == pytest.approx([0, 0, 1, 0])
    back = rotations_from_quaternions(quaternions)
    assert back[2] == pytest.approx(half_turn_about_y)
    assert np.isnan(back[1]).all()


def test_signs_follow_a_turning_body_over_gaps() -> None:
    angles = np.linspace(0, 6 * np.pi, 200)
    quaternions = quaternions_from_rotations(Rotation.from_rotvec(np.outer(angles, [0, 0, 1])).as_matrix())
    quaternions[50:55] = np.nan
    assert (np.sum(quaternions[1:] * quaternions[:-1], axis=1) < -0.5).any()
    continuous = continuous_signs(quaternions)
    known = np.isfinite(continuous).all(axis=1)
    path = continuous[known]
    assert (np.sum(path[1:] * path[:-1], axis=1) > 0.9).all()
    assert np.array_equal(known, np.isfinite(quaternions).all(axis=1))
    assert np.abs(continuous[known]) == pytest.approx(np.abs(quaternions[known]))


@given(seeds, st.integers(3, 8))
@settings(max_examples=60, deadline=None)
def test_fit_recovers_the_transform_whatever_the_order(seed: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(m, 3))
    rotations, positions = random_rotations(rng, 3), rng.normal(size=(3, 3))
    target = transform_points(rotations, positions, source)
    order = rng.permutation(m)
    weights = rng.uniform(0.5, 2, size=(3, m))
    for fit in (
        fit_rigid(source, target, weights),
        fit_rigid(source[order], target[:, order], weights[:, order]),
    ):
        assert fit.rotations == pytest.approx(rotations, abs=1e-6)
        assert fit.positions == pytest.approx(positions, abs=1e-6)
        assert fit.distances == pytest.approx(0, abs=1e-6)


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_fit_agrees_with_the_library_and_never_reflects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target = rng.normal(size=(5, 3)), rng.normal(size=(1, 5, 3))
    weights = rng.uniform(0.1, 1, size=(1, 5))
    fit = fit_rigid(source, target, weights)
    assert np.linalg.det(fit.rotations[0]) == pytest.approx(1)
    share = weights[0] / weights[0].sum()
    expected, _ = Rotation.align_vectors(target[0] - share @ target[0], source - share @ source, share)
    assert fit.rotations[0] == pytest.approx(expected.as_matrix(), abs=1e-6)


def test_mirrored_points_are_fitted_by_a_rotation() -> None:
    source = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    fit = fit_rigid(source, source[None] * [1, 1, -1], np.ones((1, 4)))
    assert np.linalg.det(fit.rotations[0]) == pytest.approx(1)
    assert fit.distances.max() > 0.1


def test_weight_zero_is_the_same_as_not_there() -> None:
    rng = np.random.default_rng(4)
    source, target = rng.normal(size=(5, 3)), rng.normal(size=(1, 5, 3))
    missing = target.copy()
    missing[0, 2] = np.nan
    with_gap = fit_rigid(source, missing, np.array([[1.0, 1, 0, 1, 1]]))
    without = fit_rigid(np.delete(source, 2, 0), np.delete(target, 2, 1), np.ones((1, 4)))
    assert with_gap.rotations == pytest.approx(without.rotations)
    assert with_gap.positions == pytest.approx(without.positions)


@pytest.mark.parametrize("n_seen", [0, 1, 2])
def test_fewer_than_three_points_fix_nothing(n_seen: int) -> None:
    source = np.eye(3)
    weights = (np.arange(3) < n_seen).astype(float)[None]
    fit = fit_rigid(source, source[None], weights)
    assert np.isnan(fit.rotations).all()
    assert np.isnan(fit.positions).all()


def test_points_on_a_line_fix_no_rotation() -> None:
    direction = np.array([0.3, -0.2, 0.9])
    source = np.array([0.0, 0.1, 0.25, 0.4])[:, None] * direction + [1, 2, 3]
    fit = fit_rigid(source, source[None], np.ones((1, 4)))
    assert np.isnan(fit.rotations).all()
