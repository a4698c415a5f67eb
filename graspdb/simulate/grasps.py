"""Grasps: from a plan to a hand that has closed on the real surface, and that could get there."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb.simulate.arrays import Floats
from graspdb.simulate.closing import close
from graspdb.simulate.kinds import Plan
from graspdb.simulate.objects import SimulatedObject
from graspdb.simulate.opening import between, find_opening, is_free
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb.simulate.posing import Intent, clipped, solve
from graspdb.simulate.surface import Surface
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, DIGITS, JOINT_ANGLES, N_SITES, SITES, Side

TOUCH: Final = 0.0005
"""A sphere whose gap is less than this touches [m]."""

FREEDOM: Final = np.deg2rad(
    [12 if "wrist" in j else 8 if "abduction" in j and "thumb" not in j else 20 for j in JOINT_ANGLES]
)
"""How far joints go from a plan's posture: wrist, spreading of the fingers, the rest [rad]."""

TRIES: Final = 30

VARIETY: Final = 0.3
"""Share of the usual variation by which a person's first grasp of a kind departs from the plan."""


@dataclass(frozen=True)
class Grasp:
    """A hand that holds an object, in the object's frame.

    Attributes
    ----------
    kind : str
        Kind of grasp.
    q, opened : ndarray, shape (30,)
        The closed hand, and the open one around the object.
    way_out : ndarray, shape (3,)
        Direction in which the opened hand leaves.
    gaps : ndarray, shape (20,)
        Signed distance of each sphere to the surface [m].
    """

    kind: str
    q: Floats
    opened: Floats
    way_out: Floats
    gaps: Floats

    @property
    def contacts(self) -> tuple[str, ...]:
        """The sites that touch."""
        return tuple(SITES[k] for k in np.flatnonzero(self.gaps < TOUCH))


class NoGraspError(GraspDBError):
    """No hand pose was found that grasps an object as planned."""

    def __init__(self, object_name: str, kind: str) -> None:
        self.object_name = object_name
        self.kind = kind
        super().__init__(
            f"no grasp of kind {kind!r} was found on the {object_name} for this hand. "
            "Use another seed, or leave this kind out with kinds."
        )


def find_grasp(
    hand: PlanningHand,
    body: SimulatedObject,
    plan: Plan,
    rng: np.random.Generator,
    near: Grasp | None = None,
    variety: float = VARIETY,
) -> Grasp:
    """Return a grasp of one kind: begun as planned, fitted, opened, and closed on the surface.

    Parameters
    ----------
    hand : PlanningHand
        The hand.
    body : SimulatedObject
        The object.
    plan : Plan
        The kind of grasp.
    rng : numpy.random.Generator
        Varies place and posture.
    near : Grasp or None
        An earlier grasp of the same kind by the same hand, to vary.
    variety : float
        How far the hand's own way of grasping is from the plan, where there is no earlier grasp: with 1 by
        5 degrees of a joint, 4 degrees and 4 mm of the hand, standard deviations.

    Raises
    ------
    NoGraspError
        If none of several tries gives a grasp in which no sphere is inside the object, the thumb
        and another digit touch from different sides, and the hand can open and leave.
    """
    start = begin(hand, plan) if near is None else near.q
    base = _intent(hand, body, plan, start)
    for number in range(TRIES):
        own = 1.0 if near is not None else variety if number == 0 else max(variety, 1.0)
        amount = own + number / 8
        intent, moved = _varied(base, start, rng, amount)
        planned = solve(hand, body.surface, intent, clipped(hand, moved))
        grasp = _closed(hand, body.surface, plan, planned)
        if grasp is not None:
            return grasp
    raise NoGraspError(body.name, plan.kind)


