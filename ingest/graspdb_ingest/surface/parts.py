"""Collecting the shapes of a hand's surface."""

from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.surface.anatomy import HandPoints
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_schemas.vocabulary import N_SITES

WRIST_RADIUS: Final = 1.2
"""Half the wrist's depth over the radius at the knuckle of the middle finger.

Wrist and knuckles are about 38 and 32 mm deep in a hand 87 mm broad (Pheasant, "Bodyspace", 1986).
"""


class Parts:
    """Shapes of a hand's surface as they are put together; the first 20 nodes are the sites.

    Parameters
    ----------
    hand : HandPoints
        The hand, whose frames all nodes share.
    """

    def __init__(self, hand: HandPoints) -> None:
        self.hand = hand
        self.centres: list[Floats] = [hand.sites[..., i, :] for i in range(N_SITES)]
        self.radii: list[float] = hand.radii.tolist()
        self._shapes: list[tuple[int, int, int]] = []
        self._sites: list[int] = []
        self._segments: list[str] = []
        self._middles: dict[tuple[int, int], int] = {}

    def node(self, centre: Floats, radius: float) -> int:
        """Add a sphere that shapes may use, and return its number."""
        self.centres.append(centre)
        self.radii.append(radius)
        return len(self.radii) - 1

    def add(self, nodes: tuple[int, ...], site: int, segment: str) -> None:
        """Add a shape over one to three nodes, the site that it belongs to, and its segment."""
        self._shapes.append((nodes[0], nodes[min(1, len(nodes) - 1)], nodes[-1]))
        self._sites.append(site)
        self._segments.append(segment)

    def between(self, near: int, far: int) -> int:
        """Add the sphere half way between two sites, where the part of one ends, and return its number."""
        key = (near, far)
        if key not in self._middles:
            centre = (self.centres[near] + self.centres[far]) / 2
            self._middles[key] = self.node(centre, (self.radii[near] + self.radii[far]) / 2)
        return self._middles[key]

    def surface(self) -> HandSurface:
        """Return the surface."""
        return HandSurface(
            centres=np.stack(self.centres, axis=-2),
            radii=np.array(self.radii),
            shapes=np.array(self._shapes, dtype=np.int64),
            sites=np.array(self._sites, dtype=np.int64),
            segments=tuple(self._segments),
        )
