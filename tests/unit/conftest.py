"""Hands that several test modules build."""

import numpy as np
import pytest

from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import FOREARM_MARKERS, SEGMENT_OF_SITE, SITES, Side

FOREARM_OFFSETS = ((-0.09, 0.02, 0.03), (-0.09, -0.02, 0.03), (-0.04, 0.025, 0.025), (-0.04, -0.025, 0.025))


@pytest.fixture(scope="session")
def dorsal_markers() -> dict[str, MarkerPlacement]:
    """Return 24 markers, those of the forearm at known places."""
    forearm = zip(FOREARM_MARKERS, FOREARM_OFFSETS, strict=True)
    return {
        **{label: MarkerPlacement("forearm", offset=offset) for label, offset in forearm},
        **{site: MarkerPlacement(SEGMENT_OF_SITE[site], at=site) for site in SITES},
    }


@pytest.fixture(scope="session")
def hands(dorsal_markers: dict[str, MarkerPlacement]) -> dict[Side, HandModel]:
    """Return a right and a left hand of usual size, with 24 markers, the left one's mirrored too."""
    size = HandDimensions(hand_length=0.19, hand_breadth=0.084)
    mirrored = {
        label: MarkerPlacement(p.segment, offset=tuple(np.array(p.offset) * (1, -1, 1)))
        if p.offset is not None
        else p
        for label, p in dorsal_markers.items()
    }
    return {
        Side.RIGHT: build_hand(size, Side.RIGHT, dorsal_markers),
        Side.LEFT: build_hand(size, Side.LEFT, mirrored),
    }
