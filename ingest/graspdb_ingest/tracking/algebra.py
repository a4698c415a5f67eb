"""The algebra of one frame of the filter and the smoother, compiled.

Covariances and adjoint matrices are blocks as `motion.to_blocks` lays them out: position-velocity,
velocity-velocity, position-position, velocity-position, shape (4, n, n). A transition is the diagonals of
its four blocks, shape (4, n): position from position, position from velocity, velocity from position, and
velocity from velocity. A frame's markers say J^T R^-1 J, the information A, and J^T R^-1 y, the score g.
"""

import numpy as np

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Floats


@compiled
def predicted_covariance(blocks: Floats, transition: Floats, noise: Floats, factors: Floats) -> Floats:
    """Return F P F^T + D Q D, shape (4, n, n), with D the factors on the noise's standard deviation, (n,)."""
    predicted = _congruent(blocks, transition)
    n = len(factors)
    for i in range(n):
        for j in range(n):
            scale = factors[i] * factors[j]
            for block in range(4):
                predicted[block, i, j] += scale * noise[block, i, j]
    return predicted


@compiled
def before_step(adjoint: Floats, matrix: Floats, transition: Floats) -> tuple[Floats, Floats]:
    """Return F^T a, shape (2 n,), and F^T X F, shape (4, n, n)."""
    n = transition.shape[1]
    earlier = np.empty(2 * n)
    for i in range(n):
        earlier[i] = transition[0, i] * adjoint[i] + transition[2, i] * adjoint[n + i]
        earlier[n + i] = transition[1, i] * adjoint[i] + transition[3, i] * adjoint[n + i]
    transposed = transition.copy()
    transposed[1], transposed[2] = transition[2], transition[1]
    return earlier, _congruent(matrix, transposed)


@compiled
def disturbance(adjoint: Floats, matrix: Floats, noise: Floats, factors: Floats) -> tuple[Floats, Floats]:
    """Return a^T D Q D a and tr(D Q D X), each shared out among the degrees of freedom, shape (n,)."""
    n = len(factors)
    squared, determined = np.zeros(n), np.zeros(n)
    # Of each block: where its rows and its columns stand in the adjoint vector.
    rows, columns = (0, n, 0, n), (n, n, 0, 0)
    for block in range(4):
        for i in range(n):
            left = adjoint[rows[block] + i]
            felt, trace = 0.0, 0.0
            for j in range(n):
                variance = factors[j] * noise[block, i, j]
                felt += variance * adjoint[columns[block] + j]
                trace += variance * matrix[block, i, j]
            squared[i] += factors[i] * left * felt
            determined[i] += factors[i] * trace
    return squared, determined


@compiled
def normal_equations(jacobian: Floats, innovation: Floats, root_weight: Floats) -> Floats:
    """Return J^T R^-1 J and, as one row more, J^T R^-1 y, shape (n + 1, n).

    Parameters
    ----------
    jacobian : ndarray, shape (n_markers, 3, n)
        J.
    innovation : ndarray, shape (n_markers, 3)
        y.
    root_weight : ndarray, shape (n_markers,)
        One over each marker's standard deviation, 0 where it is not used.
    """
    n = jacobian.shape[2]
    used = np.flatnonzero(root_weight)
    rows, normal = np.empty((3 * len(used), n)), np.zeros((n + 1, n))
    score = normal[n]
    for place in range(len(used)):
        marker = used[place]
        weight = root_weight[marker]
        for axis in range(3):
            distance = weight * innovation[marker, axis]
            for j in range(n):
                element = weight * jacobian[marker, axis, j]
                rows[3 * place + axis, j] = element
                score[j] += element * distance
    np.dot(rows.T, rows, normal[:n])
    return normal


@compiled
def solve_measured(covariance: Floats, normal: Floats) -> Floats:
    """Return (I + A P)^-1 [A, g] transposed, shape (n + 1, n): J^T S^-1 [J, y].

    With A and g the rows of `normal` and S the innovation's covariance: the matrix inversion lemma, for any
    number of markers.
    """
    n = len(covariance)
    matrix = np.dot(normal[:n], covariance)
    for i in range(n):
        matrix[i, i] += 1.0
    return np.linalg.solve(matrix, normal.T).T.copy()


