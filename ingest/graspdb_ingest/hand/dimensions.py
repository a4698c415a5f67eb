"""A hand's dimensions from its length, its breadth and any caliper thicknesses.

Segment lengths and joint positions are the proportions of Buchholz, Armstrong and Goldstein,
"Anthropometric data for describing the kinematics of the human hand", Ergonomics 35(3), 1992,
261-273: lengths along the hand as shares of hand length, positions across it as shares of hand
breadth. That study gives no depth; the palmar offset of the thumb's base and of the knuckles'
arch are our own round figures, and so are the joint thicknesses, which are usual adult values
for a hand 84 mm broad. Calipers replace them where a subject was measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.vocabulary import DIGITS, FINGERS, JOINTS_OF_DIGIT, SITES, Side

SEGMENT_LENGTH_PER_HAND_LENGTH: Final[dict[str, tuple[float, float, float]]] = {
    "thumb": (0.251, 0.196, 0.158),
    "index": (0.245, 0.143, 0.097),
    "middle": (0.266, 0.170, 0.108),
    "ring": (0.244, 0.165, 0.107),
    "little": (0.204, 0.117, 0.093),
}
"""Metacarpal, proximal and distal for the thumb; proximal, middle and distal for the fingers."""

BASE_JOINT_PROPORTIONS: Final[dict[str, tuple[float, float, float]]] = {
    "thumb": (0.073, 0.196, -0.10),
    "index": (0.447, 0.251, 0.0),
    "middle": (0.446, 0.0, 0.0),
    "ring": (0.409, -0.206, -0.03),
    "little": (0.368, -0.402, -0.08),
}
"""First joint of each digit from the wrist: distal [hand length], radial and dorsal [hand breadth]."""

JOINT_THICKNESS_PER_HAND_BREADTH: Final[dict[str, tuple[float, float, float, float]]] = {
    "thumb": (0.33, 0.25, 0.22, 0.18),
    "index": (0.31, 0.215, 0.17, 0.145),
    "middle": (0.31, 0.22, 0.175, 0.15),
    "ring": (0.30, 0.205, 0.165, 0.14),
    "little": (0.27, 0.185, 0.15, 0.125),
}
"""Palmar to dorsal thickness at each digit's four sites."""

PLAUSIBLE_HAND_LENGTH: Final = (0.03, 0.35)
"""From a small monkey's hand to more than any human's [m]."""


@dataclass(frozen=True)
class HandDimensions:
    """What is measured of a hand, and the lengths that follow from it.

    Attributes
    ----------
    hand_length : float
        Wrist crease to tip of the middle finger [m].
    hand_breadth : float
        Breadth over the knuckles of the fingers [m].
    joint_thickness : mapping of str to float
        Caliper thickness by site [m]; the sites left out are scaled from the hand's breadth.
    proportions : mapping of str to float
        By site, its distance from the site before it (a first joint's from the wrist) over the one
        that usual proportions give; 1 for the sites left out.

    Raises
    ------
    ParameterError
        If a length is not plausible for a hand in metres, or a site is unknown.
    """

    hand_length: float
    hand_breadth: float
    joint_thickness: Mapping[str, float] = field(default_factory=dict)
    proportions: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        low, high = PLAUSIBLE_HAND_LENGTH
        if not low <= self.hand_length <= high:
            raise ParameterError("hand_length", self.hand_length, f"{low} to {high} m")
        if not 0.2 <= self.hand_breadth / self.hand_length <= 0.8:
            raise ParameterError(
                "hand_breadth", self.hand_breadth, "0.2 to 0.8 of the hand's length, in metres"
            )
        for site, thickness in self.joint_thickness.items():
            if site not in SITES:
                allowed = f"one of {', '.join(SITES)}{nearest(site, SITES)}"
                raise ParameterError("joint_thickness", site, allowed)
            if not 0 < thickness < 0.5 * self.hand_breadth:
                allowed = "above zero and below half the hand's breadth, in metres"
                raise ParameterError(f"joint_thickness.{site}", thickness, allowed)
        for site, factor in self.proportions.items():
            if site not in SITES:
                allowed = f"one of {', '.join(SITES)}{nearest(site, SITES)}"
                raise ParameterError("proportions", site, allowed)
            if not 0.5 <= factor <= 2:
                raise ParameterError(f"proportions.{site}", factor, "0.5 to 2")

    @property
    def radii(self) -> NDArray[np.float64]:
        """Sphere radii r_k, half the joint thickness [m], shape (20,), in the order of the sites."""
        scaled = [t * self.hand_breadth for digit in DIGITS for t in JOINT_THICKNESS_PER_HAND_BREADTH[digit]]
        thickness = [self.joint_thickness.get(site, t) for site, t in zip(SITES, scaled, strict=True)]
        return np.array(thickness) / 2

    def base_joint(self, digit: str, side: Side) -> NDArray[np.float64]:
        """Return the first joint of a digit in the hand segment's frame [m], shape (3,)."""
        distal, radial, dorsal = BASE_JOINT_PROPORTIONS[digit]
        mirror = 1.0 if side is Side.RIGHT else -1.0
        usual = np.array(
            [
                distal * self.hand_length,
                mirror * radial * self.hand_breadth,
                dorsal * self.hand_breadth,
            ]
        )
        usual *= self._factors(digit)[0]
        return usual

    def joint_distances(self, digit: str) -> NDArray[np.float64]:
        """Return the distances between a digit's four sites, from the palm outwards [m], shape (3,).

        The last site is the centre of the tip's sphere, so the distal phalanx loses that radius.
        """
        lengths = np.array(SEGMENT_LENGTH_PER_HAND_LENGTH[digit]) * self.hand_length
        lengths *= self._factors(digit)[1:]
        lengths[2] -= self.radii[4 * DIGITS.index(digit) + 3]
        return lengths

    def _factors(self, digit: str) -> NDArray[np.float64]:
        """Return the proportions of a digit's four sites, shape (4,)."""
        return np.array([self.proportions.get(f"{digit}_{j}", 1.0) for j in JOINTS_OF_DIGIT[digit]])


def fan_angle(finger: str) -> float:
    """Return how far a finger's straight direction turns to the radial side of the middle's [rad].

    Fingers of a flat hand fan out a little; these are our own round figures.
    """
    degrees = dict(zip(FINGERS, (5.0, 0.0, -5.0, -12.0), strict=True))
    return float(np.deg2rad(degrees[finger]))
