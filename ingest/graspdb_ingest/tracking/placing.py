"""Where a smoothed hand's markers and sites are, and how far off they may be, compiled."""

import numpy as np

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.hand.tree import (
    Points,
    Tree,
    integrate,
    memory_of,
    place,
    write_jacobian,
    write_points,
)


@compiled
def moved_within_limits(predicted: Floats, steps: Floats, limits: Floats) -> Floats:
    """Return configurations (n, n_q) moved by steps (n, n_dof), hinges within their limits (n_hinges, 2)."""
    moved = np.empty_like(predicted)
    for i in range(len(predicted)):
        moved[i] = integrate(predicted[i], steps[i])
        for hinge in range(len(limits)):
            angle = moved[i, 7 + hinge]
            moved[i, 7 + hinge] = min(max(angle, limits[hinge, 0]), limits[hinge, 1])
    return moved


@compiled
def point_positions(tree: Tree, points: Points, q: Floats) -> Floats:
    """Return where points are in each of many configurations [m], shape (n, n_points, 3)."""
    placed, positions = memory_of(tree), np.empty((len(q), len(points.which), 3))
    for i in range(len(q)):
        place(tree, q[i], placed)
        write_points(points, placed, positions[i])
    return positions


@compiled
def point_spreads(tree: Tree, points: Points, q: Floats, covariance: Floats) -> Floats:
    """Return the root of the trace of each point's covariance in space [m], shape (n, n_points).

    Parameters
    ----------
    tree, points : Tree, Points
        The hand and the points.
    q : ndarray, shape (n, n_q)
        Configurations.
    covariance : ndarray, shape (n, n_dof, n_dof)
        Covariance of the error of each.
    """
    n_points, n_dof = len(points.which), covariance.shape[1]
    placed, positions = memory_of(tree), np.empty((n_points, 3))
    jacobian, spreads = np.empty((n_points, 3, n_dof)), np.empty((len(q), n_points))
    for i in range(len(q)):
        place(tree, q[i], placed)
        write_points(points, placed, positions)
        write_jacobian(tree, points, placed, positions, jacobian)
        rows = jacobian.reshape(3 * n_points, n_dof)
        told = np.dot(rows, covariance[i])
        for point in range(n_points):
            variance = 0.0
            for row in range(3 * point, 3 * point + 3):
                for dof in range(n_dof):
                    variance += told[row, dof] * rows[row, dof]
            spreads[i, point] = np.sqrt(variance)
    return spreads
