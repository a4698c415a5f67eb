"""Fast repeated kinematics of one hand: a workspace that inner loops move from frame to frame."""

from functools import cached_property

import mujoco
import numpy as np

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
        self._marker_jacobian = np.zeros((len(self._marker_ids), 3, hand.n_dof))
        self._site_jacobian = np.zeros((len(self._site_ids), 3, hand.n_dof))

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
        return self._filled(self._marker_jacobian, self._marker_targets)

    def site_jacobian(self) -> Floats:
        """Return d(site) / d(degree of freedom), shape (20, 3, n_dof); overwritten by the next call."""
        return self._filled(self._site_jacobian, self._site_targets)

    @cached_property
    def _marker_targets(self) -> list[tuple[Floats, int]]:
        return list(zip(self._marker_jacobian, self._marker_ids.tolist(), strict=True))

    @cached_property
    def _site_targets(self) -> list[tuple[Floats, int]]:
        return list(zip(self._site_jacobian, self._site_ids.tolist(), strict=True))

    def _filled(self, jacobian: Floats, targets: list[tuple[Floats, int]]) -> Floats:
        mujoco.mj_comPos(self.model, self._data)
        for target, site in targets:
            mujoco.mj_jacSite(self.model, self._data, target, None, site)
        return jacobian
