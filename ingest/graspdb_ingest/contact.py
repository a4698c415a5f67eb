"""Contact sites: the paper's section II.C, equations 2 and 3.

Distances are taken in the object's frame: the 20 sphere centres move, the cloud and its search
tree stay, which is the same as moving the cloud by equation 1 and much cheaper.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, DIGITS, SITES

NO_POINT = -1
ROUNDING = 1e-9
"""Share of a distance within which a search tree may mistake which of two points is nearer."""
WORTH_ORDERING = 200
CURVE_BITS = 7
"""Centres above which they are ordered in space first, and bits of each coordinate that order them."""


@dataclass(frozen=True)
class Gaps:
    """Signed distances of spheres to an object's cloud.

    Attributes
    ----------
    gap : ndarray, shape (..., 20)
        ``min_i ||P_i - J_k|| - r_k`` [m]; below zero where the sphere reaches over the nearest
        point; NaN where the centre is not known.
    nearest : ndarray of int, shape (..., 20)
        Index of that point in the cloud, -1 where the centre is not known.
    """

    gap: Floats
    nearest: NDArray[np.int64]


@dataclass(frozen=True)
class Contacts:
    """The touching spheres of one hand and frame, in the order of the sites.

    Attributes
    ----------
    sites : ndarray of int, shape (k,)
        Places in `SITES`.
    points : ndarray of int, shape (k,)
        Contact points C_k, as indices of the cloud.
    positions, normals : ndarray, shape (k, 3)
        The contact points and the outward normals there, object frame [m].
    gap : ndarray, shape (k,)
        Signed distances [m].
    segments : tuple of str
        The segments of the hand that touch.
    pads : tuple of str
        The sides of them: palmar, dorsal, radial, ulnar or tip.
    """

    sites: NDArray[np.int64]
    points: NDArray[np.int64]
    positions: Floats
    normals: Floats
    gap: Floats
    segments: tuple[str, ...]
    pads: tuple[str, ...]

    @property
    def site_names(self) -> tuple[str, ...]:
        """Names of the touching sites."""
        return tuple(SITES[i] for i in self.sites)

    @property
    def digits(self) -> tuple[str, ...]:
        """Digits in contact, thumb first, each once."""
        touching = {DIGIT_OF_SITE[i] for i in self.sites}
        return tuple(digit for digit in DIGITS if digit in touching)


def signed_gaps(centres: Floats, radii: Floats, cloud: ObjectCloud) -> Gaps:
    """Return the signed distance of every sphere to the cloud, equation 2 less the radius.

    Parameters
    ----------
    centres : ndarray, shape (..., 20, 3)
        Sphere centres J_k in the object frame [m]; NaN where not known.
    radii : ndarray, shape (20,)
        Sphere radii r_k [m].
    cloud : ObjectCloud
        The object's surface P_i.

    Returns
    -------
    Gaps
        Distances and nearest points, in time n log m for n centres and m points. Both are those of
        equation 2 over all points, to the last bit; of equally near points the first is taken.
    """
    known = np.isfinite(centres).all(axis=-1)
    gap = np.full(known.shape, np.nan)
    nearest = np.full(known.shape, NO_POINT, dtype=np.int64)
    gap[known], nearest[known] = _nearest(centres[known], cloud)
    return Gaps(gap=gap - radii, nearest=nearest)


def _nearest(centres: Floats, cloud: ObjectCloud) -> tuple[Floats, NDArray[np.int64]]:
    """Return distance and index of the nearest point of each centre, as a search over all points would."""
    proposed = _proposed(centres, cloud)
    distances = _distance(cloud.points[proposed], centres[:, None])
    second = distances[:, 1:].min(axis=1, initial=np.inf)
    distance, index = distances[:, 0], proposed[:, 0]
    # The search's own rounding cannot order points that are equally near; those few are compared one by one.
    for i in np.flatnonzero(second <= distance * (1 + ROUNDING)):
        reach = distances[i].max() * (1 + 2 * ROUNDING)
        candidates = np.sort(cloud.tree.query_ball_point(centres[i], reach))
        exact = _distance(cloud.points[candidates], centres[i])
        index[i], distance[i] = candidates[exact.argmin()], exact.min()
    return distance, index


def _proposed(centres: Floats, cloud: ObjectCloud) -> NDArray[np.int64]:
    """Return the two points nearest to each centre but for rounding, shape (n, 2); one of a single point."""
    count = min(2, len(cloud.points))
    if not len(centres):
        return np.empty((0, count), dtype=np.int64)
    # Centres that are near each other are asked one after the other: the same points are still at hand.
    order = _space_order(centres) if len(centres) > WORTH_ORDERING else np.arange(len(centres))
    found = cloud.neighbours.knn_search(cloud.tensor(np.asarray(centres[order], dtype=np.float64)), count)[
        0
    ].numpy()
    proposed = np.empty((len(centres), count), dtype=np.int64)
    proposed[order] = found.reshape(len(centres), count)
    return proposed


def _space_order(positions: Floats) -> NDArray[np.int64]:
    """Return an order in which neighbours in space follow each other: along Morton's curve."""
    low = positions.min(axis=0)
    extent = max(float((positions.max(axis=0) - low).max()), np.finfo(float).tiny)
    cells = ((positions - low) / extent * (2**CURVE_BITS - 1)).astype(np.int64)
    code = np.zeros(len(positions), dtype=np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code)


def _distance(points: Floats, centres: Floats) -> Floats:
    """Return ``||P_i - J_k||``, equation 2."""
    return np.asarray(np.sqrt(np.sum((points - centres) ** 2, axis=-1)))
