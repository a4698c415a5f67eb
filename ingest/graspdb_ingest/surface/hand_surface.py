"""A hand's surface as a union of rounded shapes, each of which belongs to sites and a segment."""

from dataclasses import dataclass

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.surface.rounded import Distances, Integers, rounded_distances


@dataclass(frozen=True, eq=False)
class HandSurface:
    """The surface of a posed hand, or of a hand in many frames.

    Attributes
    ----------
    centres : ndarray, shape (..., k, 3)
        Centres of the spheres that the shapes are spanned by [m]; the leading axes are frames.
    radii : ndarray, shape (k,)
        Their radii [m].
    shapes : ndarray of int, shape (m, 3)
        Which three span each shape: a cone-sphere repeats its last one, a sphere its only one.
    sites : ndarray of int, shape (m,)
        The site that each shape belongs to, as a place in `SITES`.
    segments : tuple of str, length m
        The segment that each shape is part of.
    """

    centres: Floats
    radii: Floats
    shapes: Integers
    sites: Integers
    segments: tuple[str, ...]

    def distances(self, points: Floats) -> Distances:
        """Return the signed distance of points, shape (n, 3), to the surface of a single posed hand."""
        return rounded_distances(points, self.centres, self.radii, self.shapes)

    def sphere_at(self, shape: Integers, weights: Floats) -> tuple[Floats, Floats]:
        """Return centre (n, 3) and radius (n,) [m] of the spheres at places of a single posed hand."""
        corners = self.shapes[shape]
        centres = np.einsum("...k,...ki->...i", weights, self.centres[corners])
        return np.asarray(centres), np.asarray(np.sum(weights * self.radii[corners], axis=-1))

    def frame(self, index: int) -> "HandSurface":
        """Return the hand of one frame."""
        return HandSurface(self.centres[index], self.radii, self.shapes, self.sites, self.segments)
