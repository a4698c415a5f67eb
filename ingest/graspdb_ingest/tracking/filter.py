"""Iterated extended Kalman filter on the hand's manifold: position and velocity of 29 degrees of freedom.

The paper tracks with an extended Kalman filter (its section II.A and reference 11). Here the state
is a configuration and its velocity, the error lives in the tangent space (58 numbers), and a
marker that was not seen is left out of the update. Markers measure positions only, so all that a
frame says is one matrix and one vector of the size of the degrees of freedom.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv
from scipy.stats import chi2

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.fit import FREE, SEVEN, visible
from graspdb_ingest.tracking.motion import Blocks, MotionModel, from_blocks, left_half, to_blocks

LIMIT_SD: Final = np.deg2rad(0.5)
"""Tightness with which an angle beyond its limit is pulled back to it [rad]."""
LARGE_STEP: Final = 0.05
"""Markers are linearised again where a joint turns further than this from the last time [rad]."""
MAXIMUM_LINEARISATIONS: Final = 5


@dataclass(frozen=True)
class State:
    """What the filter knows after a frame.

    Attributes
    ----------
    q : ndarray, shape (n_q,)
        Configuration.
    velocity : ndarray, shape (n_dof,)
        Velocity [m/s, rad/s].
    blocks : ndarray, shape (4, n_dof, n_dof)
        Covariance of the error in position and velocity, as `motion.to_blocks` lays it out.
    """

    q: Floats
    velocity: Floats
    blocks: Blocks

    @property
    def covariance(self) -> Floats:
        """Covariance of the error in position, then velocity, shape (2 * n_dof, 2 * n_dof)."""
        return from_blocks(self.blocks)

    @property
    def position_covariance(self) -> Floats:
        """Covariance of the error in position, shape (n_dof, n_dof)."""
        return np.asarray(self.blocks[2])


@dataclass(frozen=True)
class JointReadings:
    """Joint angles that were measured in one frame, besides markers.

    Attributes
    ----------
    hinges : ndarray of int, shape (k,)
        Places among the hand's hinges.
    angles, variance : ndarray, shape (k,)
        Angles [rad] and the variances of their errors [rad2].
    """

    hinges: NDArray[np.int64]
    angles: Floats
    variance: Floats


@dataclass(frozen=True)
class Update:
    """A state corrected by a frame of markers.

    Attributes
    ----------
    state : State
        The corrected state.
    used : ndarray of bool, shape (n_markers,)
        Markers that were seen and passed the gate.
    at_limit : bool
        Whether a joint had to be held at its limit.
    inverse : ndarray, shape (n_dof, n_dof)
        J^T S^-1 J, with S the covariance of the innovation; zero where nothing was measured.
    weighted : ndarray, shape (n_dof,)
        J^T S^-1 y, with y the innovation.
    """

    state: State
    used: Bools
    at_limit: bool
    inverse: Floats
    weighted: Floats


class HandFilter:
    """Predicts and corrects the state of one hand.

    Parameters
    ----------
    kinematics : Kinematics
        Workspace of the hand.
    motion : MotionModel
        The step between frames.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker [m].
    gate : float
        Probability that a true marker passes the Mahalanobis gate.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        motion: MotionModel,
        prior: PosturePrior,
        marker_sd: Floats,
        gate: float,
    ) -> None:
        self._kinematics = kinematics
        self._hand = kinematics.hand
        self._n = kinematics.hand.n_dof
        self._limits = kinematics.hand.joint_range
        self._motion = motion
        self._prior = prior
        self._weight = 1 / marker_sd**2
        self._gate = float(chi2.ppf(gate, df=3))
        self._angle_gate = float(chi2.ppf(gate, df=1))

    def start(self, q: Floats) -> State:
        """Return a state at a fitted configuration, at rest, with the spread of any hand."""
        return State(q, np.zeros(self._n), to_blocks(self._motion.stationary))

    def predict(self, state: State) -> State:
        """Return the state one step later.

        The free joint's own axes turn by the small angle of a step meanwhile; that second-order
        turn of its covariance is left out.
        """
        offset = np.zeros(self._n)
        offset[FREE:] = state.q[SEVEN:] - self._prior.mean
        change, velocity = self._motion.predict_mean(offset, state.velocity)
        blocks = self._motion.predict_covariance(state.blocks)
        return State(self._hand.integrate(state.q, change), velocity, blocks)

    def update(
        self, state: State, observed: Floats, gated: bool = True, readings: JointReadings | None = None
    ) -> Update:
        """Correct a predicted state by a frame of markers.

        Gauss-Newton steps from the prediction, until every marker is linearised near the corrected
        posture (iterated extended Kalman filter, Bell and Cathey 1993).

        Parameters
        ----------
        state : State
            The prediction.
        observed : ndarray, shape (n_markers, 3)
            Marker positions [m], NaN where not seen.
        gated : bool
            Whether to leave out markers whose innovation is beyond the gate.
        readings : JointReadings, optional
            Joint angles that were measured besides.

        Returns
        -------
        Update
            The corrected state, and which markers it used.
        """
        seen = visible(observed)
        jacobian, innovation = self._linearise(state.q, observed, seen)
        used = self._passing(state, jacobian, innovation, seen) if gated else seen
        angles = None if readings is None else self._angles(state, readings)
        if not used.any() and angles is None:
            return Update(state, used, False, np.zeros((self._n, self._n)), np.zeros(self._n))
        weight = np.where(used, self._weight, 0.0)
        step = np.zeros(2 * self._n)
        for _ in range(MAXIMUM_LINEARISATIONS):
            last = step[: self._n]
            information, gradient = _normal_equations(jacobian, innovation, weight, last)
            if angles is not None:
                dofs, precision, innovations = angles
                information[dofs, dofs] += precision
                gradient[dofs] += precision * innovations
            at_limit, solved = self._solve(state, information, gradient)
            step = left_half(state.blocks) @ solved[-1]
            if np.abs(step[3 : self._n] - last[3:]).max() < LARGE_STEP:
                break
            moved = self._hand.integrate(state.q, step[: self._n])
            jacobian, innovation = self._linearise(moved, observed, seen)
        corrected = State(
            self._hand.integrate(state.q, step[: self._n]),
            state.velocity + step[self._n :],
            _corrected(state.blocks, solved[:-1]),
        )
        return Update(corrected, used, at_limit, solved[:-1], solved[-1])

    def _angles(
        self, state: State, readings: JointReadings
    ) -> tuple[NDArray[np.int64], Floats, Floats] | None:
        """Return degrees of freedom, precisions and innovations of the readings that pass the gate."""
        dofs = readings.hinges + FREE
        innovation = readings.angles - state.q[readings.hinges + SEVEN]
        spread = state.position_covariance[dofs, dofs] + readings.variance
        passing = innovation**2 <= self._angle_gate * spread
        if not passing.any():
            return None
        return dofs[passing], 1 / readings.variance[passing], innovation[passing]

    def _linearise(self, q: Floats, observed: Floats, seen: Bools) -> tuple[Floats, Floats]:
        """Return the markers' Jacobian at a configuration, and how far they are from it (0 where unseen)."""
        self._kinematics.move(q)
        innovation = observed - self._kinematics.markers
        innovation[~seen] = 0.0
        return self._kinematics.marker_jacobian(), innovation

    def _passing(self, state: State, jacobian: Floats, innovation: Floats, seen: Bools) -> Bools:
        """Gate each marker by the Mahalanobis distance of its innovation.

        A marker's own noise alone never gives a shorter distance than the whole spread does, so
        the spread is needed only where the noise alone does not explain the innovation.
        """
        doubtful = np.einsum("mi,mi->m", innovation, innovation) * self._weight > self._gate
        if not doubtful.any():
            return seen
        rows = jacobian[doubtful]
        spread = rows @ state.position_covariance @ rows.transpose(0, 2, 1)
        spread[:, range(3), range(3)] += 1 / self._weight[doubtful, None]
        solved = np.linalg.solve(spread, innovation[doubtful, :, None])[..., 0]
        passing = seen.copy()
        passing[doubtful] = np.einsum("mi,mi->m", innovation[doubtful], solved) <= self._gate
        return passing

    def _solve(self, state: State, information: Floats, gradient: Floats) -> tuple[bool, Floats]:
        """Return whether a joint is held at its limit, and J^T S^-1 [J, y] transposed.

        Angles that leave their limits are measured to be there.
        """
        left = state.position_covariance
        solved = solve_measured(left, information, gradient)
        angles = state.q[SEVEN:] + left[FREE:] @ solved[-1]
        beyond = (angles < self._limits[:, 0]) | (angles > self._limits[:, 1])
        if not beyond.any():
            return False, solved
        held = np.flatnonzero(beyond)
        nearest = np.clip(angles[held], self._limits[held, 0], self._limits[held, 1])
        information[held + FREE, held + FREE] += 1 / LIMIT_SD**2
        gradient[held + FREE] += (nearest - state.q[SEVEN + held]) / LIMIT_SD**2
        return True, solve_measured(left, information, gradient)


