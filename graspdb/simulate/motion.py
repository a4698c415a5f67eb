"""Motion of hand and object in a trial: reach, close, lift, hold, put down, release, withdraw.

Every movement has the bell-shaped speed of a minimum-jerk profile (Flash and Hogan 1985).
The table is the plane z = 0; the subject sits on the side of negative y.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from graspdb.simulate.arrays import Floats
from graspdb.simulate.closing import chain
from graspdb.simulate.grasps import Grasp
from graspdb.simulate.path import Curve, find_path
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb.simulate.surface import Surface
from graspdb_schemas.vocabulary import DIGITS, FINGERS, JOINT_ANGLES, N_SITES, Side

RELAXED: Final[dict[str, float]] = {
    "wrist_flexion": -8,
    "thumb_cmc_abduction": 5,
    "thumb_mcp_flexion": 12,
    "thumb_ip_flexion": 12,
    **{f"{finger}_mcp_flexion": 18 for finger in FINGERS},
    **{f"{finger}_pip_flexion": 28 for finger in FINGERS},
    **{f"{finger}_dip_flexion": 15 for finger in FINGERS},
}
"""The hand at rest on the table [degrees]."""

BRUSH: Final = 0.0008
"""How far a sphere may brush object or table on its way [m]."""

TRIES: Final = 4
"""How often times and places are drawn again where the hand would run into something."""

TURNING: Final = 0.6
"""Share of a reach in which the hand turns and opens; the rest is a straight approach."""


@dataclass(frozen=True)
class Events:
    """When things happen in a trial [s].

    Attributes
    ----------
    reach, close, closed, lift, lifted, put_down, landed, release, released, withdraw, end : float
        Beginning of the reach; of closing; all digits closed; the object leaves the table; it
        is up; it goes down; it stands; digits begin to open; all are open; the hand leaves; rest.
    """

    reach: float
    close: float
    closed: float
    lift: float
    lifted: float
    put_down: float
    landed: float
    release: float
    released: float
    withdraw: float
    end: float


@dataclass(frozen=True)
class Motion:
    """A trial's true movement in the lab frame.

    Attributes
    ----------
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    q : ndarray, shape (n_frames, 30)
        The hand.
    object_position : ndarray, shape (n_frames, 3)
        Origin of the object [m].
    object_rotation : ndarray, shape (n_frames, 4)
        world_from_object quaternion (w, x, y, z).
    events : Events
        When things happen.
    """

    times: Floats
    q: Floats
    object_position: Floats
    object_rotation: Floats
    events: Events


def progress(times: Floats, start: float, duration: float) -> Floats:
    """Return the share of a minimum-jerk movement that is done, 0 to 1, shape of `times`."""
    s = np.clip((times - start) / duration, 0, 1)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def perform(
    hand: PlanningHand, surface: Surface, grasp: Grasp, rng: np.random.Generator, rate: float
) -> Motion | None:
    """Return one trial of grasping, lifting and putting down an object; None where no way to it is free.

    Parameters
    ----------
    hand : PlanningHand
        The hand.
    surface : Surface
        The object in its own frame.
    grasp : Grasp
        The grasp to perform.
    rng : numpy.random.Generator
        Draws times, heights and places.
    rate : float
        Frames per second [Hz].
    """
    for _ in range(TRIES):
        events = _draw_events(rng)
        times = np.arange(round(events.end * rate)) / rate
        position, rotation = _object_path(hand, grasp, events, times, rng)
        first, last = (Placed(position[i], rotation[i]) for i in (0, -1))
        reach = _journey(hand, surface, grasp, first, rng)
        withdraw = _journey(hand, surface, grasp, last, rng) if reach else None
        if reach is not None and withdraw is not None:
            return _assembled(grasp, events, times, position, rotation, reach, withdraw, rng)
    return None


def _assembled(
    grasp: Grasp,
    events: Events,
    times: Floats,
    position: Floats,
    rotation: Rotation,
    reach: "Journey",
    withdraw: "Journey",
    rng: np.random.Generator,
) -> Motion:
    """Return the hand's movement around an object's movement."""
    q = np.empty((len(times), 30))
    q[:, 7:] = _angles(grasp, reach.rest, withdraw.rest, events, times, rng)
    held = Rotation.from_quat(grasp.q[3:7], scalar_first=True)
    q[:, :3] = position + rotation.apply(grasp.q[:3])
    turned = rotation * held
    span = events.close - events.reach
    before = times < events.close
    q[before, :3] = reach.path.at(progress(times[before], events.reach, span))
    turned_before = reach.turn(progress(times[before], events.reach, TURNING * span))
    span = events.end - 0.3 - events.withdraw
    after = times >= events.withdraw
    q[after, :3] = withdraw.path.at(1 - progress(times[after], events.withdraw, span))
    turning = progress(times[after], events.withdraw + (1 - TURNING) * span, TURNING * span)
    turned_after = withdraw.turn(1 - turning)
    between = turned[~before & ~after]
    q[:, 3:7] = Rotation.concatenate([turned_before, between, turned_after]).as_quat(scalar_first=True)
    return Motion(times, q, position, rotation.as_quat(scalar_first=True), events)


@dataclass(frozen=True)
class Placed:
    """Where an object stands: world_from_object."""

    position: Floats
    rotation: Rotation


@dataclass(frozen=True)
class Journey:
    """From rest to the open hand around the object.

    Attributes
    ----------
    rest : ndarray, shape (30,)
        The hand at rest.
    path : Curve
        Way of the wrist.
    turn : Slerp
        world_from_forearm by share of the turn.
    """

    rest: Floats
    path: Curve
    turn: Slerp


def _draw_events(rng: np.random.Generator) -> Events:
    low = (0.4, 0.85, 0.32, 0.25, 0.70, 0.8, 0.80, 0.15, 0.28, 0.02, 1.05)
    high = (0.6, 1.15, 0.48, 0.45, 1.00, 1.4, 1.10, 0.30, 0.40, 0.10, 1.35)
    return Events(*np.cumsum(rng.uniform(low, high)).tolist())


def _object_path(
    hand: PlanningHand, grasp: Grasp, events: Events, times: Floats, rng: np.random.Generator
) -> tuple[Floats, Rotation]:
    """Return the object's positions and rotations; it turns its grasped side to the subject."""
    mirror = 1.0 if hand.side is Side.RIGHT else -1.0
    distal = Rotation.from_quat(grasp.q[3:7], scalar_first=True).apply([1.0, 0.0, 0.0])
    heading = np.deg2rad(90 + mirror * 12 + 8 * rng.standard_normal())
    yaw = heading - np.arctan2(distal[1], distal[0])
    up = progress(times, events.lift, events.lifted - events.lift)[:, None]
    down = progress(times, events.put_down, events.landed - events.put_down)[:, None]
    start = np.array([*rng.uniform(-0.03, 0.03, 2), 0.0])
    raised = np.array([*rng.uniform(-0.02, 0.02, 2), rng.uniform(0.07, 0.14)])
    moved = np.array([*rng.uniform(-0.015, 0.015, 2), 0.0])
    tilt = np.deg2rad(rng.uniform(-5, 5, 3))
    turned = np.array([0.0, 0.0, np.deg2rad(rng.uniform(-4, 4))])
    position = start + up * raised + down * (moved - raised)
    rotation = Rotation.from_rotvec(up * tilt + down * (turned - tilt)) * Rotation.from_rotvec([0, 0, yaw])
    return position, rotation


