"""A type from the GRASP taxonomy, where contacts and posture tell it.

The taxonomy (Feix, Romero, Schmiedmayer, Dollar and Kragic 2016, IEEE Trans. Human-Machine Systems 46, 66)
arranges 33 types by opposition, virtual fingers, power or precision, and the thumb's position; types that
share a place differ by the object's size and shape. Each of these is judged as a probability of its own,
from contacts and joint angles; a type's weight is their product, and its confidence is its share of all
weights. It is to be read as a cautious probability that the type is right: of simulated grasps of known kinds
those that got a type were right more often than it says (docs/measurements.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.contact import Contacts
from graspdb_ingest.opposition import KINDS, PALM_SITES, Opposition
from graspdb_ingest.surface import HandPoints
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, DIGITS, FINGERS, SITES

LEAST_CONFIDENCE: Final = 0.5
"""A type that has less than half of the evidence is not told."""
OTHER: Final = 0.01
"""Weight of all that the rules do not foresee: weak evidence for everything names nothing."""
MEMBER: Final = {"opposes": 0.9, "touches": 0.75, "away": 0.05}
"""Probability that a digit, or the palm, belongs to the virtual fingers, by what it does."""
EITHER: Final = 0.5
"""The same of the palm in a hook, which may pull on the fingers alone, and of the thumb where fingers press
against the palm: it closes the ring, from either side."""
SIZES: Final = (0.03, 0.06)
"""Between small and medium, and medium and large things, by the distance across the grasp [m]."""
SIZE_SPREAD: Final = 0.006
ABDUCTION: Final = (np.deg2rad(15.0), np.deg2rad(7.0))
"""Angle of the thumb's metacarpal out of the plane of the palm half-way between lying in it and standing
abducted, up to some 45 degrees, and its spread [rad]."""
HOOKED: Final = (np.deg2rad(100.0), np.deg2rad(12.0))
"""Flexion of a finger's two joints together, above which it goes round a bar, and its spread [rad]."""
NUMBERS: Final = {"palm": "P", **{digit: str(i) for i, digit in enumerate(DIGITS, start=1)}}

Manner = Literal["power", "precision", "intermediate"]


@dataclass(frozen=True)
class GraspType:
    """A place in the taxonomy, in the terms that contacts tell.

    Attributes
    ----------
    name : str
        The type's name.
    opposition : str
        pad, palm or side.
    manner : str
        power, precision or intermediate.
    first, second : str
        The virtual fingers: P for the palm, 1 for the thumb to 5 for the little finger.
    abducted : bool or None
        Whether the thumb is abducted, so that it can oppose the fingers; None where it has no part.
    size : str or None
        small, medium or large, where that tells types apart.
    round_ : bool or None
        Whether the fingers stand round the object, or side by side; None where either may be.
    """

    name: str
    opposition: str
    manner: Manner
    first: str
    second: str
    abducted: bool | None
    size: str | None = None
    round_: bool | None = None


TYPES: Final = (
    GraspType("large diameter", "palm", "power", "P", "2345", True, "large", False),
    GraspType("medium wrap", "palm", "power", "P", "2345", True, "medium", False),
    GraspType("small diameter", "palm", "power", "P", "2345", True, "small", False),
    GraspType("power sphere", "palm", "power", "P", "2345", True, None, True),
    GraspType("fixed hook", "palm", "power", "P", "2345", False, None, False),
    GraspType("index finger extension", "palm", "power", "P", "345", False, None, False),
    GraspType("palmar pinch", "pad", "precision", "1", "2", True),
    GraspType("ring", "pad", "power", "1", "2", True),
    GraspType("prismatic 2 finger", "pad", "precision", "1", "23", True, None, False),
    GraspType("tripod", "pad", "precision", "1", "23", True, None, True),
    GraspType("prismatic 3 finger", "pad", "precision", "1", "234", True, None, False),
    GraspType("quadpod", "pad", "precision", "1", "234", True, None, True),
    GraspType("prismatic 4 finger", "pad", "precision", "1", "2345", True, None, False),
    GraspType("precision sphere", "pad", "precision", "1", "2345", True, None, True),
    GraspType("sphere 3 finger", "pad", "power", "1", "23", True, None, True),
    GraspType("sphere 4 finger", "pad", "power", "1", "234", True, None, True),
    GraspType("distal type", "pad", "power", "1", "23", True, None, False),
    GraspType("extension type", "pad", "power", "1", "2345", True, None, False),
    GraspType("lateral", "side", "intermediate", "1", "2", False),
    GraspType("lateral tripod", "side", "intermediate", "1", "3", False),
    GraspType("adduction grip", "side", "intermediate", "2", "3", None),
)
"""Types that contacts can tell. Others of the 33 differ from one of these by what contacts do not show."""


