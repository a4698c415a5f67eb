"""Fast repeated kinematics of one hand: a workspace that inner loops move from frame to frame."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.tree import carried, points_of, tree_of


class Kinematics:
    """Site and marker positions of a hand, and the markers' Jacobian, for one configuration at a time.

    It keeps MuJoCo's working memory between calls, so one workspace serves one thread. The model
    inside is a private copy: calibration may move its joints and markers.

    Parameters
    ----------
    hand : HandModel
        The hand.

    Attributes
    ----------
    tree : Tree
        The hand for compiled code, which places it by itself.
    marker_points, site_points : Points
        Its markers and sites for compiled code.
    """

    def __init__(self, hand: HandModel) -> None:
        self.hand = hand
        self.model: mujoco.MjModel = mujoco.MjModel.from_xml_string(hand.mjcf)
        # MuJoCo never reads the place of a site that its compiler found exactly in its segment's frame.
        self.model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        self._data = mujoco.MjData(self.model)
        # Views of MuJoCo's memory, which stays where it is: each access to a member makes a new one.
        self._qpos, self._points = self._data.qpos, self._data.site_xpos
        self._marker_ids = hand.marker_ids
        self._site_ids = hand.site_ids
        self.tree = tree_of(self.model)
        self.marker_points = points_of(self.model, self._marker_ids)
        self.site_points = points_of(self.model, self._site_ids)
        self._marker_jacobian = _PointJacobian(self.model, self._data, self._marker_ids)
        self._site_jacobian = _PointJacobian(self.model, self._data, self._site_ids)

    def move(self, q: Floats) -> None:
        """Take configuration `q`, shape (n_q,)."""
        self._qpos[:] = q
        mujoco.mj_kinematics(self.model, self._data)

    @property
    def markers(self) -> Floats:
        """Marker positions [m], shape (n_markers, 3)."""
        return np.asarray(self._points.take(self._marker_ids, axis=0))

    @property
    def sites(self) -> Floats:
        """Sphere centres [m], shape (20, 3)."""
        return np.asarray(self._points.take(self._site_ids, axis=0))

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
        return self._marker_jacobian.now()

    def site_jacobian(self) -> Floats:
        """Return d(site) / d(degree of freedom), shape (20, 3, n_dof); overwritten by the next call."""
        return self._site_jacobian.now()


class _PointJacobian:
    """Jacobian of points on the hand, all at once: MuJoCo's own takes a call a point."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, ids: NDArray[np.int32]) -> None:
        self._model, self._data, self._ids = model, data, ids
        bodies = model.site_bodyid[ids]
        roots = model.body_rootid[bodies]
        self._memory = data.site_xpos, ids, data.subtree_com, roots, data.cdof, carried(model)[bodies]
        self._jacobian: Floats = np.zeros((len(ids), 3, model.nv))

    def now(self) -> Floats:
        """Return d(point) / d(degree of freedom), shape (n_points, 3, n_dof), where MuJoCo has them now."""
        mujoco.mj_comPos(self._model, self._data)  # finds the axes, and the reference point of each root
        _write_jacobian(self._jacobian, *self._memory)
        return self._jacobian


@compiled
def _write_jacobian(
    jacobian: Floats,
    positions: Floats,
    points: NDArray[np.int32],
    references: Floats,
    roots: NDArray[np.int32],
    axes: Floats,
    carries: NDArray[np.bool_],
) -> None:
    """Write the Jacobian of some points, each given by its row in `positions`.

    A degree of freedom that turns about an axis a and moves the reference point of its root by v moves a
    point x from there by v + a x x, if it carries the point's segment.
    """
    for i in range(len(points)):
        x, y, z = positions[points[i]] - references[roots[i]]
        for dof in range(len(axes)):
            if carries[i, dof]:
                a = axes[dof]
                jacobian[i, 0, dof] = a[3] + a[1] * z - a[2] * y
                jacobian[i, 1, dof] = a[4] + a[2] * x - a[0] * z
                jacobian[i, 2, dof] = a[5] + a[0] * y - a[1] * x
