"""Subjects: hands of different size, and where their markers sit."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.simulate.planning import PlanningHand
from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.dimensions import BASE_JOINT_PROPORTIONS, SEGMENT_LENGTH_PER_HAND_LENGTH
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import FOREARM_MARKERS, JOINT_ANGLES, SEGMENT_OF_SITE, SITES, Side

HAND_LENGTH: Final = (0.165, 0.205)
"""From a small woman's to a large man's hand [m]."""

BREADTH_PER_LENGTH: Final = (0.42, 0.47)

LEFT_HANDED: Final = 0.1
"""Share of people who grasp with the left hand."""

THICKNESS_SD: Final = 0.04
"""Relative spread of joint thicknesses about those that follow from the hand's breadth."""

PROPORTION_SD: Final = 0.05
"""Relative spread of a bone's length about its share of the hand.

A finger's length varies by 6 to 8 per cent between young adults (Chatzioglou, Pinar and Govsa, Anat.
Cell Biol. 57, 2024, 172-182) and a hand's by 5 to 6; what is left, independent of the hand's size,
is 4 to 5 per cent.
"""

PULLING_JOINT: Final[tuple[str, ...]] = (
    *("wrist_flexion" for _ in FOREARM_MARKERS),
    *("thumb_cmc_flexion", "thumb_mcp_flexion", "thumb_ip_flexion", "thumb_ip_flexion"),
    *(
        f"{site.partition('_')[0]}_{joint}_flexion"
        for site in SITES[4::4]
        for joint in ("mcp", "pip", "dip", "dip")
    ),
)
"""For each marker, the angle that pulls the skin under it."""


@dataclass(frozen=True)
class SimulatedSubject:
    """A person with one recorded hand.

    Attributes
    ----------
    name : str
        Name in the session.
    side : Side
        The recorded hand.
    dimensions : HandDimensions
        True dimensions [m]; all but the proportions are also what was measured.
    placements : dict of str to MarkerPlacement
        The 24 markers; those of the forearm at places that only the truth knows.
    """

    name: str
    side: Side
    dimensions: HandDimensions
    placements: dict[str, MarkerPlacement]

    @cached_property
    def hand(self) -> HandModel:
        """The hand with its 24 markers."""
        return build_hand(self.dimensions, self.side, self.placements)

    @cached_property
    def planning(self) -> PlanningHand:
        """The hand as grasps are planned with it."""
        return PlanningHand(self.dimensions, self.side)

    def marker_columns(self) -> NDArray[np.int64]:
        """Return where each marker of `placements` stands among the hand's markers."""
        return np.array([self.hand.markers.index(label) for label in self.placements])

    def pulling_angles(self) -> NDArray[np.int64]:
        """Return for each marker the angle that pulls its skin, as a place among the 23."""
        return np.array([JOINT_ANGLES.index(joint) for joint in PULLING_JOINT])


def draw_subject(name: str, rng: np.random.Generator, proportion_sd: float = 0.0) -> SimulatedSubject:
    """Return a person; lengths are whole tenths of a millimetre, so a manifest holds them exactly.

    Parameters
    ----------
    name : str
        Name in the session.
    rng : numpy.random.Generator
        Draws everything.
    proportion_sd : float
        Relative spread of the bones' lengths about their usual shares of the hand; zero gives a
        hand of the model's own proportions, else the same person as with zero.
    """
    length = round(rng.uniform(*HAND_LENGTH), 4)
    breadth = round(length * rng.uniform(*BREADTH_PER_LENGTH), 4)
    usual = 2 * HandDimensions(length, breadth).radii
    measured = usual * (1 + THICKNESS_SD * np.clip(rng.standard_normal(len(SITES)), -2, 2))
    thickness = {site: round(float(t), 4) for site, t in zip(SITES, measured, strict=True)}
    side = Side.LEFT if rng.random() < LEFT_HANDED else Side.RIGHT
    placements = placements_of(_forearm_offsets(breadth, rng))
    proportions = _draw_proportions(proportion_sd, rng) if proportion_sd else {}
    return SimulatedSubject(name, side, HandDimensions(length, breadth, thickness, proportions), placements)


def _draw_proportions(sd: float, rng: np.random.Generator) -> dict[str, float]:
    """Return a factor for each site's distance; those of the middle finger keep the hand's length."""
    factors = 1 + sd * np.clip(rng.standard_normal(len(SITES)), -2.5, 2.5)
    middle = slice(SITES.index("middle_mcp"), SITES.index("middle_tip") + 1)
    shares = [BASE_JOINT_PROPORTIONS["middle"][0], *SEGMENT_LENGTH_PER_HAND_LENGTH["middle"]]
    factors /= np.average(factors[middle], weights=shares)
    return {site: round(float(factor), 5) for site, factor in zip(SITES, factors, strict=True)}


def placements_of(forearm: Mapping[str, tuple[float, float, float]]) -> dict[str, MarkerPlacement]:
    """Return the 24 markers: those of the forearm at offsets [m], the others over their sites."""
    placements = {label: MarkerPlacement("forearm", offset=offset) for label, offset in forearm.items()}
    return placements | {site: MarkerPlacement(SEGMENT_OF_SITE[site], at=site) for site in SITES}


def _forearm_offsets(breadth: float, rng: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """Return two markers above the wrist and two further up, around the back of the forearm [m]."""
    nominal = np.array(
        [[-0.025, 0.022, 0.016], [-0.025, -0.022, 0.016], [-0.085, 0.018, 0.026], [-0.09, -0.02, 0.024]]
    )
    scale = [1.0, breadth / 0.084, breadth / 0.084]
    offsets = np.round(nominal * scale + 0.004 * rng.standard_normal(nominal.shape), 5)
    return {label: (x, y, z) for label, (x, y, z) in zip(FOREARM_MARKERS, offsets.tolist(), strict=True)}
