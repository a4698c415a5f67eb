"""A hand model that can be asked where its sites and markers are, and how they move."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.errors import HandModelError
from graspdb_schemas.vocabulary import SEGMENTS, SEGMENTS_OF_DIGIT, SITES, Side

MARKER_PREFIX: Final = "marker_"
"""A marker `x` is the MJCF site ``marker_x``; the sites proper have their bare names."""

CAPSULE_PREFIX: Final = "to_"
"""The capsule drawn from a segment's origin to the site `x` is the MJCF geom ``to_x``."""

Floats = NDArray[np.floating[Any]]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class HandPose:
    """Where everything is for one configuration, in the lab frame [m].

    Attributes
    ----------
    sites : ndarray, shape (20, 3)
        Centres of the spheres.
    markers : ndarray, shape (n_markers, 3)
        Marker positions.
    positions : ndarray, shape (n_segments, 3)
        Origins of the segments, in the order of `SEGMENTS` (those that the model has).
    rotations : ndarray, shape (n_segments, 3, 3)
        world_from_segment rotations.
    """

    sites: Floats
    markers: Floats
    positions: Floats
    rotations: Floats


@dataclass(frozen=True)
class HandShape:
    """Places in a hand that calibration may move, by MJCF name, each in its parent's frame.

    Attributes
    ----------
    body_positions : mapping of str to ndarray, shape (3,)
        Origins of segments [m].
    body_quaternions : mapping of str to ndarray, shape (4,)
        Rotations of segments at zero angles, w x y z.
    site_positions : mapping of str to ndarray, shape (3,)
        Sites and markers (``marker_<label>``) [m].
    """

    body_positions: Mapping[str, Floats]
    body_quaternions: Mapping[str, Floats]
    site_positions: Mapping[str, Floats]


