"""Simulated grasps of planned kinds, the types of the GRASP taxonomy that each may be, and what is told."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb.simulate.grasps import NoGraspError, find_grasp
from graspdb.simulate.kinds import PLANS
from graspdb.simulate.objects import OBJECTS, SimulatedObject
from graspdb.simulate.planning import PlanningHand
from graspdb_ingest.hand import HandDimensions, build_hand
from graspdb_ingest.objects.cloud import sample_cloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.opposition import find_opposition
from graspdb_ingest.parameters import ContactParameters
from graspdb_ingest.surface import HandPoints, key_points
from graspdb_ingest.surface.touch import pose_hand, touching
from graspdb_ingest.taxonomy import TypedGrasp, grasp_type
from graspdb_schemas.vocabulary import Side

RIGHT: Final[Mapping[str, frozenset[str]]] = {
    "side_precision": frozenset({"prismatic 4 finger"}),
    "neck": frozenset({"prismatic 4 finger", "precision sphere"}),
    "cap_top": frozenset({"quadpod"}),
    "cap_side": frozenset({"prismatic 2 finger"}),
    "rim": frozenset({"prismatic 2 finger", "tripod", "palmar pinch"}),
    "top": frozenset({"precision sphere"}),
    "side_power": frozenset({"large diameter", "medium wrap"}),
    "handle": frozenset({"fixed hook", "medium wrap", "small diameter"}),
}
"""Types that a kind's plan describes, by its digits and what they do. All five tips round a cone may stand as
on a bar or as on a ball, two fingers on a rim as either or as one; things of 60 mm lie between two sizes."""


@dataclass(frozen=True)
class Told:
    """The type that was told of a grasp of a known kind."""

    object: str
    kind: str
    typed: TypedGrasp

    @property
    def right(self) -> bool:
        """Whether the kind may be called that."""
        return self.typed.name in RIGHT[self.kind]


def told_types(lengths: tuple[float, ...], seed: int) -> Iterator[Told]:
    """Yield what is told of every kind of grasp, by hands of some lengths [m], on objects drawn for each."""
    for number, length in enumerate(lengths):
        rng = np.random.default_rng([seed, number])
        dimensions = HandDimensions(length, 0.449 * length)
        planning, hand = PlanningHand(dimensions, Side.RIGHT), build_hand(dimensions, Side.RIGHT, {})
        for name, make in OBJECTS.items():
            body = make(rng)
            target = target_of(body)
            for plan in PLANS[name](body.measures):
                try:
                    q = find_grasp(planning, body, plan, rng).q
                except NoGraspError:  # not every hand finds every grasp
                    continue
                points = key_points(hand.palm(q)[0], hand.forward(q).sites)
                posed = pose_hand(HandPoints(points[None], hand.radii, Side.RIGHT), "spheres", target).frame(
                    0
                )
                contacts = touching(posed, ContactParameters().threshold, target)
                yield Told(name, plan.kind, grasp_type(contacts, find_opposition(contacts), posed.points))


def target_of(body: SimulatedObject) -> ObjectDistance:
    """Return a simulated object as contact sees it."""
    mesh = body.mesh
    surface = Surface(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces, dtype=np.int64),
        normals=None,
        area=float(mesh.area),
        volume=float(mesh.volume),
        extents=np.ptp(mesh.vertices, axis=0),
        watertight=True,
        sha256="",
        warnings=(),
    )
    return ObjectDistance(surface, sample_cloud(surface))