def _normal_equations(
    jacobian: Floats, innovation: Floats, weight: Floats, linearised_at: Floats
) -> tuple[Floats, Floats]:
    """Return J^T R^-1 J and J^T R^-1 y; `linearised_at` is the step at which J was taken."""
    rows = jacobian.reshape(-1, jacobian.shape[-1])
    weighted = (jacobian * weight[:, None, None]).reshape(rows.shape).T
    information = weighted @ rows
    return information, weighted @ innovation.reshape(-1) + information @ linearised_at


def solve_measured(covariance: Floats, information: Floats, gradient: Floats) -> Floats:
    """Return (I + A P)^-1 [A, g] transposed, shape (n + 1, n): J^T S^-1 [J, y].

    With A = J^T R^-1 J and g = J^T R^-1 y, by the matrix inversion lemma, for any number of markers.
    LAPACK wants columns: the transpose of the array P A + I, rows in order, is A P + I.
    """
    n = len(gradient)
    matrix = covariance @ information
    matrix.reshape(-1)[:: n + 1] += 1
    right = np.empty((n + 1, n))
    right[:n], right[n] = information, gradient
    _, _, solved, _ = dgesv(matrix.T, right.T, overwrite_a=True, overwrite_b=True)
    return np.asarray(solved.T)


def _corrected(blocks: Blocks, inverse: Floats) -> Blocks:
    """Return P - P H^T S^-1 H P, with J^T S^-1 J = `inverse`."""
    left = left_half(blocks)
    gained = left @ inverse
    corrected = np.empty_like(blocks)
    np.matmul(gained, -blocks[2], out=left_half(corrected))
    corrected[2:] += blocks[2:]
    n = len(inverse)
    np.subtract(blocks[1], gained[n:] @ blocks[0], out=corrected[1])
    for diagonal in corrected[1:3]:
        diagonal += diagonal.T.copy()
        diagonal *= 0.5
    corrected[0] = corrected[3].T
    return corrected
