"""Round shapes as triangles, to draw them."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]

AROUND: Final = 28
"""Corners round a capsule."""

ALONG: Final = 8
"""Rings of each of its two caps."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A shape of one colour per corner.

    Attributes
    ----------
    vertices, normals, colours : ndarray, shape (n, 3)
        Corners [m], outward unit normals, and red, green and blue from 0 to 1.
    faces : ndarray of int, shape (m, 3)
        Indices of corners.
    """

    vertices: Floats
    normals: Floats
    colours: Floats
    faces: Integers


def joined(parts: list[Triangles]) -> Triangles:
    """Return several shapes as one."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    empty = np.empty((0, 3))
    return Triangles(
        np.concatenate([empty, *(part.vertices for part in parts)]),
        np.concatenate([empty, *(part.normals for part in parts)]),
        np.concatenate([empty, *(part.colours for part in parts)]),
        np.concatenate(
            [np.empty((0, 3), np.int32), *(p.faces + k for p, k in zip(parts, offsets[:-1], strict=True))]
        ).astype(np.int32),
    )


def capsule(start: Floats, end: Floats, start_radius: float, end_radius: float, colour: Floats) -> Triangles:
    """Return the hull of two spheres; of one, where the ends are one point or one holds the other."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    lean = (start_radius - end_radius) / length if length > 0 else 2.0
    if abs(lean) >= 1:
        centre, radius = (start, start_radius) if start_radius >= end_radius else (end, end_radius)
        return _rings(centre, centre, radius, radius, np.array([0.0, 0.0, 1.0]), 0.0, colour)
    return _rings(start, end, start_radius, end_radius, axis / length, lean, colour)


def sphere(centre: Floats, radius: float, colour: Floats) -> Triangles:
    """Return a sphere."""
    return capsule(centre, centre, radius, radius, colour)


def _rings(
    start: Floats, end: Floats, r0: float, r1: float, axis: Floats, lean: float, colour: Floats
) -> Triangles:
    """Sweep rings round the axis: the cap of the start, then that of the end, which meet in a cone.

    The cone touches both spheres where their normals have the sine `lean` along the axis.
    """
    seam = np.arcsin(lean)
    latitudes = np.concatenate(
        [np.linspace(-np.pi / 2, seam, ALONG + 1), np.linspace(seam, np.pi / 2, ALONG + 1)]
    )
    turns = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    circle = np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * up
    normals = (np.cos(latitudes)[:, None, None] * circle + np.sin(latitudes)[:, None, None] * axis).reshape(
        -1, 3
    )
    first = np.repeat(np.arange(len(latitudes)) <= ALONG, AROUND)[:, None]
    vertices = np.where(first, start + r0 * normals, end + r1 * normals)
    return Triangles(vertices, normals, np.broadcast_to(colour, vertices.shape), _ring_faces(len(latitudes)))


@cache
def _ring_faces(rings: int) -> Integers:
    ring, turn = np.meshgrid(np.arange(rings - 1), np.arange(AROUND), indexing="ij")
    here, beside = ring * AROUND + turn, ring * AROUND + (turn + 1) % AROUND
    quads = np.stack([here, beside, beside + AROUND, here, beside + AROUND, here + AROUND], axis=-1)
    return quads.reshape(-1, 3).astype(np.int32)
