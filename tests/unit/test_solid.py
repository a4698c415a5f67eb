"""How much of an object lies inside a hull: closed forms, counting points, meshes that bound no body."""

import pickle

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from graspdb_ingest.enclosure import enclosing_space
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.solid import Inside, Solid


def solid(mesh, watertight=True):
    surface = Surface(
        np.array(mesh.vertices), np.array(mesh.faces), None, 1.0, 1.0, np.ones(3), watertight, "", ()
    )
    return Solid(surface)


def box_hull(low, high):
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    space = enclosing_space(corners, np.zeros(8), 1)
    return space.vertices, space.faces


def test_a_corner_of_a_box():
    found = solid(trimesh.creation.box([0.1, 0.1, 0.1])).inside(*box_hull([0.02, 0.01, 0.03], [0.2] * 3))
    assert found.volume == pytest.approx(0.03 * 0.04 * 0.02)
    assert found.area == pytest.approx(0.03 * 0.04 + 0.03 * 0.02 + 0.04 * 0.02)


def test_an_object_all_inside_and_one_all_outside_the_hull():
    ball = trimesh.creation.icosphere(3, 0.02)
    whole = solid(ball).inside(*box_hull([-0.1] * 3, [0.1] * 3))
    assert whole.volume == pytest.approx(ball.volume)
    assert whole.area == pytest.approx(ball.area)
    assert solid(ball).inside(*box_hull([0.05] * 3, [0.1] * 3)) == Inside(0.0, 0.0)
    assert solid(ball).inside(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)) == Inside(0.0, 0.0)


def test_a_hull_all_inside_the_object_has_its_own_volume_and_no_surface():
    found = solid(trimesh.creation.box([0.1] * 3)).inside(*box_hull([-0.01] * 3, [0.02] * 3))
    assert found.volume == pytest.approx(0.03**3)
    assert found.area == 0


def test_it_agrees_with_counting_points_and_turns_with_both():
    rng = np.random.default_rng(0)
    mesh = trimesh.creation.torus(0.03, 0.008)
    space = enclosing_space(rng.normal(size=(4, 3)) * 0.02, np.full(4, 0.012), 64)
    found = solid(mesh).inside(space.vertices, space.faces)
    points = rng.uniform(-0.04, 0.04, size=(200_000, 3))
    ring = points[:, :2] * (0.03 / np.linalg.norm(points[:, :2], axis=1))[:, None]
    in_torus = np.linalg.norm(points - np.column_stack([ring, np.zeros(len(ring))]), axis=1) < 0.008
    counted = np.mean(in_torus & space.contains(points)) * 0.08**3
    assert found.volume == pytest.approx(counted, rel=0.04)
    turn = Rotation.random(rng=rng)
    moved = trimesh.Trimesh(turn.apply(mesh.vertices) + 0.3, mesh.faces, process=False)
    there = solid(moved).inside(turn.apply(space.vertices) + 0.3, space.faces)
    assert there.volume == pytest.approx(found.volume, rel=1e-6)
    assert there.area == pytest.approx(found.area, rel=1e-6)


def test_parts_that_run_into_each_other_are_counted_once_and_a_hollow_not_at_all():
    left, right = (trimesh.creation.box([0.1, 0.02, 0.02]) for _ in range(2))
    right.apply_translation([0.05, 0, 0])
    both = trimesh.util.concatenate([left, right])
    everything = box_hull([-1] * 3, [1] * 3)
    assert solid(both).inside(*everything).volume == pytest.approx(0.15 * 0.02**2)
    inner = trimesh.creation.box([0.08] * 3)
    inner.invert()
    hollow = trimesh.util.concatenate([trimesh.creation.box([0.1] * 3), inner])
    assert solid(hollow).inside(*everything).volume == pytest.approx(0.1**3 - 0.08**3)


def test_an_open_mesh_bounds_no_body():
    assert (
        solid(trimesh.creation.box([0.1] * 3), watertight=False).inside(*box_hull([0] * 3, [1] * 3)) is None
    )


def test_a_solid_goes_to_other_processes():
    one = solid(trimesh.creation.box([0.1] * 3))
    hull = box_hull([0] * 3, [1] * 3)
    assert pickle.loads(pickle.dumps(one)).inside(*hull) == one.inside(*hull)
