"""A grasp as a scene that MuJoCo simulates: articulated hand, free object, keyframes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import mujoco
import numpy as np

from graspdb.export.grip import grip_forces
from graspdb.export.items import Floats
from graspdb_ingest.hand import HandModel
from graspdb_ingest.rigid import quaternions_from_rotations
from graspdb_schemas.vocabulary import SITES

TIMESTEP: Final = 0.002
"""Step of the simulation [s]."""

GRAVITY: Final = 9.81
"""Acceleration of gravity [m/s2]."""

STIFFNESS: Final = 3.0
"""Stiffness of the position servo of each hinge [N m/rad]; that of the wrist's is `WRIST` times as large."""

DAMPING: Final = 0.1
"""Damping of each hinge [N m s/rad]."""

WRIST: Final = 10.0

ARMATURE: Final = 1e-4
"""Rotor inertia of each hinge, which keeps light distal segments stable [kg m2]."""

DENSITY: Final = 500.0
"""Mass over enclosed volume of an object whose mass is not known [kg/m3]."""

GRIP: Final = 1.0
"""Preload of all contacts together, over what carries the weight by friction alone."""

STARTS: Final = 8
"""Places from which MuJoCo looks for contacts of each pair; each gives one contact at most."""

PRELOADS: Final = (0.5, 5.0)
"""Least and greatest normal force with which each touching site presses to begin with [N]."""

HAND_BIT: Final = 1
"""Contact type of hand and support, which collide with the object alone: no segment blocks another."""

