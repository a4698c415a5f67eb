"""Extended Kalman filter on the hand's manifold: position and velocity of 29 degrees of freedom.

The paper tracks with an extended Kalman filter (its section II.A and reference 11). Here the state
is a configuration and its velocity, the error lives in the tangent space (58 numbers), and a
marker that was not seen is left out of the update. Markers measure positions only, so all
solves are of the size of the degrees of freedom, not of the markers.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.fit import FREE, SEVEN, visible
from graspdb_ingest.tracking.motion import MotionModel

LIMIT_SD: Final = np.deg2rad(0.5)
"""Tightness with which an angle beyond its limit is pulled back to it [rad]."""
LARGE_STEP: Final = 0.15
"""A joint that an update moves further than this gets a second linearisation [rad]."""


@dataclass(frozen=True)
class State:
    """What the filter knows after a frame.

    Attributes
    ----------
    q : ndarray, shape (n_q,)
        Configuration.
    velocity : ndarray, shape (n_dof,)
        Velocity [m/s, rad/s].
    covariance : ndarray, shape (2 * n_dof, 2 * n_dof)
        Covariance of the error in position, then velocity.
    """

    q: Floats
    velocity: Floats
    covariance: Floats


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
    """

    state: State
    used: Bools
    at_limit: bool


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
        self._motion = motion
        self._prior = prior
        self._variance = marker_sd**2
        self._gate = float(chi2.ppf(gate, df=3))

    def start(self, q: Floats) -> State:
        """Return a state at a fitted configuration, at rest, with the spread of any hand."""
        return State(q, np.zeros(self._hand.n_dof), self._motion.stationary.copy())

    def predict(self, state: State) -> State:
        """Return the state one step later.

        The free joint's own axes turn by the small angle of a step meanwhile; that second-order
        turn of its covariance is left out.
        """
        offset = np.zeros(self._hand.n_dof)
        offset[FREE:] = state.q[SEVEN:] - self._prior.mean
        change, velocity = self._motion.predict_mean(offset, state.velocity)
        covariance = self._motion.predict_covariance(state.covariance)
        return State(self._hand.integrate(state.q, change), velocity, covariance)

    def update(self, state: State, observed: Floats, gated: bool = True) -> Update:
        """Correct a predicted state by a frame of markers.

        Parameters
        ----------
        state : State
            The prediction.
        observed : ndarray, shape (n_markers, 3)
            Marker positions [m], NaN where not seen.
        gated : bool
            Whether to leave out markers whose innovation is beyond the gate.

        Returns
        -------
        Update
            The corrected state, and which markers it used.
        """
        seen = visible(observed)
        kinematics, n = self._kinematics, self._hand.n_dof
        kinematics.move(state.q)
        jacobian = kinematics.marker_jacobian()
        innovation = observed - kinematics.markers
        used = seen
        if gated and seen.any():
            used = self._passing(state, jacobian, innovation, seen)
        if not used.any():
            return Update(state, used, False)
        step = self._correct(state, jacobian, innovation, used, np.zeros(2 * n))
        if np.abs(step[0][3:n]).max() > LARGE_STEP:
            kinematics.move(self._hand.integrate(state.q, step[0][:n]))
            again = observed - kinematics.markers
            step = self._correct(state, kinematics.marker_jacobian(), again, used, step[0])
        q = self._hand.integrate(state.q, step[0][:n])
        corrected = State(q, state.velocity + step[0][n:], step[1])
        within, at_limit = self._within_limits(corrected)
        return Update(within, used, at_limit)

    def _passing(self, state: State, jacobian: Floats, innovation: Floats, seen: Bools) -> Bools:
        """Gate each marker by the Mahalanobis distance of its innovation."""
        n = self._hand.n_dof
        spread = jacobian.reshape(-1, n) @ state.covariance[:n, :n]
        spread = np.einsum("mij,mkj->mik", spread.reshape(jacobian.shape), jacobian)
        spread[:, range(3), range(3)] += self._variance[:, None]
        solved = np.linalg.solve(spread, np.where(seen[:, None], innovation, 0.0)[..., None])[..., 0]
        distance = np.einsum("mi,mi->m", np.where(seen[:, None], innovation, 0.0), solved)
        return np.asarray(seen & (distance <= self._gate))

    def _correct(
        self,
        state: State,
        jacobian: Floats,
        innovation: Floats,
        used: Bools,
        linearised_at: Floats,
    ) -> tuple[Floats, Floats]:
        """Return the step from the prediction and the covariance after it.

        With A = J^T R^-1 J and L = P[:, positions], the gain form L (I + A P_pp)^-1 J^T R^-1 is the
        usual one by the matrix inversion lemma. `linearised_at` is the step at which `jacobian`
        and `innovation` were taken (iterated filter).
        """
        n = self._hand.n_dof
        rows = jacobian[used].reshape(-1, n)
        weights = np.repeat(1 / self._variance[used], 3)
        weighted = rows.T * weights
        information = weighted @ rows
        gradient = weighted @ innovation[used].ravel() + information @ linearised_at[:n]
        left = state.covariance[:, :n]
        inner = information @ left[:n]
        inner[range(n), range(n)] += 1
        solved = np.linalg.solve(inner, np.column_stack([information, gradient]))
        covariance = state.covariance - left @ solved[:, :n] @ left.T
        return left @ solved[:, n], (covariance + covariance.T) / 2

    def _within_limits(self, state: State) -> tuple[State, bool]:
        """Pull angles beyond their limits back, as measurements of the limit, then clip what is left."""
        limits, n = self._hand.joint_range, self._hand.n_dof
        angles = state.q[SEVEN:]
        nearest = np.clip(angles, limits[:, 0], limits[:, 1])
        beyond = np.flatnonzero(angles != nearest)
        if not len(beyond):
            return state, False
        dofs = beyond + FREE
        gain_left = state.covariance[:, dofs]
        spread = state.covariance[np.ix_(dofs, dofs)] + LIMIT_SD**2 * np.eye(len(dofs))
        gain = np.linalg.solve(spread, gain_left.T).T
        step = gain @ (nearest - angles)[beyond]
        q = self._hand.integrate(state.q, step[:n])
        q[SEVEN:] = np.clip(q[SEVEN:], limits[:, 0], limits[:, 1])
        covariance = state.covariance - gain @ gain_left.T
        velocity = state.velocity + step[n:]
        return State(q, velocity, (covariance + covariance.T) / 2), True
