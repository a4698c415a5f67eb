"""The hand as MJCF: 17 segments, 29 degrees of freedom, 20 sites with radii, markers.

Segment frames of a right hand: x distal along the segment, y radial, z dorsal, origin in the
segment's proximal joint (the forearm's in the wrist). A left hand is the mirror image, y ulnar
to radial reversed. With all angles at zero the hand is flat and the thumb points radially.
"""

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.dimensions import HandDimensions, fan_angle
from graspdb_ingest.hand.model import CAPSULE_PREFIX, MARKER_PREFIX, HandModel
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import (
    DIGITS,
    FINGERS,
    JOINTS_OF_DIGIT,
    SEGMENT_OF_SITE,
    SEGMENTS_OF_DIGIT,
    SITES,
    Side,
)

JOINT_RANGE: Final[dict[str, tuple[float, float]]] = {
    "wrist_flexion": (-75, 80),
    "wrist_deviation": (-40, 25),
    "thumb_cmc_flexion": (-45, 50),
    "thumb_cmc_abduction": (-35, 60),
    "thumb_mcp_flexion": (-20, 70),
    "thumb_mcp_abduction": (-25, 25),
    "thumb_ip_flexion": (-30, 90),
    **{f"{finger}_mcp_flexion": (-35, 100) for finger in FINGERS},
    **{f"{finger}_mcp_abduction": (-30, 30) for finger in FINGERS},
    **{f"{finger}_pip_flexion": (-15, 120) for finger in FINGERS},
    **{f"{finger}_dip_flexion": (-20, 90) for finger in FINGERS},
}
"""Limits of the joints [degrees]: textbook active ranges, widened by some ten degrees of laxity."""

THUMB_RADIAL, THUMB_PALMAR, THUMB_PRONATION = 35.0, 25.0, 65.0
"""How the thumb's metacarpal lies in the flat hand: turned radially and to the palm, and rolled [degrees]."""

CAPSULE_SHARE: Final = 0.85
"""Thickness of a drawn segment over the mean thickness of its joints."""

FOREARM_DRAWN: Final = 0.12
"""Length of forearm that is drawn [m]; it plays no part in tracking."""


