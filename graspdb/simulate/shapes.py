"""Closed surfaces from rings: bodies of revolution, lofts, tubes and boxes, in metres."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from graspdb.simulate.arrays import Floats


def loft(rings: Floats) -> trimesh.Trimesh:
    """Return the closed surface through a sequence of rings, each end closed by a fan about its centre.

    Parameters
    ----------
    rings : ndarray, shape (n_rings, n_around, 3)
        Points of each ring [m], all starting at corresponding points and running the same way.

    Returns
    -------
    trimesh.Trimesh
        A watertight mesh with outward normals.
    """
    n_rings, n_around, _ = rings.shape
    vertices = np.concatenate(
        [rings.reshape(-1, 3), rings[0].mean(axis=0)[None], rings[-1].mean(axis=0)[None]]
    )
    here = np.arange(n_around)
    following = np.roll(here, -1)
    faces = []
    for i in range(n_rings - 1):
        low, high = i * n_around, (i + 1) * n_around
        faces.append(np.column_stack([low + here, low + following, high + following]))
        faces.append(np.column_stack([low + here, high + following, high + here]))
    first, last = n_rings * n_around, n_rings * n_around + 1
    top = (n_rings - 1) * n_around
    faces.append(np.column_stack([np.full(n_around, first), following, here]))
    faces.append(np.column_stack([np.full(n_around, last), top + here, top + following]))
    mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def revolve(profile: Floats, n_around: int = 72) -> trimesh.Trimesh:
    """Return the surface of revolution of a profile about the z axis.

    Parameters
    ----------
    profile : ndarray, shape (n, 2)
        Radius (above zero) and height [m]; both ends are closed by flat discs.
    n_around : int
        Points around the axis.
    """
    angle = 2 * np.pi * np.arange(n_around) / n_around
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = np.empty((len(profile), n_around, 3))
    rings[:, :, :2] = profile[:, None, :1] * around
    rings[:, :, 2] = profile[:, None, 1]
    return loft(rings)


def superellipse_loft(profile: Floats, n_around: int = 96) -> trimesh.Trimesh:
    """Return a body whose level sections are rounded squares.

    Parameters
    ----------
    profile : ndarray, shape (n, 3)
        Half width [m], height [m] and exponent of the section (2 is a circle, 5 nearly a square).
    n_around : int
        Points around the axis.
    """
    angle = 2 * np.pi * (np.arange(n_around) + 0.5) / n_around
    cosine, sine = np.cos(angle), np.sin(angle)
    rings = np.empty((len(profile), n_around, 3))
    for ring, (half_width, height, exponent) in zip(rings, profile, strict=True):
        radius = half_width * (np.abs(cosine) ** exponent + np.abs(sine) ** exponent) ** (-1 / exponent)
        ring[:] = np.column_stack([radius * cosine, radius * sine, np.full(n_around, height)])
    return loft(rings)


def tube(path: Floats, half_depth: float, half_width: float, n_around: int = 28) -> trimesh.Trimesh:
    """Return a tube of elliptic section along a path in the x-z plane.

    Parameters
    ----------
    path : ndarray, shape (n, 3)
        Centre line [m], with y zero.
    half_depth : float
        Half axis of the section in the plane of the path [m].
    half_width : float
        Half axis of the section along y [m].
    n_around : int
        Points around the section.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.array([0.0, 1.0, 0.0])
    normal = np.cross(tangent, across)
    angle = 2 * np.pi * np.arange(n_around) / n_around
    rings = (
        path[:, None]
        + half_depth * np.cos(angle)[None, :, None] * normal[:, None]
        + half_width * np.sin(angle)[None, :, None] * across
    )
    return loft(rings)


def box(low: ArrayLike, high: ArrayLike) -> trimesh.Trimesh:
    """Return the box between two corners [m]."""
    mesh: trimesh.Trimesh = trimesh.creation.box(bounds=np.array([low, high], dtype=float))
    return mesh


def rounded(corners: Floats, radii: Sequence[float], step: float = 0.004) -> Floats:
    """Return a polyline with its corners rounded and no two points further apart than a step.

    Parameters
    ----------
    corners : ndarray, shape (n, 2)
        Corners of the polyline [m].
    radii : sequence of float
        Radius at each inner corner [m], n - 2 of them; shrunk where the legs are too short.
    step : float
        Largest distance between points [m].

    Returns
    -------
    ndarray, shape (m, 2)
    """
    points = [corners[0]]
    for before, corner, after, radius in zip(corners, corners[1:], corners[2:], radii, strict=False):
        points.extend(_arc(before, corner, after, radius))
    points.append(corners[-1])
    return subdivided(np.array(points), step)


def subdivided(points: Floats, step: float) -> Floats:
    """Return a polyline with points added so that none are further apart than a step [m]."""
    pieces = []
    for start, end in pairwise(points):
        n = max(1, int(np.ceil(np.linalg.norm(end - start) / step)))
        pieces.append(start + (end - start) * (np.arange(n) / n)[:, None])
    return np.concatenate([*pieces, points[-1:]])


def _arc(before: Floats, corner: Floats, after: Floats, radius: float, n: int = 6) -> Floats:
    back, ahead = before - corner, after - corner
    legs = float(np.linalg.norm(back)), float(np.linalg.norm(ahead))
    back, ahead = back / legs[0], ahead / legs[1]
    half = float(np.arccos(np.clip(back @ ahead, -1, 1))) / 2
    leg = min(radius / math.tan(half), 0.45 * min(legs))
    if leg < 1e-6 or half > np.pi / 2 - 1e-3:
        return corner[None]
    radius = leg * math.tan(half)
    bisector = (back + ahead) / np.linalg.norm(back + ahead)
    centre = corner + bisector * radius / np.sin(half)
    start, end = corner + leg * back - centre, corner + leg * ahead - centre
    span = np.pi - 2 * half
    share = np.linspace(0, 1, n)[:, None]
    return np.asarray(
        centre + (np.sin((1 - share) * span) * start + np.sin(share * span) * end) / np.sin(span)
    )
