"""Contact maps: signed gaps of an object's points, and which way the surface faces."""

import numpy as np
import pytest

from graspdb_ingest.contact_map import FLESH_DEPTH, contact_map
from graspdb_ingest.surface import HandSurface


def ball(radius: float, *centres: tuple[float, float, float]) -> HandSurface:
    numbers = np.arange(len(centres))
    shapes = np.stack([numbers] * 3, axis=1)
    return HandSurface(
        np.array(centres), np.full(len(centres), radius), shapes, numbers, ("hand",) * len(centres)
    )


def test_a_ball_over_a_plane_by_hand() -> None:
    across = np.array([0.0, 0.003, 0.01, 0.04, 0.5])
    points = np.column_stack([across, np.zeros(5), np.zeros(5)])
    normals = np.tile([0.0, 0, 1], (5, 1))
    found = contact_map(points, normals, ball(0.01, (0, 0, 0.008)), reach=0.02)
    assert found.points.tolist() == [0, 1, 2]
    away = np.hypot(across[:3], 0.008)
    assert found.gaps == pytest.approx(away - 0.01)
    assert found.facing == pytest.approx(0.008 / away)
    assert found.pressing_gaps == pytest.approx(away - 0.01 + FLESH_DEPTH * (1 - 0.008 / away))


def test_the_far_side_of_a_thin_wall_is_near_but_does_not_face_the_hand() -> None:
    points, normals = np.array([[0, 0, 0], [0, 0, -0.001]]), np.array([[0, 0, 1.0], [0, 0, -1.0]])
    found = contact_map(points, normals, ball(0.01, (0, 0, 0.01)), reach=0.02)
    assert found.gaps == pytest.approx([0.0, 0.001])
    assert found.facing == pytest.approx([1, -1])
    assert found.pressing_gaps == pytest.approx([0.0, 0.001 + 2 * FLESH_DEPTH])


def test_reach_bounds_the_map_and_leaves_no_point_out() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.1, 0.1, (4000, 3))
    hand = ball(0.01, (0, 0, 0), (0.03, 0, 0), (0, 0.05, 0.01))
    everywhere = contact_map(points, points, hand, reach=np.inf)
    assert everywhere.points.tolist() == list(range(4000))
    for reach in (0.0, 0.02, 0.05):
        found = contact_map(points, points, hand, reach)
        assert np.array_equal(found.points, np.flatnonzero(everywhere.gaps <= reach))


def test_a_hand_that_is_not_known_or_far_away_has_an_empty_map() -> None:
    points = np.zeros((3, 3))
    assert len(contact_map(points, points, ball(0.01, (np.nan, 0, 0)), 0.02).points) == 0
    assert len(contact_map(points, points, ball(0.01, (1.0, 0, 0)), 0.02).points) == 0
