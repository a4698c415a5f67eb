"""Which parts of the hand oppose each other: pad, palm or side opposition, and the virtual fingers.

Iberall, Bingham and Arbib (1986) describe a grasp by the hand surfaces that press against each other:
the thumb's pad against fingers' pads, fingers against the palm, the thumb against the side of a finger.
A virtual finger is a group of digits, or the palm, that acts as one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from graspdb_ingest.contact import Contacts
from graspdb_ingest.hand.model import Floats
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, DIGITS, FINGERS, SITES

Kind = Literal["pad", "palm", "side"]
KINDS: Final[tuple[Kind, ...]] = ("pad", "palm", "side")

PALM: Final = "palm"
PALM_SITES: Final = ("thumb_cmc", *(f"{finger}_mcp" for finger in FINGERS))
"""Sites whose palmar side belongs to the palm."""

LEAST: Final = 0.25
"""A digit's opposition below this, a push more than 75 degrees off the opposite direction, is none."""
PALM_FIRST: Final = 0.25
"""Where the palm opposes at least this share of the fingers' greatest opposition it is a palm opposition."""


@dataclass(frozen=True)
class Opposition:
    """Who opposes whom in a grasp.

    Attributes
    ----------
    kind : {'pad', 'palm', 'side'} or None
        The opposition; None where nothing opposes.
    virtual_fingers : tuple of tuple of str
        The first virtual finger (thumb or palm), the digits that oppose it, and those that only help.
    shares : mapping of str to float
        Evidence for each kind: opposition of the fingers by it, as a share of all.
    """

    kind: Kind | None
    virtual_fingers: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
    shares: Mapping[str, float]


def find_opposition(contacts: Contacts) -> Opposition:
    """Return the opposition of a grasp from its contacts.

    Two contacts that push towards each other oppose by the cosine of their directions: 1 where one pushes
    exactly against the other, 0.5 for two of three round a ball. Each finger counts with the strongest
    opposition that it has to the thumb, the palm or the side of another finger.

    Parameters
    ----------
    contacts : Contacts
        The contacts, with the pads of the hand that they are on.
    """
    surfaces = contact_surfaces(contacts)
    strength = _strengths(contacts)
    by_finger = {finger: _evidence(finger, surfaces, contacts, strength) for finger in FINGERS}
    total = {kind: sum(evidence[kind] for evidence in by_finger.values()) for kind in KINDS}
    kind = _chosen(total)
    everything = sum(total.values())
    shares = {str(name): value / everything for name, value in total.items() if everything > 0}
    return Opposition(kind, _virtual_fingers(kind, by_finger, surfaces, contacts), shares)


def contact_surfaces(contacts: Contacts) -> tuple[str, ...]:
    """Return which surface of the hand each contact is on: palm, thumb, pad, radial, ulnar or dorsal.

    The last four are of fingers. A tip belongs to its pad, and the palmar side of a knuckle to the palm.
    """
    return tuple(_surface(int(s), pad) for s, pad in zip(contacts.sites, contacts.pads, strict=True))


def _surface(site: int, pad: str) -> str:
    palmar = pad in ("palmar", "tip")
    if SITES[site] in PALM_SITES and (palmar or DIGIT_OF_SITE[site] == "thumb"):
        return PALM
    if DIGIT_OF_SITE[site] == "thumb":
        return "thumb"
    return "pad" if palmar else pad


def _strengths(contacts: Contacts) -> Floats:
    """Return how far each two contacts push at each other, shape (k, k), from 0 to 1."""
    apart = contacts.positions - contacts.positions[:, None]
    towards = np.einsum("ijk,ik->ij", apart, -contacts.normals) > 0
    against = np.maximum(0.0, -contacts.normals @ contacts.normals.T)
    return np.asarray(np.where(towards & towards.T, against, 0.0))


def _evidence(
    finger: str, surfaces: tuple[str, ...], contacts: Contacts, strength: Floats
) -> dict[Kind, float]:
    """Return the strongest opposition of a finger of each kind."""
    evidence: dict[Kind, float] = dict.fromkeys(KINDS, 0.0)
    digits = [DIGIT_OF_SITE[site] for site in contacts.sites]
    for i, here in enumerate(surfaces):
        if digits[i] != finger or here == PALM:
            continue
        for j, there in enumerate(surfaces):
            kind = _kind(here, there, digits[j] == finger)
            if kind is not None:
                evidence[kind] = max(evidence[kind], float(strength[i, j]))
    return evidence


def _kind(finger: str, other: str, same_digit: bool) -> Kind | None:
    if other == PALM:
        return "palm"
    if other == "thumb":
        return "side" if finger in ("radial", "ulnar") else "pad"
    between = {finger, other} == {"radial", "ulnar"}
    return "side" if between and not same_digit else None


def _chosen(total: Mapping[Kind, float]) -> Kind | None:
    strongest = max(total.values())
    if strongest < LEAST:
        return None
    if total["palm"] >= PALM_FIRST * strongest:
        return "palm"
    return max(KINDS, key=lambda kind: total[kind])


def _virtual_fingers(
    kind: Kind | None,
    by_finger: Mapping[str, Mapping[Kind, float]],
    surfaces: tuple[str, ...],
    contacts: Contacts,
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    touching = [digit for digit in DIGITS if digit in contacts.digits]
    if kind is None:
        return (), (), tuple(touching)
    second = [finger for finger in FINGERS if by_finger[finger][kind] >= LEAST]
    if kind == "palm":
        first = [PALM]
    elif "thumb" in surfaces:
        first = ["thumb"]
    else:  # two fingers' sides against each other
        first, second = second[:1], second[1:]
    rest = [digit for digit in touching if digit not in (*first, *second)]
    return tuple(first), tuple(second), tuple(rest)
