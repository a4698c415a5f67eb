"""Signed gaps of a hand's surface to an object, site by site, and where they touch.

Each site owns the part of the surface that is nearest to it along the bones; its gap is the least
signed distance of that part to the object: the least ``d(c) - r`` over the spheres that the part is the
union of, where d is the object's own distance. Spheres alone are asked as they are. Over capsules
and wedges the spheres are first asked every few millimetres, then the best one is moved to the sphere
nearest to its own contact point until that changes nothing; each step can only lessen the gap, and where
the object is convex it ends at the least.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.objects.distance import Nearest, ObjectDistance
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_ingest.surface.rounded import Integers, nearest_weights
from graspdb_schemas.vocabulary import N_SITES

SAMPLE_SPACING: Final = (0.004, 0.010)
"""Distances at which spheres along a cone-sphere and in a wedge are first asked [m]."""
LEAST_GAIN: Final = 1e-7
"""A step that lessens the gap by no more than this ends the search [m]."""
STEPS: Final = 8
"""Most steps from the best of those to the least gap."""
LOCAL_RADIUS: Final = 0.02
"""An object is taken to be as round as this where a sphere's centre lies inside it [m]."""
FRAMES_AT_ONCE: Final = 64


@dataclass(frozen=True, eq=False)
class SiteGaps:
    """Gaps of the 20 parts of a hand's surface to an object, in the object frame.

    Attributes
    ----------
    gap : ndarray, shape (..., 20)
        Signed distance of the site's part of the surface [m]; NaN where the hand is not known.
    positions, normals : ndarray, shape (..., 20, 3)
        The object's point that is nearest [m], and its outward normal there.
    centres : ndarray, shape (..., 20, 3)
        Centre of the sphere of the hand that comes nearest [m].
    shapes : ndarray of int, shape (..., 20)
        The shape of the surface that it belongs to; -1 where the hand is not known.
    """

    gap: Floats
    positions: Floats
    normals: Floats
    centres: Floats
    shapes: Integers

    def frame(self, index: int) -> "SiteGaps":
        """Return the gaps of one frame."""
        return SiteGaps(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    def fill(self, frames: Integers, some: "SiteGaps") -> None:
        """Put the gaps of some frames in their places."""
        for name in self.__dataclass_fields__:
            getattr(self, name)[frames] = getattr(some, name)


def unknown_gaps(*leading: int) -> SiteGaps:
    """Return the gaps of a hand or an object that is not known, for leading axes such as frames."""
    nowhere = np.full((*leading, N_SITES, 3), np.nan)
    shapes = np.full((*leading, N_SITES), -1, dtype=np.int64)
    return SiteGaps(nowhere[..., 0].copy(), nowhere, nowhere.copy(), nowhere.copy(), shapes)


def site_gaps(surface: HandSurface, target: ObjectDistance) -> SiteGaps:
    """Return the gap of each site's part of a hand's surface to an object.

    Parameters
    ----------
    surface : HandSurface
        The hand in n frames, object frame: ``centres`` of shape (n, k, 3), NaN where it is not known.
    target : ObjectDistance
        The object.

    Returns
    -------
    SiteGaps
        Of shape (n, 20).
    """
    gaps = unknown_gaps(len(surface.centres))
    known = np.flatnonzero(np.isfinite(surface.centres).all(axis=(1, 2)))
    find = _of_spheres if _is_spheres(surface) else _refined
    for start in range(0, len(known), FRAMES_AT_ONCE):
        frames = known[start : start + FRAMES_AT_ONCE]
        gaps.fill(frames, find(surface, surface.centres[frames], target))
    return gaps


def _is_spheres(surface: HandSurface) -> bool:
    """Return whether a surface is one sphere for each site, in their order."""
    return np.array_equal(surface.sites, np.arange(N_SITES)) and bool(
        (surface.shapes == surface.shapes[:, :1]).all()
    )


def _of_spheres(surface: HandSurface, centres: Floats, target: ObjectDistance) -> SiteGaps:
    """Return the gaps of one sphere for each site, in frames in which the hand is known."""
    spheres = surface.shapes[:, 0]
    asked = np.asarray(centres[:, spheres], dtype=np.float64)
    nearest = target.nearest(asked)
    shapes = np.broadcast_to(surface.sites, nearest.distance.shape)
    gap = nearest.distance - surface.radii[spheres]
    return SiteGaps(gap, nearest.positions, nearest.normals, asked, shapes)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Places of a surface that are asked first: shape (s,), weights (s, 3), owner (s,), site by site."""

    shapes: Integers
    weights: Floats
    starts: Integers


def _refined(surface: HandSurface, centres: Floats, target: ObjectDistance) -> SiteGaps:
    """Return the gaps of frames in which the hand is known."""
    shapes, weights, nearest, gap = _best_samples(surface, _samples(surface, centres[0]), centres, target)
    corners = surface.shapes[shapes]
    spanning, radii = (
        np.take_along_axis(centres, corners.reshape(len(centres), -1, 1), axis=1),
        surface.radii[corners],
    )
    spanning = spanning.reshape(*corners.shape, 3)
    moving = np.asarray((corners != corners[..., :1]).any(axis=-1))
    for _ in range(STEPS):
        if not moving.any():
            break
        moved = nearest_weights(_attracting(nearest, moving), spanning[moving], radii[moving])
        again = target.nearest(np.einsum("nk,nki->ni", moved, spanning[moving]))
        less = again.distance - np.sum(moved * radii[moving], axis=-1)
        better = less < gap[moving] - LEAST_GAIN
        where = tuple(axis[better] for axis in np.nonzero(moving))
        gap[where], weights[where] = less[better], moved[better]
        for name in ("distance", "positions", "normals"):
            getattr(nearest, name)[where] = getattr(again, name)[better]
        moving[moving] = better
    asked = np.einsum("fsk,fski->fsi", weights, spanning)
    return SiteGaps(gap, nearest.positions, nearest.normals, asked, shapes)


def _attracting(nearest: Nearest, which: Bools) -> Floats:
    """Return what spheres are moved to: the object's nearest point, or one behind it for those inside."""
    distance = nearest.distance[which]
    depth = np.where(distance < 0, LOCAL_RADIUS - distance, 0.0)
    return np.asarray(nearest.positions[which] - depth[:, None] * nearest.normals[which])


def _best_samples(
    surface: HandSurface, samples: _Samples, centres: Floats, target: ObjectDistance
) -> tuple[Integers, Floats, Nearest, Floats]:
    """Return of each frame and site the sample with the least gap: shape, weights, nearest, gap."""
    corners = surface.shapes[samples.shapes]
    radii = np.sum(samples.weights * surface.radii[corners], axis=-1)
    asked = np.einsum("sk,fski->fsi", samples.weights, centres[:, corners])
    nearest = target.nearest(asked)
    gap = nearest.distance - radii
    ends = [*samples.starts[1:], len(samples.shapes)]
    best = np.stack(
        [start + gap[:, start:end].argmin(axis=1) for start, end in zip(samples.starts, ends, strict=True)],
        axis=1,
    )
    rows = np.arange(len(centres))[:, None]
    chosen = Nearest(nearest.distance[rows, best], nearest.positions[rows, best], nearest.normals[rows, best])
    return samples.shapes[best], samples.weights[best], chosen, gap[rows, best]


def _samples(surface: HandSurface, centres: Floats) -> _Samples:
    """Return the places that are asked first, by site: more of them on longer shapes."""
    a, b, c = surface.shapes.T
    n_corners = 1 + (b != a) + ((c != a) & (c != b))
    spanning = centres[surface.shapes]
    longest = np.linalg.norm(spanning - np.roll(spanning, 1, axis=1), axis=2).max(axis=1)
    steps = np.ceil(longest / np.where(n_corners == 3, *SAMPLE_SPACING[::-1])).astype(np.int64)
    lattices = [_lattice(*kind) for kind in zip(steps.tolist(), n_corners.tolist(), strict=True)]
    shape = np.repeat(np.arange(len(lattices)), [len(lattice) for lattice in lattices])
    weight = np.concatenate(lattices)
    owners = surface.sites[shape]
    order = np.argsort(owners, kind="stable")
    starts = np.searchsorted(owners[order], np.arange(N_SITES))
    return _Samples(shape[order], weight[order], starts)


@lru_cache
def _lattice(steps: int, corners: int) -> Floats:
    """Return evenly spread barycentric places of a sphere, a cone-sphere or a wedge, shape (n, 3)."""
    if corners == 1 or steps == 0:
        return np.array([[1.0, 0.0, 0.0]])
    share = np.arange(steps + 1) / steps
    if corners == 2:
        return np.column_stack([1 - share, share, np.zeros(steps + 1)])
    first, second = (grid.ravel() for grid in np.meshgrid(share, share, indexing="ij"))
    inside = first + second <= 1 + 1e-9
    return np.column_stack([1 - first - second, first, second])[inside].clip(0.0)
