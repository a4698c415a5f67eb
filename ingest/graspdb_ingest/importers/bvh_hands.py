"""Key points of hands in a BVH skeleton: which joints they are, told by their names and their order."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.bvh import BvhMotion, Joint
from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.hand.dimensions import BASE_JOINT_PROPORTIONS, SEGMENT_LENGTH_PER_HAND_LENGTH
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.base import ClipHand
from graspdb_schemas.vocabulary import DIGITS, SITES, Side

_DIGIT: Final = {
    "thumb": re.compile("thumb", re.IGNORECASE),
    "index": re.compile("index", re.IGNORECASE),
    "middle": re.compile("middle", re.IGNORECASE),
    "ring": re.compile("ring", re.IGNORECASE),
    "little": re.compile("little|pinky|pinkie", re.IGNORECASE),
}
_SIDE: Final = {
    Side.RIGHT: re.compile("right|(?:^|[_:. ])r(?:[_:. ]|$)", re.IGNORECASE),
    Side.LEFT: re.compile("left|(?:^|[_:. ])l(?:[_:. ]|$)", re.IGNORECASE),
}
_TIP: Final = re.compile(r"(?:tip|nub|end|4)$", re.IGNORECASE)
SMALLEST_BONE: Final = 1e-3
"""An end site nearer to its joint than this is no finger tip [m]."""
BREADTH_PER_LENGTH: Final = 0.449
"""Breadth over length of an adult's hand: 84 mm over 187 mm."""


@dataclass(frozen=True)
class HandJoints:
    """The joints of one hand, as places in a skeleton.

    Attributes
    ----------
    wrist : int
        The wrist.
    digits : mapping of str to tuple of int
        The three joints of each digit, from the palm outwards.
    tips : mapping of str to int
        The tips of those digits that have one.
    """

    wrist: int
    digits: Mapping[str, tuple[int, ...]]
    tips: Mapping[str, int]


def side_in(name: str) -> Side | None:
    """Return which hand a name speaks of, None where it does not say."""
    sides = [side for side, pattern in _SIDE.items() if pattern.search(name)]
    return sides[0] if len(sides) == 1 else None


def find_hands(joints: tuple[Joint, ...]) -> dict[Side | None, HandJoints]:
    """Return the hands of a skeleton by their side, None where joint names do not say it.

    A digit's joints are those with its name, the last three before the tip; what lies before them is part
    of the palm. The tip is an end site, or a joint called so, away from the joint before it. The wrist
    carries all five digits.
    """
    hands: dict[Side | None, HandJoints] = {}
    for side in (None, *Side):
        own = [i for i, joint in enumerate(joints) if side_in(joint.name) is side]
        chains = {
            digit: [i for i in own if pattern.search(joints[i].name)] for digit, pattern in _DIGIT.items()
        }
        digits, tips = {}, {}
        for digit, chain in chains.items():
            if len(chain) > 3 and (_TIP.search(joints[chain[-1]].name)):
                last = chain.pop()
                tips[digit] = last
            digits[digit] = tuple(chain[-3:])
        if all(len(chain) == 3 for chain in digits.values()):
            hands[side] = HandJoints(_carrier(joints, digits), digits, tips)
    return hands


def _carrier(joints: tuple[Joint, ...], digits: Mapping[str, tuple[int, ...]]) -> int:
    """Return the nearest joint that carries all digits."""
    lines = []
    for chain in digits.values():
        line, joint = [], chain[0]
        while (joint := joints[joint].parent) >= 0:
            line.append(joint)
        lines.append(line)
    common = [joint for joint in lines[0] if all(joint in line for line in lines)]
    return common[0] if common else 0


def hand_of(motion: BvhMotion, found: HandJoints, side: Side, scale: float) -> ClipHand:
    """Return a hand's key points; a tip that the skeleton lacks continues its digit's last bone.

    Parameters
    ----------
    motion : BvhMotion
        The skeleton's motion.
    found : HandJoints
        Which joints are the hand's.
    side : Side
        Which hand.
    scale : float
        Metres in a unit of the skeleton's offsets.
    """
    dimensions = _dimensions(motion, found)
    points: list[Floats] = [motion.positions[:, found.wrist]]
    extrapolated = []
    for digit in DIGITS:
        chain = found.digits[digit]
        points += [motion.positions[:, joint] for joint in chain]
        tip = found.tips.get(digit)
        if tip is not None and scale * np.linalg.norm(motion.joints[tip].offset) > SMALLEST_BONE:
            points.append(motion.positions[:, tip])
            continue
        radius = float(dimensions.radii[SITES.index(f"{digit}_tip")])
        points.append(_extrapolated_tip(motion, chain[-1], digit, radius, scale))
        extrapolated.append(f"{digit}_tip")
    given = dimensions if extrapolated else None
    return ClipHand(side, np.stack(points, axis=1), tuple(extrapolated), given)


def _dimensions(motion: BvhMotion, found: HandJoints) -> HandDimensions:
    """Return the hand's size by the middle finger's bones without the last, in which a tip may be missing."""
    middle = motion.positions[0, [found.wrist, *found.digits["middle"]]]
    bones = SEGMENT_LENGTH_PER_HAND_LENGTH["middle"][:2]
    shares = BASE_JOINT_PROPORTIONS["middle"][0] + sum(bones)
    length = float(np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()) / shares
    return HandDimensions(length, BREADTH_PER_LENGTH * length)


def _extrapolated_tip(motion: BvhMotion, last: int, digit: str, radius: float, scale: float) -> Floats:
    """Return the centre of a tip's sphere: straight on, by the usual ratio of the last two bones."""
    bone = scale * motion.joints[last].offset
    _, before, distal = SEGMENT_LENGTH_PER_HAND_LENGTH[digit]
    length = float(np.linalg.norm(bone))
    reach = bone / length * (length * distal / before - radius)
    return np.asarray(motion.positions[:, last] + np.einsum("fij,j->fi", motion.rotations[:, last], reach))
