"""A depth buffer: discs, spheres and cylinders seen from far away along z; what is nearest stays."""

from dataclasses import dataclass
from itertools import product
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

NOTHING: Final = 0
"""Material of a pixel in which nothing is."""

_EDGE_ON: Final = 0.15
"""Discs are drawn as if they were turned to the eye at least this much."""


@dataclass(frozen=True, eq=False)
class Raster:
    """What is seen in each pixel of a square picture; x to the right, y up, z to the eye, in pixels.

    Attributes
    ----------
    depth : ndarray, shape (size, size)
        z of what is seen; -inf where nothing is.
    normal : ndarray, shape (size, size, 3)
        Its unit normal, towards the eye.
    material : ndarray of int, shape (size, size)
        What it is made of; `NOTHING` where nothing is.
    """

    depth: Floats
    normal: Floats
    material: Integers

    @classmethod
    def empty(cls, size: int) -> Self:
        """Return a picture with nothing in it."""
        shape = (size, size)
        return cls(np.full(shape, -np.inf), np.zeros((*shape, 3)), np.full(shape, NOTHING))

    def add_discs(self, centres: Floats, normals: Floats, radius: float, material: Integers) -> None:
        """Draw flat discs, seen from both sides.

        Parameters
        ----------
        centres, normals : ndarray, shape (n, 3)
            Where they are, and their unit normals.
        radius : float
            Their radius.
        material : ndarray, shape (n,)
            What each is made of.
        """
        size = len(self.depth)
        near = ((centres[:, :2] > -radius) & (centres[:, :2] < size + radius)).all(axis=1)
        centres, normals, material = centres[near], normals[near], material[near]
        facing = normals * np.where(normals[:, 2:] < 0, -1.0, 1.0)
        slope = -facing[:, :2] / np.maximum(facing[:, 2:], _EDGE_ON)
        column, row = np.floor(centres[:, :2]).astype(np.int64).T
        reach = int(np.ceil(radius))
        for i, j in product(range(-reach, reach + 1), repeat=2):
            x, y = column + (i + 0.5) - centres[:, 0], row + (j + 0.5) - centres[:, 1]
            rise = slope[:, 0] * x + slope[:, 1] * y
            inside = x * x + y * y + rise * rise <= radius**2
            inside &= (column >= -i) & (column < size - i) & (row >= -j) & (row < size - j)
            chosen = np.flatnonzero(inside)
            self._put(
                row[chosen] + j,
                column[chosen] + i,
                centres[chosen, 2] + rise[chosen],
                chosen,
                facing,
                material,
            )

    def add_sphere(self, centre: Floats, radius: float, material: int) -> None:
        """Draw a sphere about `centre`, shape (3,)."""
        window, x, y = self._window(centre[:2] - radius, centre[:2] + radius, centre)
        square = radius**2 - x * x - y * y
        rise = np.sqrt(np.maximum(square, 0.0))
        normal = np.stack(np.broadcast_arrays(x, y, rise), axis=-1) / radius
        self._put_window(window, np.where(square >= 0, centre[2] + rise, -np.inf), normal, material)

    def add_cylinder(self, ends: Floats, radius: float, material: int) -> None:
        """Draw the side of a cylinder between two `ends`, shape (2, 3)."""
        axis = ends[1] - ends[0]
        length = float(np.linalg.norm(axis))
        if length == 0:
            return
        axis = axis / length
        window, x, y = self._window(
            ends[:, :2].min(axis=0) - radius, ends[:, :2].max(axis=0) + radius, ends[0]
        )
        # A point (x, y, z) lies on it if its distance from the axis is the radius: a quadratic equation in z.
        along = x * axis[0] + y * axis[1]
        across = max(1 - axis[2] ** 2, 1e-12)
        half = along * axis[2]
        root = half**2 - across * (x * x + y * y - along**2 - radius**2)
        z = (half + np.sqrt(np.maximum(root, 0.0))) / across
        place = along + z * axis[2]
        normal = np.stack(np.broadcast_arrays(x, y, z), axis=-1) - place[..., None] * axis
        there = (root >= 0) & (place >= 0) & (place <= length)
        self._put_window(window, np.where(there, ends[0, 2] + z, -np.inf), normal / radius, material)

    def _window(
        self, low: Floats, high: Floats, origin: Floats
    ) -> tuple[tuple[slice, slice], Floats, Floats]:
        """Return the pixels between corners, and x (1, n) and y (m, 1) of their middles from an origin."""
        (left, bottom), (right, top) = (
            np.clip(np.floor(c), 0, len(self.depth)).astype(int) for c in (low, high + 1)
        )
        x = np.arange(left, right)[None, :] + 0.5 - origin[0]
        y = np.arange(bottom, top)[:, None] + 0.5 - origin[1]
        return (slice(bottom, top), slice(left, right)), x, y

    def _put_window(self, window: tuple[slice, slice], depth: Floats, normal: Floats, material: int) -> None:
        """Set the pixels of a window where `depth` is nearer than what is there."""
        nearer = depth > self.depth[window]
        self.depth[window][nearer] = depth[nearer]
        self.normal[window][nearer] = normal[nearer]
        self.material[window][nearer] = material

    def _put(
        self,
        row: Integers,
        column: Integers,
        depth: Floats,
        chosen: Integers,
        normals: Floats,
        material: Integers,
    ) -> None:
        """Set pixels, which may come several times, where `depth` is nearer than what is there."""
        np.maximum.at(self.depth, (row, column), depth)
        nearest = self.depth[row, column] == depth
        row, column, chosen = row[nearest], column[nearest], chosen[nearest]
        self.normal[row, column] = normals[chosen]
        self.material[row, column] = material[chosen]