@dataclass(frozen=True)
class TypedGrasp:
    """The type of a grasp.

    Attributes
    ----------
    name : str or None
        Name of the type; None where no type has half of the evidence.
    confidence : float or None
        Its share of the evidence.
    """

    name: str | None
    confidence: float | None


@dataclass(frozen=True)
class _Evidence:
    """What a grasp says of each of the taxonomy's marks, as probabilities.

    Attributes
    ----------
    oppositions : mapping of str to float
        Of pad, palm and side opposition.
    members : mapping of str to float
        That the palm and each digit belong to the virtual fingers, by their numbers.
    power, abducted, around, hooked : float
        That it is a power grasp; that the thumb is abducted; that the fingers stand round the object; that
        they are flexed round a bar.
    sizes : mapping of str to float
        That the object is small, medium or large.
    """

    oppositions: Mapping[str, float]
    members: Mapping[str, float]
    power: float
    abducted: float
    around: float
    hooked: float
    sizes: Mapping[str, float]


def grasp_type(contacts: Contacts, opposition: Opposition, hand: HandPoints) -> TypedGrasp:
    """Return the type of a grasp and how much of the evidence it has.

    Parameters
    ----------
    contacts, opposition : Contacts, Opposition
        What touches, and what opposes.
    hand : HandPoints
        The hand at that instant.
    """
    evidence = _evidence(contacts, opposition, hand)
    if evidence is None:
        return TypedGrasp(None, None)
    weights = np.array([_weight(kind, evidence) for kind in TYPES])
    best = int(weights.argmax())
    confidence = float(weights[best] / (weights.sum() + OTHER))
    if confidence < LEAST_CONFIDENCE:
        return TypedGrasp(None, None)
    return TypedGrasp(TYPES[best].name, confidence)


def _evidence(contacts: Contacts, opposition: Opposition, hand: HandPoints) -> _Evidence | None:
    """Return the evidence of a grasp; None where nothing opposes and no fingers hook."""
    hooked = _hooked(contacts, hand)
    if opposition.kind is None and hooked < 0.5:
        return None
    sizes = dict(zip(("small", "medium", "large"), _sizes(contacts, opposition), strict=True))
    return _Evidence(
        oppositions=_oppositions(contacts, opposition, hooked),
        members=_memberships(contacts, opposition),
        power=max(_inner(contacts), hooked),
        abducted=_abducted(opposition, hand),
        around=min(_around(contacts), 1 - hooked),  # a bar, not a ball
        hooked=hooked,
        sizes=sizes,
    )


def _weight(kind: GraspType, evidence: _Evidence) -> float:
    weight = evidence.oppositions[kind.opposition]
    for number, member in evidence.members.items():
        if (number == "P" and kind.name == "fixed hook") or (number == "1" and kind.opposition == "palm"):
            weight *= EITHER
        else:
            weight *= member if number in (*kind.first, *kind.second) else 1 - member
    if kind.manner != "intermediate":
        weight *= evidence.power if kind.manner == "power" else 1 - evidence.power
    if kind.abducted is not None:
        weight *= evidence.abducted if kind.abducted else 1 - evidence.abducted
    if kind.size is not None:
        weight *= evidence.sizes[kind.size]
    if kind.name == "extension type":
        weight *= 1 - evidence.hooked
    if kind.round_ is not None:
        weight *= evidence.around if kind.round_ else 1 - evidence.around
    return weight


def _oppositions(contacts: Contacts, opposition: Opposition, hooked: float) -> dict[str, float]:
    """Return the probability of each opposition: what opposes, a palm that touches, fingers that hook.

    The side of the hand that the load comes from need not touch: in a hook it is the palm's.
    """
    shares = {kind: opposition.shares.get(kind, 0.0) for kind in KINDS}
    for kind in KINDS:
        if kind == opposition.kind:
            shares[kind] = max(shares[kind], 0.5)
    palm = np.mean([SITES[site] in PALM_SITES[1:] for site in contacts.sites]) > 0
    shares["palm"] += max(float(palm), hooked)
    total = sum(shares.values())
    return {kind: share / total for kind, share in shares.items()}


