"""Colours that page, pictures, figures and report share, told apart without red-green vision.

Categorical colours are those of Okabe and Ito ("Color Universal Design", 2008); the scale of the contact map
is viridis (Smith and van der Walt, 2015, CC0), bright where the hand is near.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

TOUCHING: Final = "#d55e00"
"""Spheres that touch: vermilion, the paper's red."""

FEATURE: Final = "#009e73"
"""The graspable feature: bluish green, the paper's green."""

CONTACT: Final = "#0072b2"
"""Contact points and their normals: blue, as in the paper."""

HULL: Final = "#8a8f98"
"""The hand enclosing space: translucent grey."""

OBJECT: Final = "#c3c9d1"
"""The object's surface."""

HAND: Final = "#e0b48f"
"""The hand's segments, and the spheres that do not touch."""

INK: Final = "#1d2430"
"""Outlines, and text on light ground."""

CATEGORIES: Final = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a8f98", "#b8a800")
"""For subjects, objects and digits, in this order."""

DIGIT_COLOURS: Final = {
    "thumb": "#d55e00",
    "index": "#0072b2",
    "middle": "#009e73",
    "ring": "#e69f00",
    "little": "#cc79a7",
}
"""A colour for each digit."""

SCALE: Final = (
    "#440154",
    "#472d7b",
    "#3b528b",
    "#2c728e",
    "#21918c",
    "#28ae80",
    "#5ec962",
    "#addc30",
    "#fde725",
)
"""Nine steps of viridis, from low to high."""

MAP_RANGE: Final = (-0.002, 0.02)
"""Gaps that the contact map's scale spans [m]: from pressing (high) to out of reach (low)."""


def rgb(colour: str) -> NDArray[np.float64]:
    """Return red, green and blue of ``#rrggbb``, from 0 to 1, shape (3,)."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def scale_colours(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colours of the scale for values from 0 to 1, shape (n, 3); what is outside is clipped."""
    steps = np.array([rgb(colour) for colour in SCALE])
    at = np.linspace(0, 1, len(steps))
    return np.stack([np.interp(values, at, steps[:, channel]) for channel in range(3)], axis=-1)


def nearness(gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how near gaps are, 1 at or below the first of `MAP_RANGE` and 0 at or above the second."""
    near, far = MAP_RANGE
    return np.asarray(np.clip((far - gaps) / (far - near), 0, 1))
