"""One simulated trial: a grasp performed, its truth, and its recording."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb.simulate.arrays import Floats
from graspdb.simulate.grasps import TOUCH, VARIETY, Grasp, NoGraspError, find_grasp
from graspdb.simulate.kinds import Plan
from graspdb.simulate.measurement import Measured, NoiseParameters, measure, skin_movement
from graspdb.simulate.motion import Motion, perform
from graspdb.simulate.objects import SimulatedObject
from graspdb.simulate.subjects import SimulatedSubject
from graspdb.simulate.truth import TrialTruth
from graspdb_schemas.vocabulary import SITES

TRIES: Final = 10
"""How many variations of a grasp are tried until one can be reached."""


@dataclass(frozen=True)
class Attempt:
    """A grasp, and the movement that performs it."""

    grasp: Grasp
    motion: Motion


@dataclass(frozen=True)
class SimulatedTrial:
    """A trial's truth and what was measured of it.

    Attributes
    ----------
    truth : TrialTruth
        What happened.
    measured : Measured
        What was recorded, markers in the order of the truth's labels.
    """

    truth: TrialTruth
    measured: Measured


def attempt(
    subject: SimulatedSubject,
    body: SimulatedObject,
    plan: Plan,
    rng: np.random.Generator,
    rate: float,
    near: Grasp | None = None,
    variety: float = VARIETY,
) -> Attempt:
    """Return a grasp that can be reached and lifted with, near an earlier one of its kind if there is one.

    Raises
    ------
    NoGraspError
        If none is found.
    """
    hand = subject.planning
    for number in range(TRIES):
        grasp = find_grasp(hand, body, plan, rng, near if number % 2 == 0 else None, variety)
        if not plan.exact or {c.split("_")[0] for c in grasp.contacts} == {
            c.split("_")[0] for c in plan.contacts
        }:
            motion = perform(hand, body.surface, grasp, rng, rate)
            if motion is not None:
                return Attempt(grasp, motion)
    raise NoGraspError(body.name, plan.kind)


def record(
    name: str,
    subject: SimulatedSubject,
    body: SimulatedObject,
    done: Attempt,
    repetition: int,
    noise: NoiseParameters,
    rate: float,
    rng: np.random.Generator,
) -> SimulatedTrial:
    """Return the truth of an attempt and its measurement."""
    motion = done.motion
    rotation = Rotation.from_quat(motion.object_rotation, scalar_first=True).as_matrix()
    pose = subject.hand.forward(motion.q)
    markers = pose.markers[:, subject.marker_columns()] + _skin(subject, motion.q, noise, rate, rng)
    on_object = motion.object_position[:, None] + np.einsum("fij,mj->fmi", rotation, body.markers)
    gap = body.surface.distance(in_object(motion, pose.sites)) - subject.hand.radii
    labels = (*subject.placements, *body.marker_labels)
    true = np.concatenate([markers, on_object], axis=1)
    measured = measure(true, labels, noise, rate, rng)
    onset = int(np.searchsorted(motion.times, motion.events.lift))
    truth = TrialTruth(
        trial=name,
        subject=subject.name,
        object=body.name,
        kind=done.grasp.kind,
        repetition=repetition,
        side=subject.side,
        times=motion.times,
        q=motion.q,
        sites=pose.sites,
        marker_labels=labels,
        markers=true,
        object_position=motion.object_position,
        object_rotation=motion.object_rotation,
        gap=gap,
        contact=gap < TOUCH,
        occluded=measured.occluded,
        swaps=measured.swaps,
        events=motion.events,
        contacts=tuple(SITES[k] for k in np.flatnonzero(gap[onset] < TOUCH)),
    )
    return SimulatedTrial(truth, measured)


def in_object(motion: Motion, points: Floats) -> Floats:
    """Return points of the lab frame, (n_frames, n, 3), in the object's frame [m]."""
    rotation = Rotation.from_quat(motion.object_rotation, scalar_first=True).as_matrix()
    return np.asarray(np.einsum("fji,fkj->fki", rotation, points - motion.object_position[:, None]))


def _skin(
    subject: SimulatedSubject, q: Floats, noise: NoiseParameters, rate: float, rng: np.random.Generator
) -> Floats:
    """Return the skin movement of the hand's markers: along and across their segments [m]."""
    hand = subject.hand
    segments = [hand.segments.index(placement.segment) for placement in subject.placements.values()]
    axes = hand.forward(q).rotations[:, segments][..., :2]
    pulling = subject.pulling_angles()
    return skin_movement(axes, q[:, 7:][:, pulling], hand.joint_range[pulling], noise, rate, rng)
