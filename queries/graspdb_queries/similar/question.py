"""What is asked: a grasp of the database, or a part from outside, and in which respect."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.hands import Hands
from graspdb_queries.similar.part import Part
from graspdb_schemas.errors import ParameterError

Floats = NDArray[np.float64]

BY: Final = ("feature", "posture", "contact", "all")
MODES: Final = ("shape", "held")
POSTURES: Final = ("scaled", "metric", "angles")


@dataclass(frozen=True)
class Weight:
    """How much a respect counts, and the distance in it that costs one."""

    weight: float
    scale: float
    unit: str


MILLIMETRE: Final = "mm"

WEIGHTS: Final[dict[str, dict[str, Weight]]] = {
    "feature": {
        "descriptor": Weight(0.5, 1.0, ""),
        "surface": Weight(0.5, 2.0, MILLIMETRE),
    },
    "posture": {"posture": Weight(1.0, 10.0, MILLIMETRE)},
    "contact": {
        "descriptor": Weight(0.2, 1.0, ""),
        "sites": Weight(0.4, 0.5, ""),
        "contacts": Weight(0.4, 10.0, MILLIMETRE),
    },
    "all": {
        "descriptor": Weight(0.25, 1.0, ""),
        "surface": Weight(0.25, 2.0, MILLIMETRE),
        "posture": Weight(0.25, 10.0, MILLIMETRE),
        "sites": Weight(0.125, 0.5, ""),
        "contacts": Weight(0.125, 10.0, MILLIMETRE),
    },
}
"""Parts of the cost for each respect. Scales are differences that a person would call clear: between surfaces
the 2 mm by which the points of a cloud are apart, ten between joints or contact points, half of the sites."""

ANGLE: Final = Weight(1.0, 15.0, "deg")
"""Takes the place of the posture's distance where joint angles are compared."""


@dataclass(frozen=True)
class Respect:
    """In which respect grasps are compared.

    Attributes
    ----------
    by : {'feature', 'posture', 'contact', 'all'}
        What is compared.
    mode : {'shape', 'held'}
        Features in any pose, or as they lie in the hand.
    posture : {'scaled', 'metric', 'angles'}
        How postures are compared; see `posture_distances`.

    Raises
    ------
    ParameterError
        If one is none of these.
    """

    by: str = "feature"
    mode: str = "shape"
    posture: str = "scaled"

    def __post_init__(self) -> None:
        for name, allowed in (("by", BY), ("mode", MODES), ("posture", POSTURES)):
            if getattr(self, name) not in allowed:
                raise ParameterError(name, getattr(self, name), ", ".join(allowed))

    @property
    def weights(self) -> dict[str, Weight]:
        """Parts of the cost."""
        parts = dict(WEIGHTS[self.by])
        if self.posture == "angles" and "posture" in parts:
            parts["posture"] = Weight(parts["posture"].weight, ANGLE.scale, ANGLE.unit)
        return parts


@dataclass(frozen=True, eq=False)
class Question:
    """A grasp, or a part from outside.

    Attributes
    ----------
    name : str
        Key of the grasp, or name of the file.
    kind : str
        Kind of its descriptor.
    descriptors : ndarray of float32, shape (m, 428)
        Its descriptor; several where it could be described in several ways, of which the nearest counts.
    part : Part or None
        Its surface; None for a grasp that encloses no point.
    size : ndarray of float32, shape (4,), or None
        Its extents and the square root of its area [m]; None without a surface.
    hand : Hands or None
        Its hand; None for a part from outside.
    side : str or None
        Its side.
    contacts : ndarray, shape (k, 3)
        Its contact points, object frame [m].
    inside : bool
        Whether it is a grasp of the database, which is not its own answer.
    """

    name: str
    kind: str | None
    descriptors: NDArray[np.float32]
    part: Part | None
    size: NDArray[np.float32] | None
    hand: Hands | None
    side: str | None
    contacts: Floats
    inside: bool
