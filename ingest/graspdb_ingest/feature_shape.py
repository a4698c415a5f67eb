"""What a graspable feature is like: its connected pieces, how it bends, which side of the hand it faces.

All rules are geometric and in millimetres, since a hand has one size whatever the object's is.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_schemas.vocabulary import Side

FLAT_RADIUS: Final = 0.1
"""A surface that bends less than this: under a finger pad it sags by a quarter of a millimetre [m]."""
HANDLE_RADIUS: Final = 0.025
"""Handles that a hand wraps are up to 50 mm thick [m]."""
SHARP_RADIUS: Final = 0.006
"""A bend narrower than the neighbourhood that curvature is taken from [m]."""
HANDLE_TURN: Final = 0.67
"""Length of a handle's mean unit normal: 0 all round it, 0.64 half-way, 0.71 over a right angle."""
SHARE: Final = 0.5
EDGE_SHARE: Final = 0.1

CURVATURE_CLASSES: Final = ("handle", "edge", "flat", "rounded")
HAND_SIDES: Final = ("palmar", "dorsal", "radial", "ulnar", "distal", "proximal")


@dataclass(frozen=True)
class FeatureShape:
    """The shape of a graspable feature.

    Attributes
    ----------
    patches : ndarray of int, shape (n,)
        Connected piece of each point of the feature; 0 is the piece of the largest area.
    patch_areas : ndarray, shape (p,)
        Area of each piece [m2], largest first.
    curvature_class : str or None
        One of `CURVATURE_CLASSES`; None for an empty feature.
    curvature_shares : mapping of str to float
        Share of the area that is bent like a bar (``bar``), sharply (``sharp``), hardly (``flat``); they
        decide the class, and a narrow bar is both of the first two.
    hand_side : str or None
        Side of the hand that most of the area faces.
    hand_sides : mapping of str to float
        Share of the area that faces each side of the hand.
    """

    patches: NDArray[np.int64]
    patch_areas: Floats
    curvature_class: str | None
    curvature_shares: Mapping[str, float]
    hand_side: str | None
    hand_sides: Mapping[str, float]


def feature_shape(
    cloud: ObjectCloud,
    curvatures: Floats,
    neighbours: NDArray[np.int64],
    points: NDArray[np.int64],
    object_from_hand: Floats,
    side: Side,
) -> FeatureShape:
    """Return the shape of a feature.

    Parameters
    ----------
    cloud : ObjectCloud
        The object's surface.
    curvatures : ndarray, shape (n_points, 2)
        Principal curvatures of its points [1/m].
    neighbours : ndarray of int, shape (m, 2)
        Its `surface_neighbours`.
    points : ndarray of int, shape (n,)
        The feature, as indices of the cloud.
    object_from_hand : ndarray, shape (3, 3)
        Rotation of the hand segment, whose x is distal and z dorsal; NaN where it is not known.
    side : Side
        Right or left.
    """
    if not len(points):
        return FeatureShape(np.empty(0, dtype=np.int64), np.empty(0), None, {}, None, {})
    areas, normals = cloud.areas[points], cloud.normals[points]
    patches = connected_patches(points, cloud.areas, neighbours)
    shares = curvature_shares(curvatures[points], areas)
    sides = facing_sides(normals, areas, object_from_hand, side)
    return FeatureShape(
        patches=patches,
        patch_areas=np.bincount(patches, areas).astype(np.float64),
        curvature_class=curvature_class(curvatures[points], normals, areas),
        curvature_shares=shares,
        hand_side=max(sides, key=lambda name: sides[name]) if sides else None,
        hand_sides=sides,
    )


