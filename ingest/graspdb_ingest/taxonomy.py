"""A type from the GRASP taxonomy, where the contacts tell it.

The taxonomy (Feix, Romero, Schmiedmayer, Dollar and Kragic 2016, IEEE Trans. Human-Machine Systems 46, 66)
arranges 33 types by opposition, virtual fingers, power or precision, and the thumb's position; types that
share a place differ by the object's size and shape. Each of these is judged from the contacts as a
probability of its own, a type's weight is their product, and its confidence is its share of all weights.
It says how far the evidence tells the types apart, under the stated rules; it is not a measured frequency.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.contact import Contacts
from graspdb_ingest.opposition import PALM_SITES, Opposition
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, SITES

LEAST_CONFIDENCE: Final = 0.5
"""A type that has less than half of the evidence is not told."""
OTHER: Final = 0.02
"""Weight of all that the rules do not foresee: weak evidence for everything names nothing."""
DIGIT_ERROR: Final = 0.1
"""How often a digit is taken for opposing that does not, or the other way round."""
SIZES: Final = (0.03, 0.06)
"""Between small and medium, and medium and large things, by the distance across the grasp [m]."""
SIZE_SPREAD: Final = 0.006

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


def grasp_type(contacts: Contacts, opposition: Opposition) -> TypedGrasp:
    """Return the type of a grasp and how much of the evidence it has."""
    if opposition.kind is None:
        return TypedGrasp(None, None)
    weights = np.array([_weight(kind, contacts, opposition) for kind in TYPES])
    best = int(weights.argmax())
    confidence = float(weights[best] / (weights.sum() + OTHER))
    if confidence < LEAST_CONFIDENCE:
        return TypedGrasp(None, None)
    return TypedGrasp(TYPES[best].name, confidence)


def _weight(kind: GraspType, contacts: Contacts, opposition: Opposition) -> float:
    share = opposition.shares[kind.opposition]
    if kind.opposition == opposition.kind:
        share = max(share, 0.5)  # the chosen opposition leads, even where others go with it
    weight = share * _fingers(kind, opposition) * _manner(kind, contacts) * _thumb(kind, contacts, opposition)
    if kind.size is not None:
        weight *= dict(zip(("small", "medium", "large"), _sizes(contacts, opposition), strict=True))[
            kind.size
        ]
    if kind.round_ is not None:
        around = _around(contacts, opposition)
        weight *= around if kind.round_ else 1 - around
    return weight


def _fingers(kind: GraspType, opposition: Opposition) -> float:
    """Return how well the virtual fingers are the type's: the odds of each digit that differs."""
    numbers = {"palm": "P", "thumb": "1", "index": "2", "middle": "3", "ring": "4", "little": "5"}
    found = {numbers[digit] for group in opposition.virtual_fingers[:2] for digit in group}
    differing = found ^ {*kind.first, *kind.second}
    return float((DIGIT_ERROR / (1 - DIGIT_ERROR)) ** len(differing))


def _manner(kind: GraspType, contacts: Contacts) -> float:
    """Return the probability of power or precision: the share of the contacts that are not at finger ends."""
    if kind.manner == "intermediate":
        return 1.0
    ends = ("_tip", "_dip", "thumb_ip")
    inner = float(np.mean([not SITES[site].endswith(ends) for site in contacts.sites]))
    power = min(1.0, 2 * inner)
    return power if kind.manner == "power" else 1 - power


def _thumb(kind: GraspType, contacts: Contacts, opposition: Opposition) -> float:
    """Return the probability that the thumb is abducted, or adducted, as the type has it.

    A thumb that presses against the fingers' pads is abducted; one that touches and does not is adducted.
    """
    if kind.abducted is None:
        return 1.0
    touches = any(DIGIT_OF_SITE[site] == "thumb" and SITES[site] not in PALM_SITES for site in contacts.sites)
    if not touches or kind.opposition == "side":
        abducted = 0.2
    else:
        abducted = 0.9 if opposition.shares["pad"] > 0.2 else 0.3
    return abducted if kind.abducted else 1 - abducted


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


def _around(contacts: Contacts, opposition: Opposition) -> float:
    """Return the probability that the opposing digits stand round the object, not side by side.

    Fingers side by side push alike: the mean of their directions has length 1; three round a ball, a
    quarter of a turn apart, 0.8.
    """
    pushes = []
    for digit in opposition.virtual_fingers[1]:
        mean = -contacts.normals[_members(contacts, (digit,))].mean(axis=0)
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
