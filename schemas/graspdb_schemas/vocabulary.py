"""The words of hands: digits, sites, segments, degrees of freedom and the built-in marker set.

Every order that arrays and tables rely on is declared here, once.
"""

from enum import StrEnum
from typing import Final


class Side(StrEnum):
    """Which hand."""

    RIGHT = "right"
    LEFT = "left"


DIGITS: Final = ("thumb", "index", "middle", "ring", "little")
FINGERS: Final = DIGITS[1:]

JOINTS_OF_DIGIT: Final[dict[str, tuple[str, str, str, str]]] = {
    "thumb": ("cmc", "mcp", "ip", "tip"),
    **dict.fromkeys(FINGERS, ("mcp", "pip", "dip", "tip")),
}
"""Joint centres (and the tip) of each digit, from the palm outwards."""

SITES: Final[tuple[str, ...]] = tuple(
    f"{digit}_{joint}" for digit in DIGITS for joint in JOINTS_OF_DIGIT[digit]
)
"""The 20 sites, thumb first: the paper's 20 spheres and 20 dorsal markers."""

N_SITES: Final = len(SITES)
DIGIT_OF_SITE: Final[tuple[str, ...]] = tuple(site.partition("_")[0] for site in SITES)
TIPS: Final[tuple[int, ...]] = tuple(i for i, site in enumerate(SITES) if site.endswith("_tip"))
"""Positions of the five tips in `SITES`."""

KEY_POINTS: Final[tuple[str, ...]] = ("wrist", *SITES)
"""The usual 21 key points: the wrist, then the 20 sites."""

SEGMENTS_OF_DIGIT: Final[dict[str, tuple[str, str, str]]] = {
    "thumb": ("thumb_metacarpal", "thumb_proximal", "thumb_distal"),
    **{finger: (f"{finger}_proximal", f"{finger}_middle", f"{finger}_distal") for finger in FINGERS},
}
SEGMENTS: Final[tuple[str, ...]] = (
    "forearm",
    "hand",
    *(segment for digit in DIGITS for segment in SEGMENTS_OF_DIGIT[digit]),
)
SEGMENT_OF_SITE: Final[dict[str, str]] = {
    f"{digit}_{joint}": segment
    for digit in DIGITS
    for joint, segment in zip(JOINTS_OF_DIGIT[digit], ("hand", *SEGMENTS_OF_DIGIT[digit]), strict=True)
}
"""The segment that carries a site and the marker over it: the one on the palm's side of the joint."""

FREE_DOFS: Final = (
    "forearm_x",
    "forearm_y",
    "forearm_z",
    "forearm_rotation_x",
    "forearm_rotation_y",
    "forearm_rotation_z",
)
JOINT_ANGLES: Final[tuple[str, ...]] = (
    "wrist_flexion",
    "wrist_deviation",
    "thumb_cmc_flexion",
    "thumb_cmc_abduction",
    "thumb_mcp_flexion",
    "thumb_mcp_abduction",
    "thumb_ip_flexion",
    *(
        f"{finger}_{angle}"
        for finger in FINGERS
        for angle in ("mcp_flexion", "mcp_abduction", "pip_flexion", "dip_flexion")
    ),
)
"""The 23 hinges, in the order of the configuration."""

DOFS: Final[tuple[str, ...]] = (*FREE_DOFS, *JOINT_ANGLES)
"""The 29 degrees of freedom, in the order of velocities and standard deviations.

The first three are metres along the lab's axes, the next three radians about the forearm's own axes.
"""

CONFIGURATION: Final[tuple[str, ...]] = (
    "forearm_x",
    "forearm_y",
    "forearm_z",
    "forearm_qw",
    "forearm_qx",
    "forearm_qy",
    "forearm_qz",
    *JOINT_ANGLES,
)
"""The 30 numbers of a configuration q: position, unit quaternion (w, x, y, z), 23 angles."""

N_DOF: Final = len(DOFS)
N_Q: Final = len(CONFIGURATION)

FOREARM_MARKERS: Final = ("forearm_1", "forearm_2", "forearm_3", "forearm_4")
FOREARM4_DORSAL20: Final = "forearm4-dorsal20"
"""Name of the built-in marker set: four on the distal forearm, twenty named like the sites."""
