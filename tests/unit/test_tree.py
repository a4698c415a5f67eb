"""Compiled kinematics against MuJoCo's own, on a tree with everything that a hand's model may have."""

import mujoco
import numpy as np
import pytest

from graspdb_ingest.hand.tree import (
    integrate,
    memory_of,
    place,
    points_of,
    tree_of,
    write_jacobian,
    write_points,
)

MODEL = """
<mujoco>
  <compiler autolimits="true"/>
  <worldbody>
    <body name="table" pos="1 0 0"><geom size="0.1" mass="1"/><site name="still" pos="0.1 0.2 0.3"/></body>
    <body name="root" pos="0.1 0.2 0.3" quat="0.5 0.5 -0.5 0.5">
      <freejoint/>
      <geom size="0.01" mass="1"/>
      <site name="palm" pos="0.01 0.02 0.03"/>
      <body name="thumb" pos="0.05 0.01 0" quat="0.9 0.1 0.3 -0.2">
        <joint name="a" axis="0 1 0" pos="0.01 -0.02 0.005"/>
        <joint name="b" axis="1 2 -1" ref="0.4"/>
        <geom size="0.01" mass="1"/>
        <site name="near" pos="0.02 0 0.01"/>
        <body name="tip" pos="0.03 0 0.01">
          <joint name="c" axis="0 0 1" pos="0 0.01 0"/>
          <geom size="0.01" mass="1"/>
          <site name="far" pos="0.02 0.01 0"/>
        </body>
      </body>
      <body name="finger" pos="0.09 -0.01 0.01" quat="0.7 0 0.7 0">
        <joint name="d" axis="0 1 1" ref="-0.2"/>
        <geom size="0.01" mass="1"/>
        <body name="fixed" pos="0.04 0 0" quat="0.8 0 0 0.6">
          <geom size="0.01" mass="1"/>
          <site name="end" pos="0.01 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MODEL)


def configurations(model: mujoco.MjModel) -> np.ndarray:
    rng = np.random.default_rng(0)
    q = rng.normal(0, 1, (20, model.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q


def test_places_and_jacobians_are_mujocos(model):
    data, tree = mujoco.MjData(model), tree_of(model)
    points, placed = points_of(model, np.arange(model.nsite, dtype=np.int32)[::-1]), memory_of(tree)
    positions, jacobian = np.empty((model.nsite, 3)), np.empty((model.nsite, 3, model.nv))
    for q in configurations(model):
        place(tree, q, placed)
        write_points(points, placed, positions)
        write_jacobian(tree, points, placed, positions, jacobian)
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        assert np.allclose(placed.origins, data.xpos, atol=1e-14)
        assert np.allclose(placed.rotations, data.xmat.reshape(-1, 3, 3), atol=1e-14)
        assert np.allclose(positions, data.site_xpos[::-1], atol=1e-14)
        for row, site in enumerate(points.which):
            expected = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, expected, None, int(site))
            assert np.allclose(jacobian[row], expected, atol=1e-13)


def test_what_is_moved_in_the_model_moves_here():
    own = mujoco.MjModel.from_xml_string(MODEL)
    tree, which = tree_of(own), np.array([own.site("far").id], dtype=np.int32)
    points, placed, before, after = points_of(own, which), memory_of(tree), np.empty((1, 3)), np.empty((1, 3))
    place(tree, own.qpos0, placed)
    write_points(points, placed, before)
    own.site("far").pos[:] += (0.01, 0, 0)
    own.body("tip").pos[:] += (0, 0.02, 0)
    place(tree, own.qpos0, placed)
    write_points(points, placed, after)
    assert np.linalg.norm(after - before) == pytest.approx(np.hypot(0.01, 0.02))


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-9, 1e-3, 1.0, 10.0])
def test_a_step_is_mujocos(model, size):
    rng = np.random.default_rng(1)
    for q in configurations(model):
        step, expected = size * rng.normal(size=model.nv), q.copy()
        mujoco.mj_integratePos(model, expected, step, 1.0)
        assert np.allclose(integrate(q, step), expected, rtol=1e-14, atol=1e-14)
