"""Forces with which the sites of a grasp press so that they carry the object and balance each other."""

from typing import Final

import numpy as np
from scipy.optimize import nnls

from graspdb.export.items import Floats

EDGES: Final = 8
"""Edges of the pyramid inscribed in each friction cone."""

SAFETY: Final = 0.7
"""Share of the friction that the grip may use."""

ARM: Final = 0.05
"""Length by which torques are compared with forces [m]."""

SMALL_FORCES: Final = 0.1
"""Weight of small forces against a small resulting wrench."""

GREATEST: Final = 8.0
"""No contact presses with more than this [N]; where one would, all press less in proportion."""


def grip_forces(
    points: Floats, normals: Floats, center: Floats, weight: Floats, friction: float, preload: float
) -> Floats:
    """Return a force of the hand on the object at each contact.

    Each contact presses with at least the preload along its normal. What is added lies in the friction
    cones, and is the least (by non-negative least squares) that makes all forces together carry the weight
    and turn nothing, as far as the contacts can do that.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Contact points [m] and outward unit normals of the object.
    center : ndarray, shape (3,)
        Centre of mass [m].
    weight : ndarray, shape (3,)
        Weight of the object, as a force [N]; zeros without gravity.
    friction : float
        Coefficient of friction.
    preload : float
        Least normal force at each contact [N].

    Returns
    -------
    ndarray, shape (n, 3)
        Forces [N].
    """
    if not len(points):
        return np.empty((0, 3))
    edges = _cone_edges(normals, SAFETY * friction)
    pressed = -preload * normals
    wanted = -np.concatenate([weight, np.zeros(3)]) - _wrenches(points - center, pressed).sum(axis=0)
    arms = np.repeat(points - center, EDGES, axis=0)
    columns = _wrenches(arms, edges.reshape(-1, 3)).T
    system = np.concatenate([columns, SMALL_FORCES * np.eye(columns.shape[1])])
    shares = nnls(system, np.concatenate([wanted, np.zeros(columns.shape[1])]))[0]
    added = (shares[:, None] * edges.reshape(-1, 3)).reshape(-1, EDGES, 3).sum(axis=1)
    forces = pressed + added
    return np.asarray(forces * min(1.0, GREATEST / np.linalg.norm(forces, axis=1).max()))


def _wrenches(arms: Floats, forces: Floats) -> Floats:
    """Return force and torque, over `ARM`, of forces at places, shape (n, 6)."""
    return np.concatenate([forces, np.cross(arms, forces) / ARM], axis=1)


def _cone_edges(normals: Floats, friction: float) -> Floats:
    """Return the edges of the friction cones, each pressing with 1 N, shape (n, 8, 3)."""
    least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    angle = 2 * np.pi * np.arange(EDGES) / EDGES
    around = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    return np.asarray(friction * around - normals[:, None])
