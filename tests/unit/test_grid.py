"""Grids of points: no neighbour is missed, wherever points lie, and runs do not overlap."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graspdb_ingest.objects.grid import CUBES_PER_POINT, ROWS, Grid, make_grid, rows_around


def around(grid: Grid, place: np.ndarray) -> list[int]:
    rows = np.empty((ROWS, 2), np.int64)
    found = rows_around(grid, place, rows)
    return [int(grid.order[i]) for first, after in rows[:found] for i in range(first, after)]


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.floats(0.01, 3))
@settings(deadline=None)
def test_all_points_within_the_radius_are_found_once(seed: int, n: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (n, 3)) * rng.uniform(0, 1, 3)
    grid = make_grid(points, radius)
    for place in [*points[:10], *rng.uniform(-2, 2, (10, 3))]:
        found = around(grid, place)
        assert len(set(found)) == len(found)
        assert set(np.flatnonzero(np.linalg.norm(points - place, axis=1) <= radius)) <= set(found)


def test_neighbours_just_the_radius_away_are_found() -> None:
    ticks = np.arange(20) * 0.1
    points = np.stack(np.meshgrid(ticks, ticks, [0.0]), axis=-1).reshape(-1, 3)
    grid = make_grid(points, 0.1)
    for place in points:
        near = np.linalg.norm(points - place, axis=1) <= 0.1 * (1 + 1e-12)
        assert set(np.flatnonzero(near)) <= set(around(grid, place))


@pytest.mark.parametrize("extent", [1e3, 1e9])
def test_points_far_apart_take_no_more_memory(extent: float) -> None:
    points = np.random.default_rng(0).uniform(0, extent, (100, 3))
    grid = make_grid(points, 0.001)
    assert len(grid.starts) < 2 * CUBES_PER_POINT * len(points)
    assert all(i in around(grid, points[i]) for i in range(100))
