"""Contact wrenches: what forces and torques a set of frictional point contacts can put on an object.

A wrench is a force [N per newton of normal force] over a torque divided by a length, so that all six
numbers have one unit. Each contact is a hard point with Coulomb friction: it pushes, it resists sliding,
and it does not resist twisting about its normal.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from graspdb_ingest.hand.model import Floats

RANK_TOLERANCE: Final = 1e-6
"""Singular values below this share of the largest are those of a degenerate set of wrenches."""
JOGGLE: Final = 1e-9
"""Symmetric grasps put many wrenches in common planes; moved by this much no facets need merging."""
LEAST_EPSILON: Final = 1e-6
"""An epsilon below this is rounding: the origin lies on the hull's boundary."""


@dataclass(frozen=True)
class WrenchSpace:
    """The wrenches that contacts resist while their normal forces sum to one newton.

    Attributes
    ----------
    epsilon : float
        Largest wrench that is resisted in every direction; zero without force closure.
    volume : float
        Volume of the convex hull of the wrenches and the origin; zero where they span no volume.
    """

    epsilon: float
    volume: float

    @property
    def force_closure(self) -> bool:
        """Whether every wrench can be resisted with enough force."""
        return self.epsilon > 0


def grasp_matrix(positions: Floats, normals: Floats, center: Floats, radius: float) -> Floats:
    """Return the grasp matrix G: contact forces, in their contact frames, to the wrench on the object.

    Parameters
    ----------
    positions, normals : ndarray, shape (k, 3)
        Contact points [m] and outward unit normals of the object there.
    center : ndarray, shape (3,)
        Point about which torques are taken [m].
    radius : float
        Length that torques are divided by [m].

    Returns
    -------
    ndarray, shape (6, 3 k)
        For each contact three columns: a unit force along the inward normal, and along two tangents.
    """
    frames = contact_frames(positions, normals, center)
    arms = ((positions - center) / radius)[:, None]
    columns = np.concatenate([frames, np.cross(arms, frames)], axis=2)
    return np.asarray(columns.reshape(-1, 6).T)


def contact_frames(positions: Floats, normals: Floats, center: Floats) -> Floats:
    """Return the inward normal and two tangents at each contact, shape (k, 3, 3).

    The first tangent is the direction along the surface away from the center of mass, from the middle of
    all contacts, or from the contact that is furthest across, whichever of the three lies most along the
    surface. So a frame, and with it a pyramid in its friction cone, turns with the grasp.
    """
    inward = -normals
    apart = positions[:, None] - positions
    across = np.linalg.norm(np.cross(apart, inward[:, None]), axis=2)
    furthest = np.take_along_axis(apart, across.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    lab = np.eye(3)[np.argmin(np.abs(inward), axis=1)]
    away = np.stack([positions - center, positions - positions.mean(axis=0), furthest, 1e-9 * lab], axis=1)
    along = away - np.einsum("kci,ki->kc", away, inward)[..., None] * inward[:, None]
    lengths = np.linalg.norm(along, axis=2)
    best = lengths.argmax(axis=1)[:, None, None]
    first = np.take_along_axis(along, best, axis=1)[:, 0] / lengths.max(axis=1)[:, None]
    return np.stack([inward, first, np.cross(inward, first)], axis=1)


def primitive_wrenches(matrix: Floats, friction: float, edges: int) -> Floats:
    """Return the wrenches of the friction cones' edges, each with a normal force of one newton.

    Parameters
    ----------
    matrix : ndarray, shape (6, 3 k)
        Grasp matrix.
    friction : float
        Coefficient of friction; zero for contacts that only push.
    edges : int
        Edges of the pyramid inscribed in each cone, which never claims more than the cone itself.

    Returns
    -------
    ndarray, shape (k * edges, 6), or (k, 6) without friction
        Primitive wrenches.
    """
    angle = 2 * np.pi * np.arange(edges) / edges
    if friction > 0:
        forces = np.column_stack([np.ones(edges), friction * np.cos(angle), friction * np.sin(angle)])
    else:
        forces = np.array([[1.0, 0.0, 0.0]])
    by_contact = matrix.reshape(6, -1, 3)
    return np.asarray(np.einsum("wki,ei->kew", by_contact, forces).reshape(-1, 6))


def wrench_space(wrenches: Floats) -> WrenchSpace:
    """Return epsilon and volume of a set of primitive wrenches, shape (n, 6).

    This is the convex hull of the union of the contacts' wrenches (Ferrari and Canny, 1992: the normal
    forces sum to at most one). Wrenches that span fewer than six dimensions close nothing: both are zero.
    """
    with_origin = np.concatenate([wrenches, np.zeros((1, 6))])
    if _flat(with_origin):
        return WrenchSpace(0.0, 0.0)
    moved = with_origin + JOGGLE * np.random.default_rng(0).standard_normal(with_origin.shape)
    try:
        hull = ConvexHull(moved)
    except QhullError:
        # so nearly flat that no hull can be told from rounding
        return WrenchSpace(0.0, 0.0)
    # Where the origin is not inside, it is a corner of the hull itself and no facet is away from it.
    epsilon = -float(hull.equations[:, -1].max())
    return WrenchSpace(epsilon if epsilon > LEAST_EPSILON else 0.0, float(hull.volume))


def _flat(points: Floats) -> bool:
    """Return whether points, shape (n, 6), lie in a hyperplane."""
    if len(points) < 7:
        return True
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[5] <= RANK_TOLERANCE * spread[0])