OBJECT_BIT: Final = 2
"""Contact type of the object."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """The object of a scene.

    Attributes
    ----------
    mesh : str
        File of its closed surface, relative to the scene's.
    mass : float
        Mass [kg].
    friction : float
        Coefficient of sliding friction.
    center : ndarray, shape (3,)
        Centre of mass, object frame [m].
    """

    mesh: str
    mass: float
    friction: float
    center: Floats


@dataclass(frozen=True, eq=False)
class Keyframe:
    """Hand and object at an instant.

    Attributes
    ----------
    name : str
        What is then.
    q : ndarray, shape (n_q,)
        Configuration of the hand in the scene's frame [m, 1, rad].
    world_from_object : ndarray, shape (4, 4)
        Pose of the object in it.
    """

    name: str
    q: Floats
    world_from_object: Floats


@dataclass(frozen=True, eq=False)
class Press:
    """Where the hand presses on the object.

    Attributes
    ----------
    sites : sequence of int
        Numbers of the touching sites.
    points, normals : ndarray, shape (n, 3)
        Where they touch [m], and the outward normals of the object there, object frame.
    """

    sites: Sequence[int]
    points: Floats
    normals: Floats


def grasp_scene(
    path: Path,
    name: str,
    hand: HandModel,
    held: SceneObject,
    keyframes: Sequence[Keyframe],
    press: Press,
    up: Floats | None,
    support: float | None,
) -> None:
    """Write a scene.

    The forearm is welded to a mocap body, ``forearm_target``: moving that carries the hand. Each hinge has a
    position servo of its name. Controls of a keyframe are its angles, in the first one with what makes the
    touching sites grip (`grip_forces`): by the transposed Jacobian, force f at a site takes the torque J^T f.

    Parameters
    ----------
    path : Path
        The MJCF file; the object's mesh lies there already.
    name : str
        What the scene is called.
    hand : HandModel
        The hand.
    held : SceneObject
        The object.
    keyframes : sequence of Keyframe
        The grasp first, then others.
    press : Press
        Where the hand presses in the first.
    up : ndarray, shape (3,), or None
        Vertical of the scene's frame; without it there is no gravity.
    support : float or None
        Height along `up` of a plane that the object stands on [m]; None where it stands on none.
    """
    spec = mujoco.MjSpec.from_string(hand.mjcf)
    spec.modelname = name
    spec.modelfiledir = str(path.parent)
    _options(spec, up)
    _hand(spec, held.friction, keyframes[0])
    _object(spec, held, keyframes[0])
    if up is not None and support is not None:
        _plane(spec, up, support, held.friction)
    spec.compile()
    scene = ElementTree.fromstring(spec.to_xml())
    keys = ElementTree.SubElement(scene, "keyframe")
    for number, keyframe in enumerate(keyframes):
        bend = _bend(hand, keyframe, held, press, up) if number == 0 else np.zeros(hand.n_q - 7)
        ElementTree.SubElement(keys, "key", _keyframe(keyframe, bend))
    ElementTree.indent(scene)
    path.write_text(ElementTree.tostring(scene, encoding="unicode") + "\n", encoding="utf-8")


def _options(spec: mujoco.MjSpec, up: Floats | None) -> None:
    spec.option.timestep = TIMESTEP
    spec.option.gravity = np.zeros(3) if up is None else -GRAVITY * up
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10
    spec.option.sdf_initpoints = STARTS
    spec.worldbody.add_light(pos=[0, 0, 2], dir=[0, 0, -1])


def _hand(spec: mujoco.MjSpec, friction: float, grasp: Keyframe) -> None:
    """Make the hand solid, servo its hinges, and hang its root on a mocap body."""
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0  # a person's hand does not sag, either
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = HAND_BIT, OBJECT_BIT
        geom.friction[0] = friction
    for site in SITES:
        place = spec.site(site)
        place.parent.add_geom(
            name=f"sphere_{site}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=place.pos,
            size=[place.size[0], 0, 0],
            mass=0,
            rgba=[0.85, 0.65, 0.55, 0.4],
            contype=HAND_BIT,
            conaffinity=OBJECT_BIT,
            condim=4,
            friction=[friction, 0.005, 1e-4],
            group=3,
        )
    for joint in spec.joints[1:]:
        wrist = WRIST if joint.name.startswith("wrist") else 1.0
        joint.armature, joint.damping = wrist * ARMATURE, wrist * np.array([DAMPING, 0, 0])
        servo = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=wrist * STIFFNESS)
    root = spec.bodies[1].name
    target = spec.worldbody.add_body(name=f"{root}_target", mocap=True, pos=grasp.q[:3], quat=grasp.q[3:7])
    target.add_site(name=f"{root}_target", size=[0.01, 0, 0], rgba=[0.2, 0.4, 0.9, 0.3], group=4)
    weld = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1=f"{root}_target", name2=root
    )
    place = np.zeros(len(weld.data))
    place[[6, 10]] = 1.0  # no turn between the two (w of w x y z); torques as strong as forces
    weld.data = place


def _object(spec: mujoco.MjSpec, held: SceneObject, grasp: Keyframe) -> None:
    """Add the object as a free body whose collisions follow its surface, hollows and handles included."""
    mesh = spec.add_mesh(name="object", file=held.mesh)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    body = spec.worldbody.add_body(
        name="object", pos=grasp.world_from_object[:3, 3], quat=_quaternion(grasp.world_from_object)
    )
    body.add_freejoint(name="object")
    body.add_geom(
        name="object",
        type=mujoco.mjtGeom.mjGEOM_SDF,
        meshname="object",
        mass=held.mass,
        rgba=[0.75, 0.78, 0.82, 1],
        contype=OBJECT_BIT,
        conaffinity=HAND_BIT,
        condim=4,
        friction=[held.friction, 0.005, 1e-4],
    )


def _plane(spec: mujoco.MjSpec, up: Floats, height: float, friction: float) -> None:
    quaternion = np.empty(4)
    mujoco.mju_quatZ2Vec(quaternion, np.asarray(up, dtype=float))
    spec.worldbody.add_geom(
        name="support",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=height * up,
        quat=quaternion,
        size=[0.5, 0.5, 0.01],
        rgba=[0.5, 0.5, 0.5, 0.5],
        contype=HAND_BIT,
        conaffinity=OBJECT_BIT,
        friction=[friction, 0.005, 1e-4],
    )


def _bend(hand: HandModel, grasp: Keyframe, held: SceneObject, press: Press, up: Floats | None) -> Floats:
    """Return how far beyond its angle each servo aims, so that the touching sites press [rad]."""
    known = np.isfinite(press.points).all(axis=1) & np.isfinite(press.normals).all(axis=1)
    if not known.any():
        return np.zeros(hand.n_q - 7)
    rotation = grasp.world_from_object[:3, :3]
    weight = np.zeros(3) if up is None else -held.mass * GRAVITY * (rotation.T @ up)
    preload = GRIP * float(np.linalg.norm(weight)) / (held.friction * known.sum())
    forces = grip_forces(
        press.points[known],
        press.normals[known],
        held.center,
        weight,
        held.friction,
        float(np.clip(preload, *PRELOADS)),
    )
    jacobian = hand.site_jacobian(grasp.q)[np.array(press.sites)[known]]
    torques = np.einsum("ijk,ij->k", jacobian, forces @ rotation.T)[6:]
    wrist = np.array([name.startswith("wrist") for name in hand.joints])
    return np.asarray(torques / STIFFNESS * np.where(wrist, 1 / WRIST, 1.0))


def _keyframe(keyframe: Keyframe, bend: Floats) -> dict[str, str]:
    """Return the attributes of a keyframe, with all digits, of which MuJoCo's own writer keeps six."""
    pose = keyframe.world_from_object
    numbers = {
        "qpos": [*keyframe.q, *pose[:3, 3], *_quaternion(pose)],
        "ctrl": [*(keyframe.q[7:] + bend)],
        "mpos": [*keyframe.q[:3]],
        "mquat": [*keyframe.q[3:7]],
    }
    texts = {name: " ".join(format(x, ".12g") for x in values) for name, values in numbers.items()}
    return {"name": keyframe.name, **texts}


def _quaternion(pose: Floats) -> Floats:
    return np.asarray(quaternions_from_rotations(pose[None, :3, :3])[0])
