"""Simulated objects: closed surfaces, exact distances, markers on the surface."""

import numpy as np
import pytest

from graspdb.simulate.objects import OBJECTS, make_inverted_t
from graspdb.simulate.shapes import box, loft, revolve, rounded, subdivided
from graspdb.simulate.surface import Surface

MAKERS = {**OBJECTS, "inverted_t": make_inverted_t}


@pytest.fixture(params=sorted(MAKERS))
def body(request):
    return MAKERS[request.param](np.random.default_rng(5))


def test_every_part_is_closed_and_faces_outwards(body):
    for part in body.parts:
        assert part.is_watertight
        assert part.is_winding_consistent
        assert part.volume > 0
    assert body.mesh.is_watertight


def test_object_stands_on_the_table_and_has_a_size_for_a_hand(body):
    low, high = body.mesh.bounds
    assert low[2] == pytest.approx(0, abs=1e-4)
    assert (high - low).max() < 0.25


def test_markers_lie_on_the_surface_and_are_not_in_line(body):
    assert body.markers.shape == (4, 3)
    assert np.abs(body.surface.distance(body.markers)).max() < 1e-6
    spread = np.linalg.svd(body.markers - body.markers.mean(axis=0), compute_uv=False)
    assert spread[1] > 0.02


def test_sizes_vary_with_the_seed_and_only_with_it():
    for make in MAKERS.values():
        first, again, other = (make(np.random.default_rng(seed)) for seed in (1, 1, 2))
        assert np.array_equal(first.mesh.vertices, again.mesh.vertices)
        assert not np.array_equal(first.mesh.vertices, other.mesh.vertices)


def test_signed_distance_to_a_box_is_the_closed_form():
    half = np.array([0.03, 0.02, 0.01])
    surface = Surface((box(-half, half),))
    points = np.random.default_rng(0).uniform(-0.06, 0.06, (400, 3))
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    expected = outside + np.minimum(beyond.max(axis=1), 0)
    assert surface.distance(points) == pytest.approx(expected, abs=1e-6)


def test_the_normal_points_the_way_in_which_the_distance_grows():
    body = MAKERS["mug"](np.random.default_rng(3))
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.05, -0.05, 0.01], [0.09, 0.05, 0.11], (300, 3))
    near = body.surface.nearest(points)
    clear = np.abs(near.distance) > 1e-3
    step = 1e-4
    moved = body.surface.distance(points + step * near.normal)
    grown = (moved - near.distance)[clear] / step
    assert np.median(grown) == pytest.approx(1, abs=0.01)
    assert np.linalg.norm(points - near.point, axis=1)[clear] == pytest.approx(
        np.abs(near.distance)[clear], abs=1e-6
    )


def test_two_parts_have_the_least_of_their_distances():
    near, far = box([0, 0, 0], [0.01, 0.01, 0.01]), box([0.05, 0, 0], [0.06, 0.01, 0.01])
    points = np.random.default_rng(2).uniform(-0.02, 0.08, (200, 3))
    each = [Surface((part,)).distance(points) for part in (near, far)]
    assert np.array_equal(Surface((near, far)).distance(points), np.minimum(*each))


def test_a_revolved_rectangle_is_a_cylinder():
    profile = np.array([[1e-6, 0.0], [0.03, 0.0], [0.03, 0.1], [1e-6, 0.1]])
    n = 360
    polygon = 0.5 * n * 0.03**2 * np.sin(2 * np.pi / n)
    assert revolve(profile, n).volume == pytest.approx(0.1 * polygon, rel=1e-6)


def test_a_loft_of_either_direction_faces_outwards():
    angle = 2 * np.pi * np.arange(12) / 12
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    rings = np.array([ring, np.add(ring, [0, 0, 1.0])])
    assert loft(rings).volume == pytest.approx(loft(rings[::-1]).volume)


def test_a_rounded_corner_is_an_arc_that_touches_both_legs():
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]])
    line = rounded(corners, [0.02], step=1.0)
    arc = line[1:-1]
    assert np.linalg.norm(arc - [0.08, 0.02], axis=1) == pytest.approx(0.02)
    assert arc[0] == pytest.approx([0.08, 0.0])
    assert arc[-1] == pytest.approx([0.1, 0.02])


def test_subdividing_keeps_ends_and_length():
    points = np.array([[0.0, 0.0], [0.05, 0.02], [0.05, 0.1]])
    fine = subdivided(points, 0.007)
    steps = np.linalg.norm(np.diff(fine, axis=0), axis=1)
    assert steps.max() <= 0.007 + 1e-12
    assert steps.sum() == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
