"""The three surfaces of a hand: the paper's 20 spheres, tapered capsules, and skin over flesh.

The paper (section II.C) names all three and uses the first: "The phalanges can be modeled as cylinders
and the joints can be modeled as spheres. It is also possible to generate a mesh that wraps around all
joints and phalanges". Each one holds the one before it.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.surface.anatomy import HandPoints
from graspdb_ingest.surface.flesh import add_flesh
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_ingest.surface.parts import WRIST_RADIUS, Parts
from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.vocabulary import DIGITS, SEGMENT_OF_SITE, SEGMENTS_OF_DIGIT, SITES


def hand_surface(hand: HandPoints, name: str) -> HandSurface:
    """Build a surface around key points.

    Parameters
    ----------
    hand : HandPoints
        Key points, radii and side; of one hand or of many frames.
    name : str
        ``spheres``: the paper's 20 spheres. ``capsules``: cone-spheres from site to site, and over
        the palm from the wrist to the first site of each digit. ``skin``: these and the flesh around
        them, a closed surface.

    Raises
    ------
    ParameterError
        There is no such surface.
    """
    if name not in _BUILDERS:
        allowed = f"one of {', '.join(_BUILDERS)}{nearest(name, list(_BUILDERS))}"
        raise ParameterError("contact.surface", name, allowed)
    return _BUILDERS[name](hand).surface()


def _spheres(hand: HandPoints) -> Parts:
    parts = Parts(hand)
    for number, site in enumerate(SITES):
        parts.add((number,), number, SEGMENT_OF_SITE[site])
    return parts


def _capsules(hand: HandPoints) -> Parts:
    parts = Parts(hand)
    wrist = parts.node(hand.wrist, WRIST_RADIUS * hand.radius("middle_mcp"))
    for number, digit in enumerate(DIGITS):
        first = 4 * number
        parts.add((wrist, first), first, "hand")
        for bone, segment in enumerate(SEGMENTS_OF_DIGIT[digit]):
            near, far = first + bone, first + bone + 1
            middle = parts.between(near, far)
            parts.add((near, middle), near, segment)
            parts.add((middle, far), far, segment)
    return parts


def _skin(hand: HandPoints) -> Parts:
    parts = _capsules(hand)
    add_flesh(parts)
    return parts


_BUILDERS: Final[dict[str, Callable[[HandPoints], Parts]]] = {
    "spheres": _spheres,
    "capsules": _capsules,
    "skin": _skin,
}

PAPER_SURFACE: Final = "spheres"
SURFACES: Final = tuple(_BUILDERS)
"""Names of the surfaces, each one inside the next."""


def key_points(wrist: Floats, sites: Floats) -> Floats:
    """Return the 21 key points, shape (..., 21, 3), from wrist (..., 3) and sites (..., 20, 3)."""
    return np.concatenate([wrist[..., None, :], sites], axis=-2)