def build_hand(dimensions: HandDimensions, side: Side, markers: Mapping[str, MarkerPlacement]) -> HandModel:
    """Build a hand of the given size with markers on its segments.

    Parameters
    ----------
    dimensions : HandDimensions
        Length, breadth and thicknesses.
    side : Side
        Right or left.
    markers : mapping of str to MarkerPlacement
        Where each marker sits, by label. A marker that calibration has to find starts on the
        middle of its segment's dorsal side.

    Returns
    -------
    HandModel
        The hand; its `mjcf` opens in any MuJoCo viewer.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"{side} hand"
    spec.compiler.degree = False
    spec.option.gravity = [0, 0, 0]
    bodies = _add_palm(spec, dimensions, side)
    for digit in DIGITS:
        bodies |= _add_digit(bodies["hand"], digit, dimensions, side)
    centres = {site: _site_in_segment(site, dimensions, side) for site in SITES}
    for site, radius in zip(SITES, dimensions.radii, strict=True):
        bodies[SEGMENT_OF_SITE[site]].add_site(
            name=site, pos=centres[site], size=[radius, 0, 0], rgba=[0.85, 0.65, 0.55, 0.5], group=0
        )
    for label, placement in markers.items():
        bodies[placement.segment].add_site(
            name=MARKER_PREFIX + label,
            pos=_marker_in_segment(placement, dimensions, side),
            size=[0.002, 0, 0],
            rgba=[0.1, 0.3, 0.9, 1],
            group=1,
        )
    spec.compile()
    return HandModel(side=side, mjcf=spec.to_xml(), markers=tuple(markers))


def _hinge(body: mujoco.MjsBody, name: str, axis: tuple[float, float, float]) -> None:
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=axis,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=np.deg2rad(JOINT_RANGE[name]),
    )


def _capsule(
    body: mujoco.MjsBody, name: str, start: NDArray[np.float64], end: NDArray[np.float64], radius: float
) -> None:
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*start, *end],
        size=[radius, 0, 0],
        rgba=[0.9, 0.75, 0.65, 1],
        contype=0,
        conaffinity=0,
        group=2,
    )


def _add_palm(spec: mujoco.MjSpec, dimensions: HandDimensions, side: Side) -> dict[str, mujoco.MjsBody]:
    mirror = 1.0 if side is Side.RIGHT else -1.0
    forearm = spec.worldbody.add_body(name="forearm")
    forearm.add_freejoint(name="forearm")
    thickness = 0.2 * dimensions.hand_breadth
    _capsule(forearm, "forearm", np.array([-FOREARM_DRAWN, 0, 0]), np.zeros(3), thickness)
    hand = forearm.add_body(name="hand")
    _hinge(hand, "wrist_flexion", (0, 1, 0))
    _hinge(hand, "wrist_deviation", (0, 0, mirror))
    for digit in DIGITS:
        first = dimensions.radii[4 * DIGITS.index(digit)]
        _capsule(
            hand,
            f"{CAPSULE_PREFIX}{SITES[4 * DIGITS.index(digit)]}",
            np.zeros(3),
            dimensions.base_joint(digit, side),
            CAPSULE_SHARE * first,
        )
    return {"forearm": forearm, "hand": hand}


def _add_digit(
    hand: mujoco.MjsBody, digit: str, dimensions: HandDimensions, side: Side
) -> dict[str, mujoco.MjsBody]:
    mirror = 1.0 if side is Side.RIGHT else -1.0
    away_from_middle = -mirror if digit in ("ring", "little") else mirror
    distances = dimensions.joint_distances(digit)
    radii = dimensions.radii[4 * DIGITS.index(digit) :]
    places = (
        dimensions.base_joint(digit, side),
        np.array([distances[0], 0, 0]),
        np.array([distances[1], 0, 0]),
    )
    bodies: dict[str, mujoco.MjsBody] = {}
    parent = hand
    for i, segment in enumerate(SEGMENTS_OF_DIGIT[digit]):
        turn = _digit_rotation(digit, side) if i == 0 else Rotation.identity()
        body = parent.add_body(name=segment, pos=places[i], quat=turn.as_quat(scalar_first=True))
        joint = f"{digit}_{JOINTS_OF_DIGIT[digit][i]}"
        _hinge(body, f"{joint}_flexion", (0, 1, 0))
        if f"{joint}_abduction" in JOINT_RANGE:
            _hinge(body, f"{joint}_abduction", (0, 0, away_from_middle))
        end = np.array([distances[i], 0, 0])
        _capsule(
            body,
            f"{CAPSULE_PREFIX}{digit}_{JOINTS_OF_DIGIT[digit][i + 1]}",
            np.zeros(3),
            end,
            CAPSULE_SHARE * float(np.mean(radii[i : i + 2])),
        )
        bodies[segment] = parent = body
    return bodies


def _digit_rotation(digit: str, side: Side) -> Rotation:
    """Return hand_from_digit at zero angles."""
    mirror = 1.0 if side is Side.RIGHT else -1.0
    if digit != "thumb":
        return Rotation.from_euler("z", mirror * fan_angle(digit))
    return Rotation.from_euler(
        "ZYX", [mirror * THUMB_RADIAL, THUMB_PALMAR, -mirror * THUMB_PRONATION], degrees=True
    )


def _site_in_segment(site: str, dimensions: HandDimensions, side: Side) -> NDArray[np.float64]:
    digit, joint = site.split("_")
    i = JOINTS_OF_DIGIT[digit].index(joint)
    if i == 0:
        return dimensions.base_joint(digit, side)
    return np.array([dimensions.joint_distances(digit)[i - 1], 0, 0])


def _marker_in_segment(
    placement: MarkerPlacement, dimensions: HandDimensions, side: Side
) -> NDArray[np.float64]:
    if placement.offset is not None:
        return np.array(placement.offset)
    if placement.at is None:
        return _middle_of_dorsal_side(placement.segment, dimensions, side)
    up = np.array([0, 0, dimensions.radii[SITES.index(placement.at)]], dtype=np.float64)
    if placement.segment == SEGMENT_OF_SITE[placement.at]:
        return _site_in_segment(placement.at, dimensions, side) + up
    return up  # on the segment beyond the joint, whose frame has its origin in the joint


def _middle_of_dorsal_side(segment: str, dimensions: HandDimensions, side: Side) -> NDArray[np.float64]:
    if segment == "forearm":
        return np.array([-0.2 * dimensions.hand_length, 0, 0.25 * dimensions.hand_breadth])
    if segment == "hand":
        knuckle = dimensions.base_joint("middle", side)
        height = dimensions.radii[SITES.index("middle_mcp")]
        return 0.5 * knuckle + np.array([0, 0, height], dtype=np.float64)
    digit = segment.partition("_")[0]
    i = SEGMENTS_OF_DIGIT[digit].index(segment)
    first = 4 * DIGITS.index(digit) + i
    thickness = float(np.mean(dimensions.radii[first : first + 2]))
    return np.array([0.5 * dimensions.joint_distances(digit)[i], 0, thickness])
