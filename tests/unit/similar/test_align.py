"""Alignment: a moved part comes back, whatever the pose; distances are those of brute force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from graspdb_queries.similar import threads as pool
from graspdb_queries.similar.align import align, held_poses
from graspdb_queries.similar.chamfer import TILT, chamfer
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.verdict import lay

NOWHERE = np.full((4, 4), np.nan)


def bent_strip(seed=0, n=600, sizes=(0.05, 0.03)):
    """Return a part without symmetry: a strip that curves more and more."""
    rng = np.random.default_rng(seed)
    x, y = (rng.uniform(0, size, n) for size in sizes)
    points = np.stack([x, y, 8 * x**2 + 3 * x * y - 4 * y**2], axis=1)
    normals = np.stack([-16 * x - 3 * y, -3 * x + 8 * y, np.ones(n)], axis=1)
    histograms = np.abs(np.sin(np.outer(x, np.arange(33)) * 60)).astype(np.float32)
    return Part(
        f"strip {seed}", points, normals / np.linalg.norm(normals, axis=1)[:, None], histograms, NOWHERE
    )


def moved(part, turn, shift, name="moved"):
    hand = np.eye(4)
    hand[:3, :3], hand[:3, 3] = turn.as_matrix(), shift
    pose = hand @ part.object_from_hand if part.has_hand else NOWHERE
    return Part(name, turn.apply(part.points) + shift, turn.apply(part.normals), part.histograms, pose)


@pytest.mark.parametrize("seed", range(5))
def test_a_moved_part_comes_back(seed):
    part = bent_strip()
    turn, shift = Rotation.random(rng=np.random.default_rng(seed)), np.array([0.4, -1.0, 2.0])
    poses = align(part, [moved(part, turn, shift)])
    assert np.allclose(poses.rotations[0], turn.as_matrix(), atol=1e-3)
    back = part.points @ poses.rotations[0].T + poses.positions[0]
    assert np.abs(back - turn.apply(part.points) - shift).max() < 1e-4


def test_another_sample_of_the_same_surface_lies_within_its_spacing():
    part, other = bent_strip(0), bent_strip(1)
    turn, shift = Rotation.random(rng=np.random.default_rng(3)), np.array([0.1, 0.0, -0.2])
    poses = align(part, [moved(other, turn, shift)])
    apart = chamfer(part, moved(other, turn, shift), poses.rotations[0], poses.positions[0])
    assert apart.trimmed < apart.symmetric < 0.002


@pytest.mark.parametrize("angle", [0.1, 1.0, np.pi])
def test_surfaces_that_face_elsewhere_are_apart_where_their_points_are_not(angle):
    part = bent_strip()
    across = np.cross(part.normals, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    turned = Rotation.from_rotvec(angle * across).apply(part.normals)
    other = replace(part, normals=turned)
    apart = chamfer(part, other, np.eye(3), np.zeros(3))
    assert apart.trimmed == apart.symmetric == 0
    assert apart.surface == pytest.approx(TILT * 2 * np.sin(angle / 2))
    either = chamfer(part, replace(other, oriented=False), np.eye(3), np.zeros(3))
    assert either.surface == pytest.approx(TILT * 2 * np.sin(min(angle, np.pi - angle) / 2), abs=1e-9)


def test_chamfer_is_that_of_all_pairs():
    first, second = bent_strip(0, 300), bent_strip(1, 250)
    turn, shift = Rotation.random(rng=np.random.default_rng(1)), np.array([0.01, 0.0, 0.02])
    apart = cdist(turn.apply(first.points) + shift, second.points)
    found = chamfer(first, second, turn.as_matrix(), shift)
    assert found.one_way == pytest.approx(apart.min(axis=1).mean())
    assert found.symmetric == pytest.approx((apart.min(axis=1).mean() + apart.min(axis=0).mean()) / 2)
    kept = [np.sort(apart.min(axis=axis)) for axis in (0, 1)]
    assert found.trimmed == pytest.approx(np.mean([k[: int(np.ceil(0.7 * len(k)))].mean() for k in kept]))


def test_a_part_of_a_part_is_all_there():
    whole = bent_strip(n=1200)
    inside = whole.points[:, 0] < 0.025
    part = Part("half", whole.points[inside], whole.normals[inside], whole.histograms[inside], NOWHERE)
    laid = lay(part, [whole], "shape")[whole.name].apart
    assert laid.one_way < 0.5 * laid.symmetric


def test_held_poses_lay_hand_on_hand():
    rng = np.random.default_rng(5)
    part = bent_strip()
    hand = np.eye(4)
    hand[:3, :3], hand[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    part = Part(part.name, part.points, part.normals, part.histograms, hand)
    other = moved(part, Rotation.random(rng=rng), rng.normal(size=3))
    pose = held_poses(part, [other]).matrices()[0]
    assert np.allclose(pose @ part.object_from_hand, other.object_from_hand)
    assert lay(part, [other], "held")["moved"].apart.symmetric < 1e-12


def test_groups_and_threads_do_not_matter(monkeypatch):
    part = bent_strip()
    others = [moved(bent_strip(i, 500 + i), Rotation.identity(), np.zeros(3), str(i)) for i in range(45)]
    answers = []
    for threads in (1, 4):
        monkeypatch.setattr(pool.os, "cpu_count", lambda threads=threads: threads)
        answers.append(lay(part, others, "shape"))
    assert answers[0].keys() == answers[1].keys()
    for name, laid in answers[0].items():
        assert np.array_equal(laid.pose, answers[1][name].pose)
        assert laid.apart == answers[1][name].apart


def test_few_points_are_aligned_too():
    part = bent_strip()
    few = Part("few", part.points[:4], part.normals[:4], part.histograms[:4], NOWHERE)
    laid = lay(few, [part, few], "shape")
    assert np.isfinite(laid[part.name].apart.symmetric)
    assert laid["few"].apart.symmetric < 1e-6
