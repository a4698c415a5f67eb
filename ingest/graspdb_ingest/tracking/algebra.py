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
def predicted_mean(offset: Floats, velocity: Floats, transition: Floats) -> tuple[Floats, Floats]:
    """Return the change of position over a step, and the velocity after it, each (n,).

    `offset` is the posture minus its mean; it plays no part for the free joint.
    """
    change, moved = np.empty(len(offset)), np.empty(len(offset))
    for i in range(len(offset)):
        change[i] = (transition[0, i] - 1.0) * offset[i] + transition[1, i] * velocity[i]
        moved[i] = transition[2, i] * offset[i] + transition[3, i] * velocity[i]
    return change, moved


@compiled
def predicted_covariance(blocks: Floats, transition: Floats, noise: Floats, factors: Floats) -> Floats:
    """Return F P F^T + D Q D, shape (4, n, n), with D the factors on the noise's standard deviation, (n,)."""
    predicted = _congruent(blocks, transition)
    n = len(factors)
    for block in range(4):
        for i in range(n):
            row, scaled, factor = predicted[block, i], noise[block, i], factors[i]
            for j in range(n):
                row[j] += factor * factors[j] * scaled[j]
    return predicted


@compiled
def before_step(adjoint: Floats, matrix: Floats, transition: Floats) -> tuple[Floats, Floats]:
    """Return F^T a, shape (2 n,), and F^T X F, shape (4, n, n)."""
    n = transition.shape[1]
    earlier = np.empty(2 * n)
    for i in range(n):
        earlier[i] = transition[0, i] * adjoint[i] + transition[2, i] * adjoint[n + i]
        earlier[n + i] = transition[1, i] * adjoint[i] + transition[3, i] * adjoint[n + i]
    transposed = np.empty_like(transition)
    for i in range(n):
        transposed[0, i], transposed[1, i] = transition[0, i], transition[2, i]
        transposed[2, i], transposed[3, i] = transition[1, i], transition[3, i]
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
    n, count = jacobian.shape[2], 0
    rows, distances = np.empty((3 * len(root_weight), n)), np.empty(3 * len(root_weight))
    for marker in range(len(root_weight)):
        weight = root_weight[marker]
        if weight:
            for axis in range(3):
                row, derivatives = rows[count], jacobian[marker, axis]
                for j in range(n):
                    row[j] = weight * derivatives[j]
                distances[count] = weight * innovation[marker, axis]
                count += 1
    rows, normal = rows[:count], np.empty((n + 1, n))
    np.dot(rows.T, rows, normal[:n])
    np.dot(distances[:count], rows, normal[n])
    return normal


@compiled
def solve_measured(covariance: Floats, normal: Floats) -> Floats:
    """Return (I + A P)^-1 [A, g] transposed, shape (n + 1, n): J^T S^-1 [J, y].

    With A and g the rows of `normal` and S the innovation's covariance: the matrix inversion lemma, for any
    number of markers.
    """
    n = len(covariance)
    system, product = np.empty((n, 2 * n + 1)), np.dot(normal[:n], covariance)
    for i in range(n):
        for j in range(n):
            system[i, j] = product[i, j]
        system[i, i] += 1.0
        for j in range(n + 1):
            system[i, n + j] = normal[j, i]
    solve(system)
    solved = np.empty((n + 1, n))
    for i in range(n + 1):
        for j in range(n):
            solved[i, j] = system[j, n + i]
    return solved


@compiled
def solve(system: Floats) -> float:
    """Solve M X = B in place: from [M, B], shape (n, n + k), columns n and on become X; return log |det M|.

    Gaussian elimination with partial pivoting. For n about 30 it takes as long as LAPACK, whose call Numba
    compiles for several seconds, again for each kind of array.
    """
    n, logarithm = len(system), 0.0
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(system[row, column]) > abs(system[pivot, column]):
                pivot = row
        source = system[column, column:]
        if pivot != column:
            other = system[pivot, column:]
            for j in range(len(source)):
                source[j], other[j] = other[j], source[j]
        logarithm += np.log(abs(source[0]))
        for row in range(column + 1, n):
            target = system[row, column:]
            factor = target[0] / source[0]
            for j in range(len(source)):
                target[j] -= factor * source[j]
    for row in range(n - 1, -1, -1):
        target = system[row, n:]
        for below in range(row + 1, n):
            factor, source = system[row, below], system[below, n:]
            for j in range(len(target)):
                target[j] -= factor * source[j]
        factor = 1.0 / system[row, row]
        for j in range(len(target)):
            target[j] *= factor
    return logarithm


@compiled
def log_determinant(matrix: Floats) -> float:
    """Return log |det M| of a matrix of shape (n, n)."""
    return solve(matrix.copy())


