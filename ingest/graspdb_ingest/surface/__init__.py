"""Surfaces of the hand: spheres, capsules, skin; how far they are from points and objects."""

from graspdb_ingest.surface.anatomy import HandPoints
from graspdb_ingest.surface.build import SURFACES, hand_surface, key_points
from graspdb_ingest.surface.hand_surface import HandSurface

__all__ = ["SURFACES", "HandPoints", "HandSurface", "hand_surface", "key_points"]
