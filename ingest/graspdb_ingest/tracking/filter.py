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
from scipy.stats import chi2

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.algebra import corrected, normal_equations, solve_measured
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
        self._lowest, self._highest = kinematics.hand.joint_range.T.copy()
        self._motion = motion
        self._prior = prior
        self._root_weight = 1 / marker_sd
        self._gate = float(chi2.ppf(gate, df=3))
        self._explained = self._gate * marker_sd**2
        self._angle_gate = float(chi2.ppf(gate, df=1))

    def start(self, q: Floats) -> State:
        """Return a state at a fitted configuration, at rest, with the spread of any hand."""
        return State(q, np.zeros(self._n), to_blocks(self._motion.stationary))

    def predict(self, state: State, activity: Floats | None = None) -> State:
        """Return the state one step later.

        `activity` are factors on the standard deviation of the process noise, shape (n_dof,).

        The free joint's own axes turn by the small angle of a step meanwhile; that second-order
        turn of its covariance is left out.
        """
        offset = np.zeros(self._n)
        np.subtract(state.q[SEVEN:], self._prior.mean, out=offset[FREE:])
        change, velocity = self._motion.predict_mean(offset, state.velocity)
        blocks = self._motion.predict_covariance(state.blocks, activity)
        return State(self._hand.integrate(state.q, change), velocity, blocks)

    def update(
        self,
        state: State,
        observed: Floats,
        gated: bool = True,
        readings: JointReadings | None = None,
        seen: Bools | None = None,
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
        seen : ndarray of bool, shape (n_markers,), optional
            Which markers were seen, where that is known already.

        Returns
        -------
        Update
            The corrected state, and which markers it used.
        """
        seen = visible(observed) if seen is None else seen
        jacobian, innovation = self._linearise(state.q, observed, seen)
        used = self._passing(state, jacobian, innovation, seen) if gated else seen
        angles = None if readings is None else self._angles(state, readings)
        if not used.any() and angles is None:
            return Update(state, used, False, np.zeros((self._n, self._n)), np.zeros(self._n))
        root_weight = self._root_weight * used
        last: Floats = np.zeros(self._n)
        for _ in range(MAXIMUM_LINEARISATIONS):
            normal = normal_equations(jacobian, innovation, root_weight)
            normal[-1] += normal[:-1] @ last  # as if the innovation were that of the prediction
            if angles is not None:
                dofs, precision, innovations = angles
                normal[dofs, dofs] += precision
                normal[-1, dofs] += precision * innovations
            at_limit, solved, step = self._solve(state, normal)
            change = step[: self._n]
            turned = change[3:] - last[3:]
            if turned @ turned < LARGE_STEP**2 or np.abs(turned).max() < LARGE_STEP:
                break
            last = change
            jacobian, innovation = self._linearise(self._hand.integrate(state.q, last), observed, seen)
        after = State(
            self._hand.integrate(state.q, change),
            state.velocity + step[self._n :],
            corrected(state.blocks, solved[:-1]),
        )
        return Update(after, used, at_limit, solved[:-1], solved[-1])

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
        doubtful = (innovation * innovation) @ _ONES > self._explained
        if not np.count_nonzero(doubtful):
            return seen
        rows = jacobian[doubtful]
        spread = rows @ state.position_covariance @ rows.transpose(0, 2, 1)
        spread[:, range(3), range(3)] += 1 / self._root_weight[doubtful, None] ** 2
        solved = np.linalg.solve(spread, innovation[doubtful, :, None])[..., 0]
        passing = seen.copy()
        passing[doubtful] = np.einsum("mi,mi->m", innovation[doubtful], solved) <= self._gate
        return passing

    def _solve(self, state: State, normal: Floats) -> tuple[bool, Floats, Floats]:
        """Return whether a joint is held at its limit, J^T S^-1 [J, y] transposed, and the step.

        Angles that leave their limits are measured to be there.
        """
        left = left_half(state.blocks)
        solved = solve_measured(left[: self._n], normal)
        step = left @ solved[-1]
        angles = state.q[SEVEN:] + step[FREE : self._n]
        beyond = (angles < self._lowest) | (angles > self._highest)
        held = beyond.nonzero()[0]
        if not len(held):
            return False, solved, step
        angles = angles[held]
        nearest = np.clip(angles, self._lowest[held], self._highest[held])
        solved = _measured_besides(left[: self._n], solved, held + FREE, nearest - angles)
        return True, solved, left @ solved[-1]


_ONES: Final = np.ones(3)


def _measured_besides(
    covariance: Floats, solved: Floats, dofs: NDArray[np.int64], innovation: Floats
) -> Floats:
    """Return what `solve_measured` gives if some degrees of freedom are then measured with `LIMIT_SD`.

    The correction by a second measurement E after a first: J^T S^-1 J grows by W E^T V^-1 E W^T with
    W = I - J^T S^-1 J P, V the covariance of the second innovation.
    """
    inverse = solved[:-1]
    rest = -(covariance[dofs] @ inverse)  # rows of W^T: both matrices are symmetric
    rest[range(len(dofs)), dofs] += 1
    spread = rest @ covariance[:, dofs]
    spread[range(len(dofs)), range(len(dofs))] += LIMIT_SD**2
    gain = np.linalg.solve(spread, np.column_stack([rest, innovation]))
    besides = np.empty_like(solved)
    np.matmul(rest.T, gain[:, :-1], out=besides[:-1])
    np.matmul(gain[:, -1], rest, out=besides[-1])
    besides += solved
    return besides