def begin(hand: PlanningHand, plan: Plan) -> Floats:
    """Return the configuration that a plan begins with, shape (30,)."""
    mirror = np.array([1.0, 1.0 if hand.side is Side.RIGHT else -1.0, 1.0])
    dorsal = -mirror * np.array(plan.palm, dtype=float)
    distal = mirror * np.array(plan.fingers, dtype=float)
    dorsal /= np.linalg.norm(dorsal)
    distal -= dorsal * (distal @ dorsal)
    distal /= np.linalg.norm(distal)
    object_from_hand = Rotation.from_matrix(np.column_stack([distal, np.cross(dorsal, distal), dorsal]))
    q = hand.hand.neutral()
    q[7:] = plan.start_angles()
    pose = hand.hand.forward(q)
    position, rotation = pose.positions[1], Rotation.from_matrix(pose.rotations[1])
    if plan.focus is not None:
        focus = position + rotation.apply(mirror * np.array(plan.focus) * hand.dimensions.hand_length)
    else:
        tips = [SITES.index(c) for c in plan.contacts if c.endswith("_tip") and not c.startswith("thumb")]
        focus = (pose.sites[SITES.index("thumb_tip")] + pose.sites[tips].mean(axis=0)) / 2
    turn = object_from_hand * rotation.inv()
    q[:3] = mirror * np.array(plan.centre) - turn.apply(focus - q[:3])
    q[3:7] = (turn * Rotation.from_quat(q[3:7], scalar_first=True)).as_quat(scalar_first=True)
    return q


def _intent(hand: PlanningHand, body: SimulatedObject, plan: Plan, start: Floats) -> Intent:
    points = hand.points_of(start[None])[0]
    mirror = np.array([1.0, 1.0 if hand.side is Side.RIGHT else -1.0, 1.0])
    return Intent(
        contacts=plan.contacts,
        posture=plan.angles(),
        posture_sd=FREEDOM,
        knuckles=points[[len(points) - 2, SITES.index("index_mcp"), SITES.index("little_mcp")]],
        elevation=np.deg2rad(plan.elevation),
        aims={site: mirror * np.array(aim) for site, aim in plan.aims.items()},
        target=body.surface if plan.part is None else Surface((body.parts[plan.part],)),
    )


def _varied(intent: Intent, start: Floats, rng: np.random.Generator, amount: float) -> tuple[Intent, Floats]:
    """Return what a person does the next time, and where from: elsewhere, turned, another posture.

    The start moves along with the intent. A start in touch with the surface would hold the hand there.
    """
    turn = Rotation.from_rotvec(amount * np.deg2rad(4) * rng.standard_normal(3))
    shift = amount * 0.004 * rng.standard_normal(3)
    bend = amount * 0.25 * intent.posture_sd * rng.standard_normal(len(intent.posture))
    middle = intent.knuckles.mean(axis=0)
    moved = start.copy()
    moved[:3] = middle + shift + turn.apply(start[:3] - middle)
    moved[3:7] = (turn * Rotation.from_quat(start[3:7], scalar_first=True)).as_quat(scalar_first=True)
    moved[7:] += bend
    varied = replace(
        intent,
        posture=intent.posture + bend,
        knuckles=middle + shift + turn.apply(intent.knuckles - middle),
        elevation=intent.elevation + amount * np.deg2rad(4) * float(rng.standard_normal()),
        aims={site: aim + amount * 0.003 * rng.standard_normal(3) for site, aim in intent.aims.items()},
    )
    return varied, moved


def _closed(hand: PlanningHand, surface: Surface, plan: Plan, planned: Floats) -> Grasp | None:
    digits = tuple(d for d in DIGITS if any(c.startswith(d) for c in plan.contacts))
    opening = find_opening(hand, surface, planned, digits)
    if opening is None:
        return None
    q = close(hand, surface, opening.q, planned, digits)
    points = hand.points_of(q[None])[0, : hand.n_solid]
    if not is_free(hand, surface, between(opening.q, q, 12)):
        return None
    near = surface.nearest(points)
    gaps = near.distance - hand.radii[: hand.n_solid]
    touching = gaps[:N_SITES] < TOUCH
    if (
        not _holds(touching, near.normal[:N_SITES])
        or gaps[:N_SITES].min() < -TOUCH
        or gaps.min() < -FLESH_LIMIT - 1e-5
    ):
        return None
    return Grasp(plan.kind, q, opening.q, opening.way_out, gaps[:N_SITES])


def _holds(touching: NDArray[np.bool_], normals: Floats) -> bool:
    """Return whether the thumb and another digit touch from sides that face each other."""
    thumb = touching & (np.array(DIGIT_OF_SITE) == "thumb")
    others = touching & ~thumb
    if not thumb.any() or not others.any():
        return False
    return bool((normals[thumb] @ normals[others].T).min() < 0.2)