def _angles(
    grasp: Grasp, rest: Floats, rest_after: Floats, events: Events, times: Floats, rng: np.random.Generator
) -> Floats:
    """Return the 23 joint angles: relaxed, opened, closed digit by digit, and back."""
    opened, closed = grasp.opened[7:], grasp.q[7:]
    reach, close = events.close - events.reach, events.closed - events.close
    opening = progress(times, events.reach, TURNING * reach)[:, None]
    angles = rest[7:] + opening * (opened - rest[7:])
    release = events.released - events.release
    for digit in DIGITS:
        joints = chain(digit).joints - 7
        late, early = rng.uniform(0, 0.4, 2)
        share = progress(times, events.close + late * close, (1 - late) * close)
        share = share - progress(times, events.release + early * release, (1 - early) * release)
        angles[:, joints] += share[:, None] * (closed - opened)[joints]
    span = events.end - 0.3 - events.withdraw
    back = progress(times, events.withdraw + (1 - TURNING) * span, TURNING * span)[:, None]
    return np.asarray(angles + back * (rest_after[7:] - opened))


def _journey(
    hand: PlanningHand, surface: Surface, grasp: Grasp, placed: Placed, rng: np.random.Generator
) -> Journey | None:
    """Return a way from a rest to the object on which the hand runs into nothing; None without one."""
    rest = rest_pose(hand, rng)
    goal = grasp.opened.copy()
    goal[:3] = placed.position + placed.rotation.apply(grasp.opened[:3])
    turned = placed.rotation * Rotation.from_quat(grasp.opened[3:7], scalar_first=True)
    goal[3:7] = turned.as_quat(scalar_first=True)
    ends = Rotation.from_quat(np.array([rest[3:7], goal[3:7]]), scalar_first=True)
    turn = Slerp([0.0, 1.0], ends)

    def depth(path: Curve, n: int) -> float:
        """Return how much deeper than allowed the hand runs into object or table [m]."""
        s = np.linspace(0, 1, n)
        share = progress(s, 0, TURNING)
        q = rest + share[:, None] * (goal - rest)
        q[:, :3] = path.at(progress(s, 0, 1))
        q[:, 3:7] = turn(share).as_quat(scalar_first=True)
        points = hand.points_of(q)[:, : hand.n_solid]
        inside = placed.rotation.inv().apply((points - placed.position).reshape(-1, 3)).reshape(points.shape)
        gap = surface.distance(inside) - hand.radii[: hand.n_solid]
        allowed = np.where(np.arange(hand.n_solid) < N_SITES, BRUSH, FLESH_LIMIT)
        table = points[..., 2] - hand.radii[: hand.n_solid]
        return float(max(-(gap + allowed).min(), -table.min() - BRUSH))

    way_out = placed.rotation.apply(grasp.way_out)
    back = hand.hand.forward(goal).rotations[1][:, 2]
    path = find_path(rest[:3], goal[:3], way_out, back, depth)
    return None if path is None else Journey(rest, path, turn)


def rest_pose(hand: PlanningHand, rng: np.random.Generator) -> Floats:
    """Return a relaxed hand that lies on the table in front of the subject, shape (30,)."""
    mirror = 1.0 if hand.side is Side.RIGHT else -1.0
    limits = hand.hand.joint_range
    angles = np.deg2rad([RELAXED.get(joint, 0.0) for joint in JOINT_ANGLES])
    q = hand.hand.neutral()
    q[7:] = np.clip(angles + np.deg2rad(3) * rng.standard_normal(23), limits[:, 0], limits[:, 1])
    heading = 90 + mirror * 15 + 4 * rng.standard_normal()
    slope = 12 + 2 * rng.standard_normal()
    q[3:7] = Rotation.from_euler("ZY", [heading, slope], degrees=True).as_quat(scalar_first=True)
    q[:2] = [mirror * rng.uniform(0.08, 0.14), rng.uniform(-0.44, -0.38)]
    height = hand.points_of(q[None])[0, :, 2] - hand.radii
    q[2] -= height[: hand.n_solid].min() - 0.001
    return q
