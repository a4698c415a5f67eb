"""Grasp quality: hand-computed cases, brute force over directions, invariances, degenerate contacts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.mechanics import Mechanics
from graspdb_ingest.quality import grasp_quality
from graspdb_ingest.wrench import contact_frames, grasp_matrix, primitive_wrenches, wrench_space

EDGES = 8


def mechanics(friction=0.5, center=(0, 0, 0), radius=0.04):
    return Mechanics(friction, True, np.array(center, dtype=float), "manifest", radius)


def on_sphere(directions, radius=0.04):
    """Return contacts pressed straight at a sphere about the origin, and their outward normals."""
    normals = np.array(directions, dtype=float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return radius * normals, normals


def at_angles(degrees):
    angle = np.deg2rad(degrees)
    return on_sphere(np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))]))


def on_box(sides, places):
    """Return contacts in the middle of faces of a box, moved along the face by a share of its half sides."""
    half = np.array(sides) / 2
    positions, normals = [], []
    for axis, sign, shift in places:
        normal = sign * np.eye(3)[axis]
        positions.append(half * (normal + np.array(shift) * (normal == 0)))
        normals.append(normal)
    return np.array(positions), np.array(normals)


def random_grasp(seed, count):
    rng = np.random.default_rng(seed)
    positions = 0.04 * rng.normal(size=(count, 3))
    normals = positions + 0.02 * rng.normal(size=(count, 3))
    return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def wrenches_of(positions, normals, friction=0.5, radius=0.04, edges=EDGES):
    return primitive_wrenches(grasp_matrix(positions, normals, np.zeros(3), radius), friction, edges)


def test_cross_polytope_has_its_closed_forms():
    wrenches = np.concatenate([np.eye(6), -np.eye(6)])
    space = wrench_space(wrenches)
    assert space.epsilon == pytest.approx(1 / np.sqrt(6))
    assert space.volume == pytest.approx(2**6 / 720)


def test_cube_has_its_closed_forms():
    wrenches = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 6), axis=-1).reshape(-1, 6)
    space = wrench_space(wrenches)
    assert space.epsilon == pytest.approx(1)
    assert space.volume == pytest.approx(64)


def test_a_hull_moved_off_the_origin_closes_nothing():
    wrenches = np.concatenate([np.eye(6), -np.eye(6)]) + np.array([1.01, 0, 0, 0, 0, 0])
    space = wrench_space(wrenches)
    assert space.epsilon == 0
    assert not space.force_closure
    assert space.volume >= 2**6 / 720 - 1e-9


@pytest.mark.parametrize("friction", [0.0, 0.5, 2.0])
def test_two_opposed_hard_points_do_not_resist_the_torque_about_their_line(friction):
    quality = grasp_quality(*at_angles([0, 180]), mechanics(friction), EDGES)
    assert not quality.force_closure
    assert quality.epsilon == quality.wrench_volume == quality.isotropy == quality.least_singular_value == 0


def test_the_grasp_matrix_of_two_opposed_contacts_has_its_hand_computed_singular_values():
    # Both push along x; along y and z forces add up or turn: radius r at lever r gives a torque of 1.
    singular = np.linalg.svd(grasp_matrix(*at_angles([0, 180]), np.zeros(3), 0.04), compute_uv=False)
    assert singular == pytest.approx([np.sqrt(2)] * 5 + [0], abs=1e-12)


def test_three_contacts_at_120_degrees_close_with_friction_and_not_without():
    contacts = at_angles([0, 120, 240])
    assert not grasp_quality(*contacts, mechanics(0.0), EDGES).force_closure
    quality = grasp_quality(*contacts, mechanics(0.5), EDGES)
    assert quality.force_closure
    # A force along z, and a torque about it, are resisted by friction alone: neither by more than 0.5.
    assert 0 < quality.epsilon <= 0.5
    # G G' is diagonal: forces 3, torques about x and y 1.5 each, about z 3.
    assert quality.least_singular_value == pytest.approx(np.sqrt(1.5))
    assert quality.isotropy == pytest.approx(np.sqrt(0.5))


def test_three_contacts_on_one_side_close_nothing():
    assert not grasp_quality(*at_angles([0, 20, 40]), mechanics(0.5), EDGES).force_closure


def test_a_box_pressed_in_the_middle_of_all_faces():
    places = [(axis, sign, (0, 0, 0)) for axis in range(3) for sign in (-1, 1)]
    contacts = on_box([0.04, 0.04, 0.04], places)
    pushing = grasp_quality(*contacts, mechanics(0.0, radius=0.02), EDGES)
    assert not pushing.force_closure  # without friction no torque is resisted
    friction = 0.5
    quality = grasp_quality(*contacts, mechanics(friction, radius=0.02), EDGES)
    assert quality.force_closure
    # G G' is diagonal: each force has one pair of normals and two of tangents, each torque two of tangents.
    assert quality.isotropy == pytest.approx(np.sqrt(4 / 6))
    # A torque about (1, 1, 1) has the shortest levers: sqrt(2 / 3) on every face.
    assert quality.epsilon <= friction * np.sqrt(2 / 3) + 1e-12


def test_a_box_gripped_from_two_faces_closes_if_the_contacts_are_apart():
    pairs = [
        (0, sign, (0, across, along)) for sign in (-1, 1) for across in (-0.5, 0.5) for along in (-0.5, 0.5)
    ]
    wide = grasp_quality(*on_box([0.04, 0.06, 0.1], pairs), mechanics(), EDGES)
    assert wide.force_closure
    line = [(0, sign, (0, 0, along)) for sign in (-1, 1) for along in (-0.5, 0.5)]
    assert grasp_quality(*on_box([0.04, 0.06, 0.1], line), mechanics(), EDGES).force_closure
    one_side = [place for place in pairs if place[1] == 1]
    assert not grasp_quality(*on_box([0.04, 0.06, 0.1], one_side), mechanics(), EDGES).force_closure


def test_frictionless_contacts_that_lock_a_box():
    # Twelve pushes, two on each face and off its middle in opposite ways, resist every torque.
    shifts = {0: (0, 0.5, 0), 1: (0, 0, 0.5), 2: (0.5, 0, 0)}
    places = [
        (axis, sign, tuple(way * np.array(shifts[axis])))
        for axis in range(3)
        for sign in (-1, 1)
        for way in (-1, 1)
    ]
    contacts = on_box([0.08, 0.08, 0.08], places)
    space = wrench_space(wrenches_of(*contacts, friction=0.0, radius=0.02))
    # Lever over radius is 1: for each axis the corners (+-1, +-1) of a square in a plane of its own.
    assert space.epsilon == pytest.approx(1 / np.sqrt(3))


@pytest.mark.parametrize(("seed", "count"), [(0, 4), (1, 5), (2, 7), (3, 9), (4, 12)])
def test_epsilon_is_that_of_all_facets(seed, count):
    wrenches = wrenches_of(*random_grasp(seed, count))
    offsets = ConvexHull(wrenches).equations[:, -1]
    assert wrench_space(wrenches).epsilon == pytest.approx(max(0.0, -offsets.max()), abs=1e-9)


def test_epsilon_is_the_least_support_over_all_directions():
    wrenches = wrenches_of(*random_grasp(3, 6), friction=1.0)
    epsilon = wrench_space(wrenches).epsilon
    assert epsilon > 0
    rng = np.random.default_rng(0)

    def support(direction):
        return float(np.max(wrenches @ direction) / np.linalg.norm(direction))

    starts = rng.normal(size=(4000, 6))
    values = np.max(starts @ wrenches.T, axis=1) / np.linalg.norm(starts, axis=1)
    assert values.min() >= epsilon - 1e-8
    best = min(
        minimize(
            support,
            starts[i],
            method="Nelder-Mead",
            options={"maxiter": 4000, "xatol": 1e-10, "fatol": 1e-12},
        ).fun
        for i in np.argsort(values)[:6]
    )
    assert epsilon - 1e-8 <= best <= epsilon * 1.05


def test_more_edges_claim_more_and_never_more_than_the_round_cone():
    contacts = random_grasp(5, 6)
    epsilons = [wrench_space(wrenches_of(*contacts, edges=edges)).epsilon for edges in (4, 8, 16, 32)]
    assert epsilons == sorted(epsilons)
    assert epsilons[2] > 0.95 * epsilons[3]


@given(seed=st.integers(0, 10_000), scale=st.floats(0.2, 5))
def test_quality_is_unchanged_by_rigid_motion_size_and_order(seed, scale):
    positions, normals = random_grasp(seed, 5)
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(rng=rng), rng.normal(size=3)
    here = grasp_quality(positions, normals, mechanics(1.0), EDGES)
    order = rng.permutation(5)
    there = grasp_quality(
        turn.apply(scale * positions[order]) + shift,
        turn.apply(normals[order]),
        mechanics(1.0, shift, 0.04 * scale),
        EDGES,
    )
    assert there.isotropy == pytest.approx(here.isotropy, rel=1e-6)
    assert there.force_closure == here.force_closure
    assert there.epsilon == pytest.approx(here.epsilon, abs=1e-6)
    assert there.wrench_volume == pytest.approx(here.wrench_volume, rel=1e-6)


def test_more_friction_is_never_worse():
    contacts = random_grasp(6, 5)
    qualities = [grasp_quality(*contacts, mechanics(friction), EDGES) for friction in (0.2, 0.5, 1.0)]
    assert [q.epsilon for q in qualities] == sorted(q.epsilon for q in qualities)
    assert [q.wrench_volume for q in qualities] == sorted(q.wrench_volume for q in qualities)


def test_contact_frames_are_right_handed_and_point_inwards():
    positions, normals = random_grasp(7, 50)
    frames = contact_frames(positions, normals, np.zeros(3))
    assert np.allclose(frames @ np.swapaxes(frames, 1, 2), np.eye(3))
    assert np.allclose(np.linalg.det(frames), 1)
    assert np.allclose(frames[:, 0], -normals)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_contacts_close_nothing(count):
    positions, normals = at_angles([0, 120, 240])
    quality = grasp_quality(positions[:count], normals[:count], mechanics(), EDGES)
    assert (quality.force_closure, quality.epsilon, quality.isotropy) == (False, 0.0, 0.0)


def test_contacts_at_one_place_or_on_one_line_close_nothing():
    positions, normals = at_angles([0, 180])
    twice = grasp_quality(np.repeat(positions, 3, axis=0), np.repeat(normals, 3, axis=0), mechanics(), EDGES)
    assert not twice.force_closure
    line = np.array([[0.01 * i, 0, 0] for i in range(4)])
    ways = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    assert not grasp_quality(line, ways, mechanics(), EDGES).force_closure


def test_a_contact_that_is_not_a_number_is_left_out():
    positions, normals = at_angles([0, 120, 240])
    whole = grasp_quality(positions, normals, mechanics(), EDGES)
    broken = np.vstack([positions, [np.nan] * 3]), np.vstack([normals, [0, 0, 1]])
    assert grasp_quality(*broken, mechanics(), EDGES) == whole
    assert not grasp_quality(np.full((3, 3), np.nan), normals, mechanics(), EDGES).force_closure
