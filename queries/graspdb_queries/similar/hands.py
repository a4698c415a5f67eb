"""Postures and contact patterns of many grasps as arrays that compare at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.vocabulary import CONFIGURATION, N_SITES, SITES

Floats = NDArray[np.float64]

_FIRST_ANGLE: Final = CONFIGURATION.index("wrist_flexion") + 2
"""Angles of the digits begin here; those of the wrist do not shape the hand."""

_CHAINS: Final = np.arange(N_SITES).reshape(5, 4)


@dataclass(frozen=True, eq=False)
class Hands:
    """Hands of grasps, a row each.

    Attributes
    ----------
    sites : ndarray, shape (n, 20, 3)
        Sphere centres in the hand's frame, those of left hands mirrored to a right one [m]; NaN where the
        hand's pose is not known.
    sizes : ndarray, shape (n,)
        Summed length of the segments of all digits [m].
    angles : ndarray, shape (n, 21)
        Joint angles of the digits [rad]; NaN where they are not known.
    touching : ndarray of bool, shape (n, 20)
        Sites in contact.
    """

    sites: Floats
    sizes: Floats
    angles: Floats
    touching: NDArray[np.bool_]

    def row(self, i: int) -> "Hands":
        """Return one hand."""
        some = slice(i, i + 1)
        return Hands(self.sites[some], self.sizes[some], self.angles[some], self.touching[some])

    def take(self, rows: NDArray[np.int64]) -> "Hands":
        """Return some hands."""
        return Hands(self.sites[rows], self.sizes[rows], self.angles[rows], self.touching[rows])


def hands_of(
    sites_object: Floats,
    object_from_hand: Floats,
    left: NDArray[np.bool_],
    q: Floats,
    touching: NDArray[np.bool_],
) -> Hands:
    """Return hands from columns of `grasps`.

    Parameters
    ----------
    sites_object : ndarray, shape (n, 20, 3)
        Sphere centres in the object frame [m].
    object_from_hand : ndarray, shape (n, 4, 4)
        Poses of the hand; NaN where not known.
    left : ndarray of bool, shape (n,)
        Which are left hands.
    q : ndarray, shape (n, 30)
        Configurations; NaN where not known.
    touching : ndarray of bool, shape (n, 20)
        Sites in contact.
    """
    offsets = sites_object - object_from_hand[:, None, :3, 3]
    sites = np.einsum("nki,nij->nkj", offsets, object_from_hand[:, :3, :3])
    sites[left, :, 1] *= -1
    chains = sites_object[:, _CHAINS]
    sizes = np.linalg.norm(np.diff(chains, axis=2), axis=3).sum(axis=(1, 2))
    return Hands(sites, sizes, q[:, _FIRST_ANGLE:], touching)


def posture_distances(query: Hands, hands: Hands, kind: str) -> Floats:
    """Return how far postures are from a query's, shape (n,); NaN where one is not known.

    Parameters
    ----------
    query : Hands
        One hand.
    hands : Hands
        Those to compare.
    kind : {'scaled', 'metric', 'angles'}
        Root mean square distance of the sites in the hand's frame [m], every hand brought to the size of
        the query's or left as it is; or of the digits' joint angles [rad].
    """
    if kind == "angles":
        return np.asarray(np.sqrt(np.mean((hands.angles - query.angles) ** 2, axis=1)))
    scale = query.sizes / hands.sizes if kind == "scaled" else np.ones(len(hands.sizes))
    offsets = hands.sites * scale[:, None, None] - query.sites
    return np.asarray(np.sqrt(np.mean(np.sum(offsets**2, axis=2), axis=1)))


def posture_in_units(query: Hands, hands: Hands, kind: str) -> Floats:
    """Return `posture_distances` in the unit that weights have: millimetres, or degrees for angles."""
    distances = posture_distances(query, hands, kind)
    return np.degrees(distances) if kind == "angles" else 1e3 * distances


def contact_distances(query: Hands, hands: Hands) -> Floats:
    """Return the share of sites in contact in either hand that are not in both (Jaccard), shape (n,)."""
    both = (hands.touching & query.touching).sum(axis=1)
    either = (hands.touching | query.touching).sum(axis=1)
    return np.asarray(1 - both / np.maximum(either, 1))


def site_names(touching: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the names of the sites that are true, shape (20,)."""
    return tuple(SITES[i] for i in np.flatnonzero(touching))


def touching_of(names: Sequence[Sequence[str] | None]) -> NDArray[np.bool_]:
    """Return which sites are named, shape (n, 20)."""
    place = {site: i for i, site in enumerate(SITES)}
    touching = np.zeros((len(names), N_SITES), dtype=bool)
    for row, listed in enumerate(names):
        for name in listed or ():
            touching[row, place[name]] = True
    return touching


def set_distance(first: Floats, second: Floats) -> float:
    """Return the Chamfer distance of two small sets of points, (n, 3) and (m, 3) [m]; NaN if one is empty."""
    if not len(first) or not len(second):
        return float("nan")
    apart = np.linalg.norm(first[:, None] - second, axis=2)
    return float(apart.min(axis=0).mean() + apart.min(axis=1).mean()) / 2
