"""Which parts of a hand's surface touch an object, where, and with which side of the digit."""

from typing import Final

import numpy as np

from graspdb_ingest.contact import Contacts, signed_gaps
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.surface.anatomy import HandPoints, unit
from graspdb_ingest.surface.gaps import SiteGaps, site_gaps, unknown_gaps
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_schemas.vocabulary import DIGITS, SEGMENTS_OF_DIGIT

TIP_CONE: Final = np.cos(np.deg2rad(45))
"""Contact on a last phalanx within 45 degrees of its direction is with the tip."""


def hand_gaps(hand: HandPoints, surface: HandSurface, target: ObjectDistance) -> SiteGaps:
    """Return the gaps of a hand in n frames to an object, both in the object frame.

    Spheres against a bare cloud are the paper's own case: gaps and contact points are those of its
    equation 2 over all points, to the last bit.
    """
    if target.exact or len(surface.radii) > len(hand.radii):
        return site_gaps(surface, target)
    found, cloud = signed_gaps(hand.sites, hand.radii, target.cloud), target.cloud
    gaps = unknown_gaps(*found.gap.shape[:-1])
    known = np.isfinite(found.gap)
    gaps.gap[known] = found.gap[known]
    gaps.centres[known] = hand.sites[known]
    gaps.shapes[known] = np.broadcast_to(np.arange(known.shape[-1]), known.shape)[known]
    points = found.nearest[known]
    gaps.positions[known], gaps.normals[known] = cloud.points[points], cloud.normals[points]
    return gaps


def touching(
    hand: HandPoints, surface: HandSurface, gaps: SiteGaps, threshold: float, target: ObjectDistance
) -> Contacts:
    """Return what touches in one frame: the sites whose part of the surface has a gap below h.

    Parameters
    ----------
    hand, surface : HandPoints, HandSurface
        The hand, posed in the object frame.
    gaps : SiteGaps
        Its gaps, of shape (20,).
    threshold : float
        h of equation 3 [m].
    target : ObjectDistance
        The object.
    """
    sites = np.flatnonzero(gaps.gap < threshold)
    positions, normals = gaps.positions[sites], gaps.normals[sites]
    segments = tuple(surface.segments[shape] for shape in gaps.shapes[sites])
    # From the hand's sphere to its skin where it touches: against the object's outward normal.
    skin = -normals
    return Contacts(
        sites=sites,
        points=np.asarray(target.cloud.tree.query(positions)[1], dtype=np.int64),
        positions=positions,
        normals=normals,
        gap=gaps.gap[sites],
        segments=segments,
        pads=tuple(pad_of(hand, segment, way) for segment, way in zip(segments, skin, strict=True)),
    )


def pad_of(hand: HandPoints, segment: str, direction: Floats) -> str:
    """Return the side of a segment that faces a direction: palmar, dorsal, radial, ulnar, or tip.

    The sides are the quarters around the segment's axis; the palmar one of a last phalanx is the
    finger pad, the radial and ulnar ones its side pads. The tip is what of a last phalanx faces within
    45 degrees of its direction.

    Parameters
    ----------
    hand : HandPoints
        A single posed hand.
    segment : str
        Name of the segment.
    direction : ndarray, shape (3,)
        From the segment's axis to its skin, in the frame of the key points.
    """
    distal, radial, dorsal = segment_axes(hand, segment) @ unit(direction)
    if segment.endswith("_distal") and distal > TIP_CONE:
        return "tip"
    if abs(dorsal) >= abs(radial):
        return "dorsal" if dorsal > 0 else "palmar"
    return "radial" if radial > 0 else "ulnar"


def segment_axes(hand: HandPoints, segment: str) -> Floats:
    """Return the distal, radial and dorsal direction of a segment of a single posed hand, shape (3, 3)."""
    for number, digit in enumerate(DIGITS):
        if segment in SEGMENTS_OF_DIGIT[digit]:
            return np.asarray(hand.digit_axes[number, SEGMENTS_OF_DIGIT[digit].index(segment)])
    return hand.palm_axes
