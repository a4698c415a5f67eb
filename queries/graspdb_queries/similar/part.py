"""A part of an object as the comparison of shapes needs it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]

SPARSE_POINTS: Final = 64
DENSE_POINTS: Final = 128
SCORED_POINTS: Final = 400


@dataclass(frozen=True, eq=False)
class Sample:
    """Some points of a part [m], their normals and histograms."""

    points: Floats
    normals: Floats
    histograms: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Part:
    """A part of an object: the points of a graspable feature, or a cloud from outside.

    Attributes
    ----------
    name : str
        Key of the grasp, or name of the file.
    points, normals : ndarray, shape (n, 3)
        Positions [m] and outward unit normals, in the frame of the object.
    histograms : ndarray of float32, shape (n, 33)
        FPFH of the points.
    object_from_hand : ndarray, shape (4, 4)
        Pose of the hand that encloses the part; NaN where there is none.
    oriented : bool
        Whether the normals point outwards, rather than to either side.
    """

    name: str
    points: Floats
    normals: Floats
    histograms: NDArray[np.float32]
    object_from_hand: Floats
    oriented: bool = True

    @property
    def has_hand(self) -> bool:
        """Whether the pose of a hand is known."""
        return bool(np.isfinite(self.object_from_hand).all())

    @cached_property
    def centre(self) -> Floats:
        """Mean of the points [m]."""
        return np.asarray(self.points.mean(axis=0))

    @cached_property
    def axes(self) -> Floats:
        """Principal axes as columns, longest first, right-handed, shape (3, 3)."""
        offsets = self.points - self.centre
        axes = np.linalg.eigh(offsets.T @ offsets)[1][:, ::-1].copy()
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return axes

    @cached_property
    def tree(self) -> cKDTree:
        """The points as a k-d tree."""
        return cKDTree(self.points)

    @cached_property
    def sparse(self) -> Sample:
        """Points that starts are made of and tried with, spread as far as may be."""
        return self._sample(spread(self.points, SPARSE_POINTS))

    @cached_property
    def dense(self) -> Sample:
        """Points that alignments are refined with."""
        return self._sample(spread(self.points, DENSE_POINTS))

    @cached_property
    def scored(self) -> Floats:
        """Points that distances are measured from, shape (at most 400, 3) [m]."""
        return self.points[self._scored_rows]

    @cached_property
    def scored_normals(self) -> Floats:
        """Their normals."""
        return self.normals[self._scored_rows]

    @cached_property
    def _scored_rows(self) -> NDArray[np.int64]:
        n = len(self.points)
        return np.unique(np.linspace(0, n - 1, min(n, SCORED_POINTS)).round().astype(np.int64))

    def _sample(self, chosen: NDArray[np.int64]) -> Sample:
        return Sample(self.points[chosen], self.normals[chosen], self.histograms[chosen])


def spread(points: Floats, count: int) -> NDArray[np.int64]:
    """Return `count` points, each as far from those before it as may be; all again where there are fewer."""
    if len(points) <= count:
        return np.resize(np.arange(len(points)), count)
    if len(points) > 3 * count:
        step = np.linspace(0, len(points) - 1, 3 * count).round().astype(np.int64)
        return step[spread(points[step], count)]
    chosen = np.empty(count, dtype=np.int64)
    reach = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
    chosen[0] = reach.argmax()
    reach = np.full(len(points), np.inf)
    for i in range(1, count):
        offset = points - points[chosen[i - 1]]
        np.minimum(reach, np.einsum("ni,ni->n", offset, offset), out=reach)
        chosen[i] = reach.argmax()
    return chosen