@dataclass(frozen=True)
class HandModel:
    """A hand: one side, and its MJCF with the 20 sites and any number of markers.

    Attributes
    ----------
    side : Side
        Right or left.
    mjcf : str
        The model in MuJoCo's XML.
    markers : tuple of str
        Labels of the markers, in the order that arrays of markers have.
    foreign : bool
        Whether a file gave it, so that names of its joints and segments say nothing of human anatomy.

    Raises
    ------
    HandModelError
        If the XML does not compile, does not begin with a free joint, has another joint than
        hinges after it, or lacks a site or a marker.
    """

    side: Side
    mjcf: str
    markers: tuple[str, ...]
    foreign: bool = False

    def __post_init__(self) -> None:
        model = self.mujoco_model
        kinds = list(model.jnt_type)
        hinge, free = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE
        if not kinds or kinds[0] != free or any(kind != hinge for kind in kinds[1:]):
            raise HandModelError(
                "the hand model does not have one free joint followed by hinges",
                "Give its root body a free joint and every other joint the type hinge.",
            )
        sites = (*SITES, *(MARKER_PREFIX + marker for marker in self.markers))
        missing = [site for site in sites if mujoco.mj_name2id(model, _SITE, site) < 0]
        if missing:
            raise HandModelError(
                f"the hand model lacks the sites {', '.join(missing)}",
                "Add a site of that name at the joint's centre, its size the sphere's radius.",
            )

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("side", "mjcf", "markers", "foreign")}

    @cached_property
    def mujoco_model(self) -> mujoco.MjModel:
        """The compiled model."""
        try:
            return mujoco.MjModel.from_xml_string(self.mjcf)
        except ValueError as error:
            raise HandModelError(
                f"MuJoCo cannot compile the hand model: {error}", "Mend the MJCF."
            ) from error

    @cached_property
    def site_ids(self) -> NDArray[np.int32]:
        """MuJoCo's numbers of the 20 sites."""
        return np.array([self.mujoco_model.site(s).id for s in SITES], dtype=np.int32)

    @cached_property
    def marker_ids(self) -> NDArray[np.int32]:
        """MuJoCo's numbers of the markers."""
        return np.array([self.mujoco_model.site(MARKER_PREFIX + m).id for m in self.markers], dtype=np.int32)

    @cached_property
    def markers_of_digit(self) -> dict[str, list[int]]:
        """Places of each digit's markers among the hand's; none where the segments are not a human hand's."""
        model = self.mujoco_model
        bodies = [model.body(int(model.site_bodyid[i])).name for i in self.marker_ids]
        return {
            digit: [i for i, body in enumerate(bodies) if body in segments]
            for digit, segments in SEGMENTS_OF_DIGIT.items()
            if any(segment in self.segments for segment in segments)
        }

    @cached_property
    def segments(self) -> tuple[str, ...]:
        """The segments that the model has, in the order of `SEGMENTS`."""
        model = self.mujoco_model
        return tuple(s for s in SEGMENTS if mujoco.mj_name2id(model, _BODY, s) >= 0)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the hinges, in the order of the configuration."""
        model = self.mujoco_model
        return tuple(model.joint(i).name for i in range(1, model.njnt))

    @cached_property
    def radii(self) -> Floats:
        """Sphere radii [m], shape (20,)."""
        return np.array(self.mujoco_model.site_size[self.site_ids, 0])

    @cached_property
    def joint_range(self) -> Floats:
        """Lower and upper limit of each hinge [rad], shape (n_hinges, 2)."""
        model = self.mujoco_model
        limits = np.array(model.jnt_range[1:])
        limits[~model.jnt_limited[1:].astype(bool)] = (-np.pi, np.pi)
        return limits

    @property
    def n_q(self) -> int:
        """Numbers in a configuration."""
        return int(self.mujoco_model.nq)

    @property
    def n_dof(self) -> int:
        """Degrees of freedom."""
        return int(self.mujoco_model.nv)

    @cached_property
    def segment_lengths(self) -> dict[str, float]:
        """Length of each digit's segments [m]: from its own joint to the next one, or to the tip."""
        pose = self.forward(self.neutral())
        chains = pose.sites.reshape(5, 4, 3)
        lengths = np.linalg.norm(np.diff(chains, axis=1), axis=2).ravel()
        digit_segments = [s for s in SEGMENTS if s not in ("forearm", "hand")]
        return dict(zip(digit_segments, lengths.tolist(), strict=True))

    def neutral(self) -> Floats:
        """Return the flat hand at the lab's origin, shape (n_q,)."""
        return np.array(self.mujoco_model.qpos0)

    def forward(self, q: Floats) -> HandPose:
        """Return where everything is in one configuration or in many.

        Parameters
        ----------
        q : ndarray, shape (..., n_q)
            Configurations; the arrays of the pose get the same leading axes.
        """
        leading = np.shape(q)[:-1]
        configurations = np.reshape(np.asarray(q, dtype=float), (-1, self._checked(q)))
        model, data = self.mujoco_model, mujoco.MjData(self.mujoco_model)
        sites = np.empty((len(configurations), model.nsite, 3))
        positions = np.empty((len(configurations), model.nbody, 3))
        rotations = np.empty((len(configurations), model.nbody, 9))
        for i, configuration in enumerate(configurations):
            data.qpos[:] = configuration
            mujoco.mj_kinematics(model, data)
            sites[i], positions[i], rotations[i] = data.site_xpos, data.xpos, data.xmat
        bodies = self._segment_ids
        return HandPose(
            sites=sites[:, self.site_ids].reshape(*leading, -1, 3),
            markers=sites[:, self.marker_ids].reshape(*leading, -1, 3),
            positions=positions[:, bodies].reshape(*leading, -1, 3),
            rotations=rotations[:, bodies].reshape(*leading, -1, 3, 3),
        )

    def site_jacobian(self, q: Floats) -> Floats:
        """Return d(site) / d(degree of freedom), shape (20, 3, n_dof)."""
        return self._jacobian(q, self.site_ids)

    def marker_jacobian(self, q: Floats) -> Floats:
        """Return d(marker) / d(degree of freedom), shape (n_markers, 3, n_dof)."""
        return self._jacobian(q, self.marker_ids)

    def palm(self, q: Floats) -> tuple[Floats, Floats]:
        """Return position (3,) and rotation (3, 3) of the palm: the segment ``hand``, else the root."""
        positions, rotations = self.palms(q[None])
        return positions[0], rotations[0]

    def palms(self, q: Floats) -> tuple[Floats, Floats]:
        """Return positions (n, 3) and rotations (n, 3, 3) of the palm in configurations of shape (n, n_q)."""
        model, data = self.mujoco_model, mujoco.MjData(self.mujoco_model)
        hand = mujoco.mj_name2id(model, _BODY, "hand")
        body = hand if hand >= 0 else int(model.jnt_bodyid[0])
        positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 9))
        # Views of MuJoCo's memory, which stays where it is: each access to a member makes a new one.
        moved, position, rotation = data.qpos, data.xpos[body], data.xmat[body]
        for i, configuration in enumerate(q):
            moved[:] = configuration
            mujoco.mj_kinematics(model, data)
            positions[i], rotations[i] = position, rotation
        return positions, rotations.reshape(-1, 3, 3)

    def integrate(self, q: Floats, step: Floats) -> Floats:
        """Return `q` moved by a step in the degrees of freedom, shape (n_q,).

        The free joint's rotation moves about its own axes, so the quaternion keeps length one.
        """
        moved = np.array(q, dtype=float)
        mujoco.mj_integratePos(self.mujoco_model, moved, np.asarray(step, dtype=float), 1.0)
        return moved

    def difference(self, from_q: Floats, to_q: Floats) -> Floats:
        """Return the step that `integrate` needs from one configuration to the other, shape (n_dof,)."""
        step = np.empty(self.n_dof)
        mujoco.mj_differentiatePos(self.mujoco_model, step, 1.0, from_q, to_q)
        return step

    def reshaped(self, shape: "HandShape") -> "HandModel":
        """Return the same hand with its joints, sites and markers in other places.

        The capsules that are drawn from a moved joint to a moved site go with them.
        """
        spec = mujoco.MjSpec.from_string(self.mjcf)
        for site, position in shape.site_positions.items():
            drawn = spec.geom(CAPSULE_PREFIX + site)
            if drawn is not None:
                _draw_to(drawn, position)
        for name, position in shape.body_positions.items():
            spec.body(name).pos = position
        for name, quaternion in shape.body_quaternions.items():
            spec.body(name).quat = quaternion
        for name, position in shape.site_positions.items():
            spec.site(name).pos = position
        spec.compile()
        return replace(self, mjcf=spec.to_xml())

    def write(self, path: Path) -> None:
        """Write the MJCF to a file that any MuJoCo viewer opens."""
        path.write_text(self.mjcf, encoding="utf-8")

    @cached_property
    def _segment_ids(self) -> NDArray[np.int32]:
        return np.array([self.mujoco_model.body(s).id for s in self.segments], dtype=np.int32)

    def _checked(self, q: Floats) -> int:
        if np.shape(q)[-1:] != (self.n_q,):
            raise HandModelError(
                f"a configuration of shape {np.shape(q)} was given to a hand with {self.n_q} numbers",
                "Pass configurations of that length.",
            )
        return self.n_q

    def _jacobian(self, q: Floats, ids: NDArray[np.int32]) -> Floats:
        self._checked(q)
        data = mujoco.MjData(self.mujoco_model)
        data.qpos[:] = q
        mujoco.mj_kinematics(self.mujoco_model, data)
        mujoco.mj_comPos(self.mujoco_model, data)
        jacobian = np.empty((len(ids), 3, self.n_dof))
        for i, site in enumerate(ids):
            mujoco.mj_jacSite(self.mujoco_model, data, jacobian[i], None, int(site))
        return jacobian


_SITE: Final = mujoco.mjtObj.mjOBJ_SITE
_BODY: Final = mujoco.mjtObj.mjOBJ_BODY


def _draw_to(capsule: mujoco.MjsGeom, end: Floats) -> None:
    """Lay a capsule, whose axis is its z, from the segment's origin to a point."""
    length = float(np.linalg.norm(end))
    quaternion = np.empty(4)
    mujoco.mju_quatZ2Vec(quaternion, np.asarray(end, dtype=float))
    capsule.pos, capsule.quat = end / 2, quaternion
    capsule.size = [capsule.size[0], length / 2, 0]
