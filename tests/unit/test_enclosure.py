"""The hand enclosing space: closed forms, invariances, degenerate cases."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from graspdb_ingest.bounding import box_volume, ellipsoid_volume, sphere_volume
from graspdb_ingest.enclosure import (
    enclosing_space,
    sphere_vertices,
)

BALL = 4 / 3 * np.pi


def test_sphere_vertices_are_unit_vectors_spread_evenly():
    vertices = sphere_vertices(64)
    assert np.allclose(np.linalg.norm(vertices, axis=1), 1)
    nearest = cKDTree(vertices).query(vertices, k=2)[0][:, 1]
    assert nearest.min() > 0.3  # 64 caps of equal area have a radius of 0.25
    assert np.linalg.norm(vertices.mean(axis=0)) < 0.02


def test_hull_of_one_sphere_nears_the_ball_from_below_as_vertices_grow():
    errors = []
    for count in (64, 256, 1024):
        volume = enclosing_space(np.zeros((1, 3)), np.array([0.01]), count).volume
        errors.append(1 - volume / (BALL * 0.01**3))
    assert errors[0] < 0.12
    assert errors[0] > errors[1] > errors[2] > 0


def test_two_spheres_enclose_a_capsule():
    centres, radius = np.array([[0, 0, 0], [0.05, 0, 0]]), 0.01
    volume = enclosing_space(centres, np.full(2, radius), 2000).volume
    assert volume == pytest.approx(BALL * radius**3 + np.pi * radius**2 * 0.05, rel=0.01)


def test_nothing_touching_encloses_nothing():
    space = enclosing_space(np.empty((0, 3)), np.empty(0), 64)
    assert space.volume == 0
    assert not space.contains(np.zeros((3, 3))).any()
    assert box_volume(space) == ellipsoid_volume(space) == sphere_volume(space) == 0


def test_spheres_without_radius_enclose_nothing_unless_they_span_a_volume():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]) * 0.05
    assert enclosing_space(corners, np.zeros(4), 64).volume == 0
    corners[3, 2] = 0.05
    assert enclosing_space(corners, np.zeros(4), 64).volume > 0


def test_faces_look_outwards_and_give_the_volume():
    rng = np.random.default_rng(1)
    space = enclosing_space(rng.normal(size=(6, 3)) * 0.04, rng.uniform(0.006, 0.013, 6), 64)
    a, b, c = (space.vertices[space.faces[:, i]] for i in range(3))
    assert np.sum(np.cross(a, b) * c) / 6 == pytest.approx(space.volume)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_volumes_and_membership_are_unchanged_by_rigid_motion(seed):
    rng = np.random.default_rng(seed)
    centres, radii = rng.normal(size=(5, 3)) * 0.04, rng.uniform(0.006, 0.013, 5)
    turn, shift = Rotation.random(random_state=rng), rng.normal(size=3)
    points = rng.normal(size=(200, 3)) * 0.04
    space = enclosing_space(centres, radii, 64)
    moved = enclosing_space(turn.apply(centres) + shift, radii, 64)
    # the sphere's vertices do not turn with the hand, so volumes agree to their resolution
    assert moved.volume == pytest.approx(space.volume, rel=0.05)
    depth = np.max(points @ space.planes[:, :3].T + space.planes[:, 3], axis=1)
    clear = np.abs(depth) > 0.002
    assert np.array_equal(moved.contains(turn.apply(points) + shift)[clear], space.contains(points)[clear])


def test_membership_agrees_with_every_face_tested_by_itself():
    rng = np.random.default_rng(2)
    space = enclosing_space(rng.normal(size=(8, 3)) * 0.03, np.full(8, 0.01), 64)
    points = rng.normal(size=(5000, 3)) * 0.04
    brute = [all(n[:3] @ p + n[3] <= 1e-9 for n in space.planes) for p in points]
    assert np.array_equal(space.contains(points), brute)


def test_bounding_bodies_of_a_ball_are_near_the_ball_and_its_cube():
    space = enclosing_space(np.zeros((1, 3)), np.array([0.01]), 400)
    assert sphere_volume(space) == pytest.approx(BALL * 0.01**3, rel=0.02)
    assert ellipsoid_volume(space) == pytest.approx(BALL * 0.01**3, rel=0.02)
    assert box_volume(space) == pytest.approx(0.02**3, rel=0.05)


def test_bounding_bodies_of_a_box_have_their_closed_forms():
    sides = np.array([0.02, 0.05, 0.09])
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T * sides
    turned = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).apply(corners)
    space = enclosing_space(turned, np.zeros(8), 64)
    assert space.volume == pytest.approx(np.prod(sides))
    assert box_volume(space) == pytest.approx(np.prod(sides), rel=1e-4)
    assert sphere_volume(space) == pytest.approx(BALL * (np.linalg.norm(sides) / 2) ** 3)
    # the least ellipsoid of a box is the ball around a cube, stretched: semi-axes sqrt(3) * side / 2
    assert ellipsoid_volume(space) == pytest.approx(BALL * np.prod(np.sqrt(3) * sides / 2), rel=1e-3)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_hull_is_the_least_of_the_bodies(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    space = enclosing_space(rng.normal(size=(count, 3)) * 0.04, rng.uniform(0.006, 0.013, count), 64)
    assert space.volume <= min(box_volume(space), ellipsoid_volume(space) * 1.001, sphere_volume(space))
