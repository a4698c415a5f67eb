"""The flesh around a hand's bones: pulps, finger pads, palm, thenar and hypothenar eminence, webs.

Joints lie half way between the dorsal and the palmar skin, but what lies between them does not: on the
palmar side the pads of fat bulge between the creases at the joints, the pulp keeps the depth of
the last joint almost to the tip while the nail's side slopes, and the palm's eminences stand out over its
hollow (Standring, ed., "Gray's Anatomy", chapter on wrist and hand). The places follow from these
landmarks; the amounts are round shares of the joints' radii, none of them fitted to a recording.
"""

from typing import Final

from graspdb_ingest.surface.parts import WRIST_RADIUS, Parts
from graspdb_schemas.vocabulary import DIGITS, SEGMENTS_OF_DIGIT, SITES

PULP_PLACE: Final = 0.65
"""Where the pulp is fullest, from the last joint to the tip."""
PULP_OFFSET: Final = 0.25
"""How far the pulp's middle lies to the palm of the bone's line, over the last joint's radius."""
PULP_RADIUS: Final = 0.92
"""Its radius over the last joint's: the nail's side slopes, the palmar side does not."""
PAD_OFFSET: Final = 0.2
"""How far the pads between two creases lie to the palm, over the distal joint's radius."""
WEB_PLACE: Final = 0.4
"""Where webs end, from knuckle to the next joint: at the crease of the finger's base."""
WEB_RADIUS: Final = 0.6
"""Radius at a web's edge over that of the knuckle."""
FIRST_WEB_PLACE: Final = 0.25
"""Where the web of thumb and index ends on the index."""
EMINENCE_OFFSET: Final = (0.25, 0.5)
"""How far thenar and hypothenar eminence stand out to the palm, over the radius of their first joint."""
WRIST_HALF_BREADTH: Final = 0.25
"""Wrist's centre to the middle of its radial or ulnar half, over the breadth from index to little knuckle."""

_THUMB, _INDEX, _MIDDLE, _RING, _LITTLE = (4 * i for i in range(5))


def add_flesh(parts: Parts) -> None:
    """Add the flesh to the capsules of a hand."""
    for digit in range(5):
        _add_pads(parts, digit)
    radial, ulnar = _add_palm(parts)
    _add_eminences(parts, radial, ulnar)
    _add_webs(parts)


def _add_pads(parts: Parts, digit: int) -> None:
    """Add the pulp of a digit, and its pads between two creases."""
    centres, radii, axes = parts.centres, parts.radii, parts.hand.digit_axes
    for bone, segment in enumerate(SEGMENTS_OF_DIGIT[DIGITS[digit]]):
        if segment == "thumb_metacarpal":
            continue
        near, far = 4 * digit + bone, 4 * digit + bone + 1
        palmar = -axes[..., digit, bone, 2, :]
        if bone == 2:
            along, offset, radius = PULP_PLACE, PULP_OFFSET * radii[near], PULP_RADIUS * radii[near]
        else:
            along, offset, radius = 0.5, PAD_OFFSET * radii[far], (radii[near] + radii[far]) / 2
        middle = centres[near] + along * (centres[far] - centres[near])
        pad = parts.node(middle + offset * palmar, radius)
        half = parts.between(near, far)
        parts.add((near, pad, half), near, segment)
        parts.add((half, pad, far), far, segment)


def _add_palm(parts: Parts) -> tuple[int, int]:
    """Add the palm between wrist and knuckles, and return the nodes of the wrist's two halves."""
    hand, centres = parts.hand, parts.centres
    radial = hand.palm_axes[..., 1, :]
    across = (centres[_INDEX] - centres[_LITTLE]) * radial
    half = WRIST_HALF_BREADTH * across.sum(axis=-1, keepdims=True) * radial
    radius = WRIST_RADIUS * hand.radius("middle_mcp")
    to_thumb, to_little = parts.node(hand.wrist + half, radius), parts.node(hand.wrist - half, radius)
    parts.add((to_thumb, _INDEX, _MIDDLE), _INDEX, "hand")
    parts.add((to_thumb, to_little, _MIDDLE), _MIDDLE, "hand")
    parts.add((to_little, _MIDDLE, _RING), _RING, "hand")
    parts.add((to_little, _RING, _LITTLE), _LITTLE, "hand")
    parts.add((to_thumb, _THUMB), _THUMB, "hand")
    return to_thumb, to_little


def _add_eminences(parts: Parts, radial: int, ulnar: int) -> None:
    """Add the thenar eminence over the thumb's metacarpal and the hypothenar one below the little finger."""
    centres, radii = parts.centres, parts.radii
    palmar = -parts.hand.palm_axes[..., 2, :]
    ball = (centres[_THUMB] + centres[_THUMB + 1]) / 2
    inward = ball + 0.25 * (centres[_MIDDLE] - ball)
    thenar = parts.node(inward + EMINENCE_OFFSET[0] * radii[_THUMB] * palmar, radii[_THUMB])
    half = parts.between(_THUMB, _THUMB + 1)
    parts.add((_THUMB, thenar, half), _THUMB, "thumb_metacarpal")
    parts.add((half, thenar, _THUMB + 1), _THUMB + 1, "thumb_metacarpal")
    parts.add((radial, _THUMB, thenar), _THUMB, "hand")
    parts.add((radial, thenar, _MIDDLE), _THUMB, "hand")
    below = (centres[_LITTLE] + centres[ulnar]) / 2
    hypothenar = parts.node(below + EMINENCE_OFFSET[1] * radii[_LITTLE] * palmar, radii[_LITTLE])
    parts.add((ulnar, hypothenar, _LITTLE), _LITTLE, "hand")


def _add_webs(parts: Parts) -> None:
    """Add the webs between neighbouring fingers, and the fold between thumb and index."""
    centres, radii = parts.centres, parts.radii
    for first, second in ((_INDEX, _MIDDLE), (_MIDDLE, _RING), (_RING, _LITTLE)):
        edges = [centres[k] + WEB_PLACE * (centres[k + 1] - centres[k]) for k in (first, second)]
        web = parts.node((edges[0] + edges[1]) / 2, WEB_RADIUS * radii[second])
        parts.add((first, web, second), first, "hand")
    knuckle = SITES.index("thumb_mcp")
    on_index = centres[_INDEX] + FIRST_WEB_PLACE * (centres[_INDEX + 1] - centres[_INDEX])
    fold = parts.node((on_index + centres[knuckle]) / 2, WEB_RADIUS * radii[knuckle])
    parts.add((knuckle, fold, _INDEX), knuckle, "hand")
    parts.add((_THUMB, knuckle, _INDEX), knuckle, "hand")