@compiled
def corrected(blocks: Floats, inverse: Floats) -> Floats:
    """Return P - P H^T S^-1 H P, shape (4, n, n), with J^T S^-1 J = `inverse`, shape (n, n)."""
    n = len(inverse)
    gain = np.dot(left_half(blocks), inverse)
    of_position, of_velocity = np.dot(gain, blocks[2]), np.dot(gain[n:], blocks[0])
    after = np.empty_like(blocks)
    for i in range(n):
        for j in range(n):
            after[2, i, j] = blocks[2, i, j] - of_position[i, j]
            after[3, i, j] = blocks[3, i, j] - of_position[n + i, j]
            after[1, i, j] = blocks[1, i, j] - of_velocity[i, j]
    _make_symmetric(after)
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
    through = np.dot(columns, inverse)
    for i in range(2 * n):
        for j in range(n):
            through[i, j] = (1.0 if i == j else 0.0) - through[i, j]
    carried = _times(matrix, through)
    squared, moved = np.dot(through.T, carried), np.dot(adjoint, through)
    before, earlier = np.empty_like(matrix), adjoint.copy()
    for i in range(n):
        earlier[i] = moved[i] - weighted[i]
        for j in range(n):
            before[1, i, j] = matrix[1, i, j]
            before[2, i, j] = squared[i, j] + inverse[i, j]
            before[3, i, j] = carried[n + i, j]
    _make_symmetric(before)
    return earlier, before


@compiled
def smoothed_covariance(matrix: Floats, columns: Floats) -> Floats:
    """Return P - P X P of the positions, shape (n, n); `columns` as in `before_measurement`."""
    n = columns.shape[1]
    covariance: Floats = np.dot(columns.T, _times(matrix, columns))
    for i in range(n):
        for j in range(n):
            covariance[i, j] = columns[i, j] - covariance[i, j]
    return covariance


@compiled
def _times(matrix: Floats, columns: Floats) -> Floats:
    """Return X C, shape (2 n, n), for columns C of shape (2 n, n)."""
    n = columns.shape[1]
    product: Floats = np.dot(left_half(matrix), columns[:n])
    more = np.dot(right_half(matrix), columns[n:])
    for i in range(2 * n):
        for j in range(n):
            product[i, j] += more[i, j]
    return product


@compiled
def left_half(blocks: Floats) -> Floats:
    """Return the columns of the positions, shape (2 n, n): a view."""
    return blocks[2:].reshape(2 * blocks.shape[1], blocks.shape[1])


@compiled
def right_half(blocks: Floats) -> Floats:
    """Return the columns of the velocities, shape (2 n, n): a view."""
    return blocks[:2].reshape(2 * blocks.shape[1], blocks.shape[1])


@compiled
def _congruent(blocks: Floats, transition: Floats) -> Floats:
    """Return F X F^T of a symmetric X, shape (4, n, n)."""
    n = blocks.shape[1]
    a, b, c, d = transition[0], transition[1], transition[2], transition[3]
    result = np.empty_like(blocks)
    for i in range(n):
        pv, vv, pp, vp = blocks[0, i], blocks[1, i], blocks[2, i], blocks[3, i]
        to_vv, to_pp, to_vp = result[1, i], result[2, i], result[3, i]
        ai, bi, ci, di = a[i], b[i], c[i], d[i]
        for j in range(n):
            of_position = a[j] * pp[j] + b[j] * pv[j]
            of_velocity = a[j] * vp[j] + b[j] * vv[j]
            to_pp[j] = ai * of_position + bi * of_velocity
            to_vp[j] = ci * of_position + di * of_velocity
            of_position = c[j] * pp[j] + d[j] * pv[j]
            of_velocity = c[j] * vp[j] + d[j] * vv[j]
            to_vv[j] = ci * of_position + di * of_velocity
    _make_symmetric(result)
    return result


@compiled
def _make_symmetric(blocks: Floats) -> None:
    """Write the first block from the last; make the others symmetric where rounding has left them askew."""
    for i in range(blocks.shape[1]):
        for j in range(blocks.shape[1]):
            blocks[0, i, j] = blocks[3, j, i]
        for j in range(i):
            for block in (1, 2):
                mean = 0.5 * (blocks[block, i, j] + blocks[block, j, i])
                blocks[block, i, j] = blocks[block, j, i] = mean


@compiled
def copy_matrix(source: Floats, target: Floats) -> None:
    """Write a matrix into another array of its shape; quicker to compile than a slice."""
    for i in range(len(source)):
        copy_vector(source[i], target[i])


@compiled
def copy_vector(source: Floats, target: Floats) -> None:
    """Write a vector into another array of its length."""
    for j in range(len(source)):
        target[j] = source[j]
