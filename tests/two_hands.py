"""A simulated recording of two hands on one object, each with a grasp of its own.

Both hands grasp the same object in trials of their own. The object moves as it did in the first; the
second hand keeps the place relative to the object that it had in its own trial, at the times at which
it did there what the first does here.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from graspdb.simulate.kinds import PLANS
from graspdb.simulate.measurement import NoiseParameters, measure
from graspdb.simulate.motion import Events, Motion
from graspdb.simulate.objects import OBJECTS
from graspdb.simulate.subjects import SimulatedSubject, draw_subject, placements_of
from graspdb.simulate.trial import attempt
from graspdb.simulate.writer import write_c3d, write_object
from graspdb_schemas.vocabulary import SITES, Side

Floats = NDArray[np.float64]
SIDES = (Side.RIGHT, Side.LEFT)
TOUCH = 0.0005


@dataclass(frozen=True)
class TwoHands:
    """What happened: times, and for each side the spheres' centres [m] and which touch at the lift."""

    folder: Path
    times: Floats
    sites: dict[Side, Floats]
    contacts: dict[Side, tuple[str, ...]]
    labels: tuple[str, ...]
    events: Events


def simulate_two_hands(
    folder: Path, noise: NoiseParameters, seed: int = 2, rate: float = 120.0, away: float = 0.0
) -> TwoHands:
    """Write a session with one trial of a bottle, held at its side and at its cap.

    Parameters
    ----------
    folder : Path
        Folder to write.
    noise : NoiseParameters
        What the measurement does to the markers.
    seed : int
        Draws everything.
    rate : float
        Frames per second [Hz].
    away : float
        Share of the trial, at its beginning, in which no marker of the left hand is seen.
    """
    body = OBJECTS["bottle"](np.random.default_rng([seed, 0]))
    plans = {plan.kind: plan for plan in PLANS["bottle"](body.measures)}
    people = _person(np.random.default_rng([seed, 1]))
    motions = {}
    for side, kind in zip(SIDES, ("cap_top", "side_power"), strict=True):
        rng = np.random.default_rng([seed, 2, int(side is Side.LEFT)])
        motions[side] = attempt(people[side], body, plans[kind], rng, rate).motion
    first = motions[Side.RIGHT]
    q = {Side.RIGHT: first.q, Side.LEFT: _carried(motions[Side.LEFT], first)}
    poses = {side: people[side].hand.forward(q[side]) for side in SIDES}
    turned = Rotation.from_quat(first.object_rotation, scalar_first=True).as_matrix()
    moved = first.object_position[:, None]
    on_object = moved + np.einsum("fij,mj->fmi", turned, body.markers)
    labels = tuple(f"{side}_{label}" for side in SIDES for label in people[side].hand.markers)
    labels += body.marker_labels
    true = np.concatenate([*(poses[side].markers for side in SIDES), on_object], axis=1)
    recorded = measure(true, labels, noise, rate, np.random.default_rng([seed, 3])).positions
    left = [label.startswith("left_") for label in labels]
    recorded[: round(away * len(recorded)), left] = np.nan
    onset = int(np.searchsorted(first.times, first.events.lift))
    contacts = {}
    for side in SIDES:
        inside = np.einsum("fji,fkj->fki", turned, poses[side].sites - moved)[onset]
        gap = body.surface.distance(inside[None])[0] - people[side].hand.radii
        contacts[side] = tuple(SITES[k] for k in np.flatnonzero(gap < TOUCH))
    (folder / "trials").mkdir(parents=True)
    write_object(folder, body)
    write_c3d(folder / "trials/both.c3d", labels, recorded, rate)
    _write_manifest(folder, people[Side.RIGHT], body)
    sites = {side: poses[side].sites for side in SIDES}
    return TwoHands(folder, first.times, sites, contacts, labels, first.events)


def _person(rng: np.random.Generator) -> dict[Side, SimulatedSubject]:
    """Return the two hands of one person, the forearms' markers at mirrored places."""
    drawn = replace(draw_subject("s1", rng), side=Side.RIGHT)
    forearm = {k: p.offset for k, p in drawn.placements.items() if p.offset is not None}
    mirrored = {label: (x, -y, z) for label, (x, y, z) in forearm.items()}
    return {
        Side.RIGHT: drawn,
        Side.LEFT: replace(drawn, side=Side.LEFT, placements=placements_of(mirrored)),
    }


def _carried(own: Motion, first: Motion) -> Floats:
    """Return the configurations of the second hand, relative to the object as in its own trial."""
    knots = [np.array([0.0, *vars(m.events).values()]) for m in (first, own)]
    when = np.clip(np.interp(first.times, *knots), own.times[0], own.times[-1])
    mine = Rotation.from_quat(own.object_rotation, scalar_first=True)
    forearm = Rotation.from_quat(own.q[:, 3:7], scalar_first=True)
    relative = mine.inv().apply(own.q[:, :3] - own.object_position)
    turned = Slerp(own.times, mine.inv() * forearm)(when)
    theirs = Rotation.from_quat(first.object_rotation, scalar_first=True)
    q = np.stack([np.interp(when, own.times, column) for column in own.q.T], axis=1)
    place = np.stack([np.interp(when, own.times, column) for column in relative.T], axis=1)
    q[:, :3] = first.object_position + theirs.apply(place)
    q[:, 3:7] = (theirs * turned).as_quat(scalar_first=True)
    return q


def _write_manifest(folder: Path, person: SimulatedSubject, body: Any) -> None:
    size = person.dimensions
    manifest = {
        "graspdb_session": 1,
        "id": "two-hands",
        "units": "mm",
        "up": [0, 0, 1],
        "subjects": {
            "s1": {
                "hand": "both",
                "hand_length": 1000 * size.hand_length,
                "hand_breadth": 1000 * size.hand_breadth,
                "joint_thickness": {site: 1000 * t for site, t in size.joint_thickness.items()},
            }
        },
        "objects": {
            "bottle": {
                "mesh": "objects/bottle.stl",
                "markers": {
                    label: (1000 * place).tolist()
                    for label, place in zip(body.marker_labels, body.markers, strict=True)
                },
                "mass": 0.5,
            }
        },
        "trials": [{"file": "trials/both.c3d", "subject": "s1", "object": "bottle", "task": "lift"}],
    }
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
