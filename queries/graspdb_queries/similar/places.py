"""Places of a new object that a hand might grasp: neighbourhoods of the sizes that features have."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from graspdb_queries.similar.library import Cloud
from graspdb_queries.similar.metric import Vectors
from graspdb_queries.similar.part import Part, spread

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

APART: Final = 0.030
"""Distance of places that is aimed at [m]: half of what a hand spans in a pinch, roughly."""

FEWEST_SEEDS: Final = 8
MOST_SEEDS: Final = 64

LEAST_POINTS: Final = 10
"""Fewer points than this are no surface to describe."""

CENTRED: Final = 3
"""Times that a neighbourhood is taken anew about its own middle, so that it reaches around a handle."""

SAME: Final = 0.8
"""Shared points over all points (intersection over union) above which two places are one."""


@dataclass(frozen=True, eq=False)
class NewObject:
    """An object from outside, described as those of a database are.

    Attributes
    ----------
    name : str
        Name of its file.
    kind : str
        Kind of its descriptors.
    cloud : Cloud
        Its points and normals, in the file's frame [m], and histograms.
    area : float
        Area of its surface [m2].
    describe : callable
        Descriptor, float32, shape (428,), of the points of given rows.
    """

    name: str
    kind: str
    cloud: Cloud
    area: float
    describe: Callable[[Rows], Vectors]

    @cached_property
    def tree(self) -> cKDTree:
        """The points as a k-d tree."""
        return cKDTree(self.cloud.points)

    def part(self, rows: Rows) -> Part:
        """Return some of its points as a part."""
        cloud = self.cloud
        unknown = np.full((4, 4), np.nan)
        return Part(self.name, cloud.points[rows], cloud.normals[rows], cloud.histograms[rows], unknown)


def places_on(new: NewObject, sizes: Sequence[int]) -> list[Rows]:
    """Return places: rows of points about evenly spread seeds, of each size.

    A place is the points nearest to a seed, and those nearest to the middle of such points: the first is
    one side of a wall or body, the second a section of what is thin enough to be held all around.

    Parameters
    ----------
    new : NewObject
        The object.
    sizes : sequence of int
        Numbers of points.
    """
    n_points = len(new.cloud.points)
    wanted = int(np.clip(np.ceil(new.area / APART**2), FEWEST_SEEDS, MOST_SEEDS))
    seeds = new.cloud.points[np.unique(spread(new.cloud.points, min(wanted, n_points)))]
    found: list[Rows] = []
    for size in sorted({int(np.clip(size, LEAST_POINTS, n_points)) for size in sizes}):
        found += _distinct(_neighbourhoods(new, seeds, size), n_points)
    return found


def _neighbourhoods(new: NewObject, seeds: Floats, size: int) -> Iterator[Rows]:
    centres = seeds
    for step in range(CENTRED + 1):
        rows = np.asarray(new.tree.query(centres, k=size)[1], dtype=np.int64).reshape(len(seeds), size)
        if step in (0, CENTRED):
            yield from rows
        centres = new.cloud.points[rows].mean(axis=1)


def _distinct(places: Iterator[Rows], n_points: int) -> list[Rows]:
    """Return places of one size, those left out that are nearly the same as one before."""
    kept: list[Rows] = []
    taken = np.zeros((0, n_points), dtype=bool)
    for rows in places:
        shared = taken[:, rows].sum(axis=1)
        if (shared < SAME * (2 * len(rows) - shared)).all():
            kept.append(np.sort(rows))
            mask = np.zeros((1, n_points), dtype=bool)
            mask[0, rows] = True
            taken = np.concatenate([taken, mask])
    return kept
