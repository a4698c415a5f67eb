"""The hand as grasps are planned with it: its 20 spheres, and the flesh between them.

Contacts are those of the 20 spheres alone. The further spheres, half way along each phalanx and
over the palm, only keep the object out of the hand.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from graspdb.simulate.arrays import Floats
from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import (
    DIGIT_OF_SITE,
    DIGITS,
    FINGERS,
    N_SITES,
    SEGMENT_OF_SITE,
    SEGMENTS_OF_DIGIT,
    SITES,
    Side,
)

FLESH_DEPTH = 0.0015
"""How far the object presses into the flesh between the spheres before that resists [m]."""

FLESH_LIMIT = 0.003
"""How far it never presses [m]."""

FOREARM_LENGTH = 0.20
"""Distance from the wrist to the point that keeps the forearm above the table [m]."""

PALM_SHARES = (0.55, 0.8)
"""Where the palm's spheres lie between wrist and knuckle."""


class PlanningHand:
    """A hand with the spheres that planning needs.

    Points are ordered: 20 sites, then flesh (15 phalanges, 8 of the palm), then wrist and forearm.

    Parameters
    ----------
    dimensions : HandDimensions
        Size of the hand.
    side : Side
        Right or left.
    """

    def __init__(self, dimensions: HandDimensions, side: Side) -> None:
        self.side = side
        self.dimensions = dimensions
        placements, radii = _placements(dimensions, side)
        self.hand: HandModel = build_hand(dimensions, side, placements)
        self.radii: Floats = np.array([radii[label] for label in self.hand.markers if label in radii])
        labels = list(self.hand.markers)
        self._points = np.array([labels.index(label) for label in radii])
        self._dorsal = np.array([labels.index(f"dorsal_{site}") for site in SITES])
        self._kinematics = Kinematics(self.hand)

    @property
    def n_solid(self) -> int:
        """Number of spheres that keep the object out: all but those of wrist and forearm."""
        return len(self._points) - 2

    @cached_property
    def digit_of_point(self) -> NDArray[np.int64]:
        """Digit that moves each point, as its position in DIGITS; -1 for palm, wrist and forearm."""
        knuckle = [
            site.endswith("_cmc") or (site.endswith("_mcp") and d != "thumb") for site, d in _SITE_DIGIT
        ]
        sites = [-1 if k else DIGITS.index(d) for k, (_, d) in zip(knuckle, _SITE_DIGIT, strict=True)]
        phalanges = np.repeat(np.arange(5), 3).tolist()
        rest = len(self._points) - N_SITES - 15
        return np.array(sites + phalanges + [-1] * rest)

    def move(self, q: Floats) -> None:
        """Take configuration `q`, shape (30,)."""
        self._kinematics.move(q)

    def points(self) -> Floats:
        """Return the spheres' centres [m], shape (n_points, 3)."""
        return np.asarray(self._kinematics.markers[self._points])

    def points_of(self, q: Floats) -> Floats:
        """Return the spheres' centres of many configurations, (n, 30), as (n, n_points, 3) [m]."""
        return np.asarray(self.hand.forward(q).markers[:, self._points])

    def jacobian(self) -> Floats:
        """Return d(point) / d(degree of freedom), shape (n_points, 3, 29)."""
        return np.array(self._kinematics.marker_jacobian()[self._points])

    def dorsal(self, sites: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return the dorsal directions at some sites, (n, 3), and their Jacobians, (n, 3, 29)."""
        above, at, radius = self._dorsal[sites], self._points[sites], self.radii[sites]
        markers, jacobian = self._kinematics.markers, self._kinematics.marker_jacobian()
        return (
            np.asarray((markers[above] - markers[at]) / radius[:, None]),
            np.asarray((jacobian[above] - jacobian[at]) / radius[:, None, None]),
        )


_SITE_DIGIT = tuple(zip(SITES, DIGIT_OF_SITE, strict=True))


def _placements(
    dimensions: HandDimensions, side: Side
) -> tuple[dict[str, MarkerPlacement], dict[str, float]]:
    """Return the planning points as markers, and their radii; dorsal directions have no radius."""
    placements: dict[str, MarkerPlacement] = {}
    radii: dict[str, float] = {}
    by_site = dict(zip(SITES, dimensions.radii.tolist(), strict=True))

    def add(label: str, segment: str, offset: Floats, radius: float) -> None:
        x, y, z = offset.tolist()
        placements[label] = MarkerPlacement(segment, offset=(x, y, z))
        radii[label] = radius

    for site in SITES:
        add(f"at_{site}", SEGMENT_OF_SITE[site], _centre(site, dimensions, side), by_site[site])
    for digit in DIGITS:
        ends = dimensions.radii[4 * DIGITS.index(digit) :][:4]
        lengths = dimensions.joint_distances(digit)
        for i, segment in enumerate(SEGMENTS_OF_DIGIT[digit]):
            add(
                f"mid_{segment}",
                segment,
                np.array([lengths[i] / 2, 0, 0]),
                0.9 * float(ends[i : i + 2].mean()),
            )
    for finger in FINGERS:
        for share in PALM_SHARES:
            offset = share * dimensions.base_joint(finger, side)
            add(f"palm_{finger}_{share}", "hand", offset, 0.95 * by_site[f"{finger}_mcp"])
    add("wrist", "hand", np.zeros(3), 0.2 * dimensions.hand_breadth)
    add("forearm", "forearm", np.array([-FOREARM_LENGTH, 0, 0]), 0.035)
    for site, radius in by_site.items():
        above = np.add(_centre(site, dimensions, side), [0, 0, radius])
        placements[f"dorsal_{site}"] = MarkerPlacement(
            SEGMENT_OF_SITE[site], offset=(above[0], above[1], above[2])
        )
    return placements, radii


def _centre(site: str, dimensions: HandDimensions, side: Side) -> Floats:
    digit = site.partition("_")[0]
    number = SITES.index(site) % 4
    if number == 0:
        return dimensions.base_joint(digit, side)
    return np.array([dimensions.joint_distances(digit)[number - 1], 0.0, 0.0])