def _memberships(contacts: Contacts, opposition: Opposition) -> dict[str, float]:
    """Return the probability that the palm and each digit belong to the virtual fingers."""
    opposing = {name for group in opposition.virtual_fingers[:2] for name in group}
    touching = {*contacts.digits}
    if any(SITES[site] in PALM_SITES[1:] for site in contacts.sites):
        touching.add("palm")
    return {
        number: MEMBER["opposes" if name in opposing else "touches" if name in touching else "away"]
        for name, number in NUMBERS.items()
    }


def _inner(contacts: Contacts) -> float:
    """Return the probability of a power grasp: twice the share of contacts away from the digits' ends."""
    ends = ("_tip", "_dip", "thumb_ip")
    return min(1.0, 2 * float(np.mean([not SITES[site].endswith(ends) for site in contacts.sites])))


def _hooked(contacts: Contacts, hand: HandPoints) -> float:
    """Return the probability that fingers which touch go round a bar; at least two have to."""
    bones = hand.digit_axes[:, :, 0]
    turns = np.arccos(np.clip(np.sum(bones[:, :-1] * bones[:, 1:], axis=-1), -1, 1)).sum(axis=-1)
    own = sorted((turns[DIGITS.index(digit)] for digit in contacts.digits if digit in FINGERS), reverse=True)
    return _above(float(np.mean(own)), HOOKED) if len(own) > 1 else 0.0


def _abducted(opposition: Opposition, hand: HandPoints) -> float:
    """Return the probability that the thumb is abducted; in side opposition it lies beside the fingers."""
    metacarpal = hand.site("thumb_mcp") - hand.site("thumb_cmc")
    out = float(np.arcsin(np.clip(-metacarpal @ hand.palm_axes[2] / np.linalg.norm(metacarpal), -1, 1)))
    posture = _above(out, ABDUCTION)
    return min(posture, 0.2) if opposition.kind == "side" else posture


def _above(value: float, limit: tuple[float, float]) -> float:
    """Return a logistic step at a limit with a spread."""
    return float(1 / (1 + np.exp((limit[0] - value) / limit[1])))


def _sizes(contacts: Contacts, opposition: Opposition) -> tuple[float, float, float]:
    """Return the probabilities of a small, medium and large distance across the grasp."""
    first, second = (_members(contacts, group) for group in opposition.virtual_fingers[:2])
    if not len(first) or not len(second):
        return 1 / 3, 1 / 3, 1 / 3
    start, push = contacts.positions[first].mean(axis=0), -contacts.normals[first].mean(axis=0)
    push = push / max(float(np.linalg.norm(push)), 1e-9)
    across = float(np.max((contacts.positions[second] - start) @ push))
    above = 1 / (1 + np.exp((np.array(SIZES) - across) / SIZE_SPREAD))
    return float(1 - above[0]), float(above[0] * (1 - above[1])), float(above[0] * above[1])


def _around(contacts: Contacts) -> float:
    """Return the probability that the fingers stand round the object, not side by side.

    Fingers side by side push alike: the mean of their directions has length 1; three round a ball, a
    quarter of a turn apart, 0.8.
    """
    pushes = []
    for finger in FINGERS:
        own = _members(contacts, (finger,))
        if len(own):
            mean = -contacts.normals[own].mean(axis=0)
            pushes.append(mean / max(float(np.linalg.norm(mean)), 1e-9))
    if len(pushes) < 2:
        return 0.5
    together = float(np.linalg.norm(np.mean(pushes, axis=0)))
    return float(np.clip((0.97 - together) / 0.17, 0.05, 0.95))


def _members(contacts: Contacts, group: tuple[str, ...]) -> NDArray[np.int64]:
    """Return which contacts belong to some digits, or to the palm."""
    mask = [
        ("palm" in group and SITES[site] in PALM_SITES)
        or (DIGIT_OF_SITE[site] in group and SITES[site] not in PALM_SITES)
        for site in contacts.sites
    ]
    return np.flatnonzero(mask)
