"""Kinematics of a hand as compiled code can call it: MuJoCo's arrays, and what MuJoCo makes of them.

A frame of tracking asks for the hand's place two or three times; calls from Python would cost more than that.
The conventions are those of MuJoCo's `mj_kinematics`, `mj_jacSite` and `mj_integratePos`.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Bools, Floats

Indices = NDArray[np.int32]


class Tree(NamedTuple):
    """A hand's segments and joints: one free joint, then hinges; views of a MuJoCo model.

    Attributes
    ----------
    parents : ndarray of int, shape (n_bodies,)
        Each segment's parent; parents come first.
    positions, quaternions : ndarray, shape (n_bodies, 3), (n_bodies, 4)
        Origin of each segment in its parent [m], and its rotation at zero angles.
    first_joints, n_joints : ndarray of int, shape (n_bodies,)
        The joints of each segment.
    anchors, axes : ndarray, shape (n_joints, 3)
        Place [m] and direction of each joint in its segment.
    zeros : ndarray, shape (n_q,)
        Configuration in which hinges have turned by nothing.
    carries : ndarray, shape (n_bodies, n_dof)
        1 where a degree of freedom moves a segment, else 0.
    """

    parents: Indices
    positions: Floats
    quaternions: Floats
    first_joints: Indices
    n_joints: Indices
    anchors: Floats
    axes: Floats
    zeros: Floats
    carries: Floats


class Points(NamedTuple):
    """Points fixed to segments.

    Attributes
    ----------
    bodies : ndarray of int, shape (n_sites,)
        Segment of each of the model's sites.
    places : ndarray, shape (n_sites, 3)
        Their places in their segments [m].
    which : ndarray of int, shape (n_points,)
        The sites that are the points.
    """

    bodies: Indices
    places: Floats
    which: Indices


class Placed(NamedTuple):
    """Where a hand's segments and joints are for a configuration; memory that `place` writes to.

    Attributes
    ----------
    origins, rotations : ndarray, shape (n_bodies, 3), (n_bodies, 3, 3)
        world_from_segment [m].
    anchors, axes : ndarray, shape (3, n_dof)
        A point on, and the direction of, the axis that each degree of freedom turns about; for the free
        joint's translations the direction alone.
    """

    origins: Floats
    rotations: Floats
    anchors: Floats
    axes: Floats


def tree_of(model: mujoco.MjModel) -> Tree:
    """Return the tree of a hand's model; it sees what is changed in the model later."""
    return Tree(
        parents=model.body_parentid,
        positions=model.body_pos,
        quaternions=model.body_quat,
        first_joints=model.body_jntadr,
        n_joints=model.body_jntnum,
        anchors=model.jnt_pos,
        axes=model.jnt_axis,
        zeros=model.qpos0,
        carries=carried(model).astype(float),
    )


def points_of(model: mujoco.MjModel, which: Indices) -> Points:
    """Return some sites of a hand's model as points; they see what is changed in the model later."""
    return Points(bodies=model.site_bodyid, places=model.site_pos, which=np.ascontiguousarray(which))


def carried(model: mujoco.MjModel) -> Bools:
    """Return which degrees of freedom move which bodies, shape (n_bodies, n_dof)."""
    carries = np.zeros((model.nbody, model.nv), dtype=bool)
    for body in range(1, model.nbody):  # parents come first
        carries[body] = carries[model.body_parentid[body]]
        first = model.body_dofadr[body]
        carries[body, first : first + model.body_dofnum[body]] = True
    return carries


@compiled
def memory_of(tree: Tree) -> Placed:
    """Return memory for `place`."""
    n_bodies, n_dof = tree.carries.shape
    return Placed(
        np.zeros((n_bodies, 3)), np.zeros((n_bodies, 3, 3)), np.zeros((3, n_dof)), np.zeros((3, n_dof))
    )


@compiled
def place(tree: Tree, q: Floats, placed: Placed) -> None:
    """Write where the segments and the joints' axes are for configuration `q`, shape (n_q,)."""
    origins, rotations = placed.origins, placed.rotations
    turn, held, arm = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(3):
        rotations[0, i, i] = 1.0
    for body in range(1, len(tree.parents)):
        rotation, origin = rotations[body], origins[body]
        first = tree.first_joints[body]
        if tree.n_joints[body] and first == 0:
            _place_free(q, rotation, origin, placed)
            continue
        parent = tree.parents[body]
        _from_quaternion(tree.quaternions[body], turn)
        _product(rotations[parent], turn, rotation)
        _turned(rotations[parent], tree.positions[body], arm)
        for i in range(3):
            origin[i] = origins[parent, i] + arm[i]
        for joint in range(first, first + tree.n_joints[body]):
            dof = joint + 5  # after the six of the free joint
            anchor, axis = placed.anchors[:, dof], placed.axes[:, dof]
            _turned(rotation, tree.axes[joint], axis)
            _turned(rotation, tree.anchors[joint], arm)
            for i in range(3):
                anchor[i] = origin[i] + arm[i]
                for j in range(3):
                    held[i, j] = rotation[i, j]
            _about(tree.axes[joint], q[joint + 6] - tree.zeros[joint + 6], turn)
            _product(held, turn, rotation)
            _turned(rotation, tree.anchors[joint], arm)
            for i in range(3):
                origin[i] = anchor[i] - arm[i]