def surface_neighbours(points: Floats, normals: Floats, spacing: float) -> NDArray[np.int64]:
    """Return the pairs of points of a cloud that are neighbours on the surface, shape (m, 2).

    Neighbours are points within twice the spacing, which in an even cloud reaches all round a point. The
    two sides of a wall are no neighbours, however thin it is: their normals are opposed, or the step from
    one to the other runs along both normals. Where they meet at a rim they are connected.
    """
    pairs = cKDTree(points).query_pairs(2 * spacing, output_type="ndarray")
    first, second = normals[pairs[:, 0]], normals[pairs[:, 1]]
    step = points[pairs[:, 1]] - points[pairs[:, 0]]
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    through = np.minimum(np.abs(np.sum(step * first, axis=1)), np.abs(np.sum(step * second, axis=1)))
    beside = (np.sum(first * second, axis=1) > -0.5) & (through < 0.8)
    # By columns, each of which is searched by itself.
    return np.asfortranarray(pairs[beside], dtype=np.int64)


def connected_patches(
    points: NDArray[np.int64], areas: Floats, neighbours: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the connected piece of the surface that each point belongs to, largest area first, shape (n,).

    Parameters
    ----------
    points : ndarray of int, shape (n,)
        Some points of a cloud.
    areas : ndarray, shape (n_points,)
        Areas of all its points [m2].
    neighbours : ndarray of int, shape (m, 2)
        Its `surface_neighbours`.
    """
    place = np.full(len(areas), -1)
    place[points] = np.arange(len(points))
    first, second = neighbours.T
    begins = np.flatnonzero(place[first] >= 0)
    one, two = place[first[begins]], place[second[begins]]
    both, n = two >= 0, len(points)
    graph = coo_array((np.ones(int(both.sum())), (one[both], two[both])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    order = np.argsort(-np.bincount(labels, areas[points]), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.asarray(rank[labels], dtype=np.int64)


def curvature_shares(curvatures: Floats, areas: Floats) -> dict[str, float]:
    """Return which share of a feature's area bends like a bar, sharply, and hardly at all."""
    weights = areas / areas.sum()
    greatest = np.abs(curvatures[:, 0])
    return {
        "bar": float(weights[_bar_like(curvatures)].sum()),
        "sharp": float(weights[greatest > 1 / SHARP_RADIUS].sum()),
        "flat": float(weights[greatest < 1 / FLAT_RADIUS].sum()),
    }


def curvature_class(curvatures: Floats, normals: Floats, areas: Floats) -> str:
    """Return what a feature is like: a handle, an edge, flat or rounded.

    A handle is bent one way, outwards, to at most 50 mm across, over half of its area, and these parts
    face all round or half-way round it. An edge is bent sharply over a tenth of its area. A flat feature
    hardly bends over half of its area; all others are rounded.

    Parameters
    ----------
    curvatures : ndarray, shape (n, 2)
        Principal curvatures [1/m].
    normals : ndarray, shape (n, 3)
        Outward unit normals.
    areas : ndarray, shape (n,)
        Areas that the points stand for [m2].
    """
    shares, bar = curvature_shares(curvatures, areas), _bar_like(curvatures)
    if shares["bar"] >= SHARE:
        mean = areas[bar] @ normals[bar] / areas[bar].sum()
        if np.linalg.norm(mean) <= HANDLE_TURN:
            return "handle"
    if shares["sharp"] >= EDGE_SHARE:
        return "edge"
    return "flat" if shares["flat"] >= SHARE else "rounded"


def _bar_like(curvatures: Floats) -> NDArray[np.bool_]:
    greatest, other = curvatures.T
    return np.asarray((greatest >= 1 / HANDLE_RADIUS) & (np.abs(other) <= greatest / 2))


def facing_sides(normals: Floats, areas: Floats, object_from_hand: Floats, side: Side) -> dict[str, float]:
    """Return the share of a feature's area that faces each side of the hand.

    A piece of surface faces the side of the hand that looks against its outward normal: a table under a
    flat hand faces the palmar side. Empty where the hand's rotation is not known.
    """
    if not np.isfinite(object_from_hand).all():
        return {}
    distal, across, dorsal = object_from_hand.T
    radial = across if side is Side.RIGHT else -across
    directions = np.stack([-dorsal, dorsal, radial, -radial, distal, -distal])
    nearest = np.argmax(-normals @ directions.T, axis=1)
    shares = np.bincount(nearest, areas, minlength=len(HAND_SIDES)) / areas.sum()
    return dict(zip(HAND_SIDES, shares.tolist(), strict=True))