@compiled
def corrected(blocks: Floats, inverse: Floats) -> Floats:
    """Return P - P H^T S^-1 H P, shape (4, n, n), with J^T S^-1 J = `inverse`, shape (n, n)."""
    position_gain, velocity_gain = np.dot(blocks[2], inverse), np.dot(blocks[3], inverse)
    after = np.empty_like(blocks)
    after[2] = blocks[2] - np.dot(position_gain, blocks[2])
    after[3] = blocks[3] - np.dot(velocity_gain, blocks[2])
    after[1] = blocks[1] - np.dot(velocity_gain, blocks[0])
    _symmetrise(after[1])
    _symmetrise(after[2])
    after[0] = after[3].T
    return after


@compiled
def before_measurement(
    adjoint: Floats, matrix: Floats, columns: Floats, inverse: Floats, weighted: Floats
) -> tuple[Floats, Floats]:
    """Return adjoint vector, shape (2 n,), and matrix, shape (4, n, n), from those after a measurement.

    Bierman 1973: a measurement's I - K H leaves velocities alone. `columns`, shape (2 n, n), are those of the
    prediction's covariance that belong to positions; `inverse` and `weighted` are J^T S^-1 J and J^T S^-1 y.
    """
    n = columns.shape[1]
    through = -np.dot(columns, inverse)
    for i in range(n):
        through[i, i] += 1.0
    of_position, of_velocity = _times(matrix, through)
    before = np.empty_like(matrix)
    before[1] = matrix[1]
    before[2] = np.dot(through[:n].T, of_position) + np.dot(through[n:].T, of_velocity) + inverse
    before[3] = of_velocity
    before[0] = of_velocity.T
    _symmetrise(before[2])
    earlier = adjoint.copy()
    earlier[:n] = np.dot(adjoint, through) - weighted
    return earlier, before


@compiled
def smoothed_covariance(matrix: Floats, columns: Floats) -> Floats:
    """Return P - P X P of the positions, shape (n, n); `columns` as in `before_measurement`."""
    n = columns.shape[1]
    of_position, of_velocity = _times(matrix, columns)
    told: Floats = np.dot(columns[:n].T, of_position) + np.dot(columns[n:].T, of_velocity)
    return columns[:n] - told


@compiled
def _times(matrix: Floats, columns: Floats) -> tuple[Floats, Floats]:
    """Return the rows of positions and of velocities, each (n, n), of X C for columns C of shape (2 n, n)."""
    n = columns.shape[1]
    of_position = np.dot(matrix[2], columns[:n]) + np.dot(matrix[0], columns[n:])
    of_velocity = np.dot(matrix[3], columns[:n]) + np.dot(matrix[1], columns[n:])
    return of_position, of_velocity


@compiled
def _congruent(blocks: Floats, transition: Floats) -> Floats:
    """Return F X F^T of a symmetric X, shape (4, n, n)."""
    a, b, c, d = transition
    n = len(a)
    result = np.empty_like(blocks)
    for i in range(n):
        for j in range(n):
            of_position = a[j] * blocks[2, i, j] + b[j] * blocks[0, i, j]
            of_velocity = a[j] * blocks[3, i, j] + b[j] * blocks[1, i, j]
            result[2, i, j] = a[i] * of_position + b[i] * of_velocity
            result[3, i, j] = c[i] * of_position + d[i] * of_velocity
            of_position = c[j] * blocks[2, i, j] + d[j] * blocks[0, i, j]
            of_velocity = c[j] * blocks[3, i, j] + d[j] * blocks[1, i, j]
            result[1, i, j] = c[i] * of_position + d[i] * of_velocity
    _symmetrise(result[1])
    _symmetrise(result[2])
    result[0] = result[3].T
    return result


@compiled
def _symmetrise(matrix: Floats) -> None:
    """Make a matrix symmetric again, in place, where rounding has left it askew."""
    for i in range(len(matrix)):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = 0.5 * (matrix[i, j] + matrix[j, i])
