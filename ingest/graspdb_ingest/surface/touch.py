"""Which parts of a hand's surface touch an object, where, and with which side of the digit."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.contact import Contacts, signed_gaps
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.surface.anatomy import HandPoints, unit
from graspdb_ingest.surface.build import PAPER_SURFACE, hand_surface
from graspdb_ingest.surface.gaps import SiteGaps, site_gaps, unknown_gaps
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_schemas.vocabulary import DIGITS, SEGMENTS_OF_DIGIT

TIP_CONE: Final = np.cos(np.deg2rad(45))
"""Contact on a last phalanx within 45 degrees of its direction is with the tip."""


@dataclass(frozen=True, eq=False)
class PosedHand:
    """A hand and its surface beside an object, in the object's frame: one, or n frames.

    Attributes
    ----------
    points : HandPoints
        Key points, radii, side.
    surface : HandSurface
        The surface around them.
    gaps : SiteGaps
        Gaps of each site's part of the surface to the object.
    """

    points: HandPoints
    surface: HandSurface
    gaps: SiteGaps

    def frame(self, index: int) -> "PosedHand":
        """Return the hand of one frame."""
        return PosedHand(self.points.frame(index), self.surface.frame(index), self.gaps.frame(index))


def pose_hand(points: HandPoints, surface: str, target: ObjectDistance | None) -> PosedHand:
    """Build a hand's surface in n frames and take its gaps to an object, which may be none.

    Spheres against a bare cloud are the paper's own case: gaps and contact points are those of its
    equation 2 over all points, to the last bit.

    Parameters
    ----------
    points : HandPoints
        Key points of shape (n, 21, 3), object frame.
    surface : str
        ``spheres``, ``capsules`` or ``skin``; see `hand_surface`.
    target : ObjectDistance or None
        The object.
    """
    built = hand_surface(points, surface)
    if target is None:
        return PosedHand(points, built, unknown_gaps(len(points.key_points)))
    if surface == PAPER_SURFACE and not target.exact:
        return PosedHand(points, built, _gaps_to_cloud(points, target.cloud))
    return PosedHand(points, built, site_gaps(built, target))


def _gaps_to_cloud(hand: HandPoints, cloud: ObjectCloud) -> SiteGaps:
    """Return the gaps of spheres by equation 2."""
    found = signed_gaps(hand.sites, hand.radii, cloud)
    gaps = unknown_gaps(*found.gap.shape[:-1])
    known = np.isfinite(found.gap)
    gaps.gap[known] = found.gap[known]
    gaps.centres[known] = hand.sites[known]
    gaps.shapes[known] = np.nonzero(known)[-1]
    points = found.nearest[known]
    gaps.positions[known], gaps.normals[known] = cloud.points[points], cloud.normals[points]
    return gaps


def touching(posed: PosedHand, threshold: float, target: ObjectDistance) -> Contacts:
    """Return what touches in one frame: the sites whose part of the surface has a gap below h.

    Parameters
    ----------
    posed : PosedHand
        A single posed hand.
    threshold : float
        h of equation 3 [m].
    target : ObjectDistance
        The object.
    """
    gaps = posed.gaps
    sites = np.flatnonzero(gaps.gap < threshold)
    positions, normals = gaps.positions[sites], gaps.normals[sites]
    segments = tuple(posed.surface.segments[shape] for shape in gaps.shapes[sites])
    # The skin that touches faces against the object's outward normal.
    pads = tuple(pad_of(posed.points, s, -n) for s, n in zip(segments, normals, strict=True))
    return Contacts(
        sites=sites,
        points=np.asarray(target.cloud.tree.query(positions)[1], dtype=np.int64),
        positions=positions,
        normals=normals,
        gap=gaps.gap[sites],
        segments=segments,
        pads=pads,
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
