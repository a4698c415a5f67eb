"""Fast repeated kinematics of one hand: a workspace that inner loops move from frame to frame."""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats, HandModel


class Kinematics:
    """Site and marker positions of a hand, and the markers' Jacobian, for one configuration at a time.

    It keeps MuJoCo's working memory between calls, so one workspace serves one thread. The model
    inside is a private copy: calibration may move its joints and markers.

    Parameters
    ----------
    hand : HandModel
        The hand.
    """

    def __init__(self, hand: HandModel) -> None:
        self.hand = hand
        self.model: mujoco.MjModel = mujoco.MjModel.from_xml_string(hand.mjcf)
        # MuJoCo never reads the place of a site that its compiler found exactly in its segment's frame.
        self.model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        self._data = mujoco.MjData(self.model)
        self._marker_ids = hand.marker_ids
        self._site_ids = hand.site_ids
        self._marker_jacobian = _PointJacobian(self.model, self._marker_ids)
        self._site_jacobian = _PointJacobian(self.model, self._site_ids)

    def move(self, q: Floats) -> None:
        """Take configuration `q`, shape (n_q,)."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self._data)

    @property
    def markers(self) -> Floats:
        """Marker positions [m], shape (n_markers, 3)."""
        return np.array(self._data.site_xpos[self._marker_ids])

    @property
    def sites(self) -> Floats:
        """Sphere centres [m], shape (20, 3)."""
        return np.array(self._data.site_xpos[self._site_ids])

    @property
    def body_rotations(self) -> Floats:
        """world_from_body rotation of every body of the model, shape (n_bodies, 3, 3)."""
        return np.array(self._data.xmat).reshape(-1, 3, 3)

    @property
    def body_positions(self) -> Floats:
        """Origin of every body of the model [m], shape (n_bodies, 3)."""
        return np.array(self._data.xpos)

    def marker_jacobian(self) -> Floats:
        """Return d(marker) / d(degree of freedom), shape (n_markers, 3, n_dof).

        The array is the workspace's own and is overwritten by the next call.
        """
        return self._marker_jacobian.at(self._data)

    def site_jacobian(self) -> Floats:
        """Return d(site) / d(degree of freedom), shape (20, 3, n_dof); overwritten by the next call."""
        return self._site_jacobian.at(self._data)


class _PointJacobian:
    """Jacobian of points on the hand, all at once: MuJoCo's own takes a call a point.

    A degree of freedom that turns about an axis a and moves a reference point by v moves a point x
    from there by v + a x x, which is linear in (x, 1). So one product gives what each of them does
    to each point; those that do not carry the point's segment are then taken out.
    """

    def __init__(self, model: mujoco.MjModel, ids: NDArray[np.int32]) -> None:
        self._model, self._ids = model, ids
        bodies = model.site_bodyid[ids]
        roots = model.body_rootid[bodies]
        self._roots = int(roots[0]) if len(set(roots)) == 1 else roots
        self._carries = np.repeat(_carries(model)[bodies].astype(float)[:, None], 3, axis=1)
        self._points = np.ones((len(ids), 4))
        self._moving = np.empty((12, model.nv))
        self._moved = np.empty((len(ids), 3 * model.nv))
        self._jacobian: Floats = np.empty(self._carries.shape)

    def at(self, data: mujoco.MjData) -> Floats:
        """Return d(point) / d(degree of freedom), shape (n_points, 3, n_dof), where MuJoCo has them now."""
        mujoco.mj_comPos(self._model, data)  # finds a and v, and the reference point of each root
        np.dot(_OF_POINT, data.cdof.T, out=self._moving)
        points = data.site_xpos.take(self._ids, axis=0)
        np.subtract(points, data.subtree_com[self._roots], out=self._points[:, :3])
        np.dot(self._points, self._moving.reshape(4, -1), out=self._moved)
        np.multiply(self._moved.reshape(self._carries.shape), self._carries, out=self._jacobian)
        return self._jacobian


def _of_point() -> Floats:
    """Return what turns (a, v) into the coefficients of x, y, z and 1 in v + a x (x, y, z), shape (12, 6)."""
    matrix = np.zeros((4, 3, 6))
    matrix[:3, :, :3] = [np.cross(np.eye(3), unit).T for unit in np.eye(3)]
    matrix[3, :, 3:] = np.eye(3)
    return matrix.reshape(12, 6)


_OF_POINT: Final = _of_point()


def _carries(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return which degrees of freedom move which bodies, shape (n_bodies, n_dof)."""
    carries = np.zeros((model.nbody, model.nv), dtype=bool)
    for body in range(1, model.nbody):  # parents come first
        carries[body] = carries[model.body_parentid[body]]
        first = model.body_dofadr[body]
        carries[body, first : first + model.body_dofnum[body]] = True
    return carries