@compiled
def _place_free(q: Floats, rotation: Floats, origin: Floats, placed: Placed) -> None:
    """Write where the segment of the free joint is."""
    _from_quaternion(q[3:7], rotation)
    for axis in range(3):
        origin[axis] = q[axis]
        placed.axes[axis, axis] = 1.0
        for i in range(3):
            placed.axes[i, 3 + axis] = rotation[i, axis]
            placed.anchors[i, 3 + axis] = q[i]


@compiled
def write_points(points: Points, placed: Placed, out: Floats) -> None:
    """Write where points are [m], shape (n_points, 3)."""
    for i in range(len(points.which)):
        site = points.which[i]
        body = points.bodies[site]
        _turned(placed.rotations[body], points.places[site], out[i])
        for axis in range(3):
            out[i, axis] += placed.origins[body, axis]


@compiled
def write_jacobian(tree: Tree, points: Points, placed: Placed, at: Floats, out: Floats) -> None:
    """Write d(point) / d(degree of freedom), shape (n_points, 3, n_dof), of points that are `at`.

    A translation moves a point along its axis, a rotation about axis a through c by a x (x - c).
    """
    a, b, c = placed.axes
    first, second, third = placed.anchors
    for i in range(len(points.which)):
        carries = tree.carries[points.bodies[points.which[i]]]
        x, y, z = at[i]
        for dof in range(len(carries)):
            dx, dy, dz = x - first[dof], y - second[dof], z - third[dof]
            out[i, 0, dof] = carries[dof] * (b[dof] * dz - c[dof] * dy)
            out[i, 1, dof] = carries[dof] * (c[dof] * dx - a[dof] * dz)
            out[i, 2, dof] = carries[dof] * (a[dof] * dy - b[dof] * dx)
        for dof in range(3):
            out[i, 0, dof] = carries[dof] * a[dof]
            out[i, 1, dof] = carries[dof] * b[dof]
            out[i, 2, dof] = carries[dof] * c[dof]


@compiled
def integrate(q: Floats, step: Floats) -> Floats:
    """Return a configuration moved by a step in the degrees of freedom, as `HandModel.integrate` does."""
    moved = q.copy()
    for i in range(3):
        moved[i] += step[i]
    for i in range(7, len(q)):
        moved[i] += step[i - 1]
    angle = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
    scale = 0.5 if angle < 1e-9 else np.sin(angle / 2) / angle
    w, x, y, z = q[3], q[4], q[5], q[6]
    a, b, c, d = np.cos(angle / 2), scale * step[3], scale * step[4], scale * step[5]
    moved[3] = w * a - x * b - y * c - z * d
    moved[4] = w * b + x * a + y * d - z * c
    moved[5] = w * c - x * d + y * a + z * b
    moved[6] = w * d + x * c - y * b + z * a
    length = np.sqrt(moved[3] ** 2 + moved[4] ** 2 + moved[5] ** 2 + moved[6] ** 2)
    for i in range(3, 7):
        moved[i] /= length
    return moved


@compiled
def _from_quaternion(quaternion: Floats, rotation: Floats) -> None:
    """Write the rotation matrix of a quaternion w x y z."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    two = 2 / (w * w + x * x + y * y + z * z)
    rotation[0, 0] = 1 - two * (y * y + z * z)
    rotation[1, 1] = 1 - two * (x * x + z * z)
    rotation[2, 2] = 1 - two * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = two * (x * y - w * z), two * (x * y + w * z)
    rotation[0, 2], rotation[2, 0] = two * (x * z + w * y), two * (x * z - w * y)
    rotation[1, 2], rotation[2, 1] = two * (y * z - w * x), two * (y * z + w * x)


@compiled
def _about(axis: Floats, angle: float, rotation: Floats) -> None:
    """Write the rotation about an axis of length one by an angle [rad] (Rodrigues)."""
    sine, rest = np.sin(angle), 1 - np.cos(angle)
    for i in range(3):
        for j in range(3):
            rotation[i, j] = rest * axis[i] * axis[j]
        rotation[i, i] += 1 - rest
    rotation[0, 1] -= sine * axis[2]
    rotation[1, 0] += sine * axis[2]
    rotation[0, 2] += sine * axis[1]
    rotation[2, 0] -= sine * axis[1]
    rotation[1, 2] -= sine * axis[0]
    rotation[2, 1] += sine * axis[0]


@compiled
def _product(a: Floats, b: Floats, out: Floats) -> None:
    """Write the product of two matrices of shape (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def _turned(rotation: Floats, vector: Floats, out: Floats) -> None:
    """Write the vector turned by the rotation."""
    for i in range(3):
        out[i] = rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]
