"""Iterated extended Kalman filter on the hand's manifold: position and velocity of 29 degrees of freedom.

The paper tracks with an extended Kalman filter (its section II.A and reference 11). Here the state
is a configuration and its velocity, the error lives in the tangent space (58 numbers), and a
marker that was not seen is left out of the update. Markers measure positions only, so all that a
frame says is one matrix and one vector of the size of the degrees of freedom.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.hand.tree import memory_of
from graspdb_ingest.tracking.correction import NO_READINGS, JointReadings, Setting, correct, predict
from graspdb_ingest.tracking.motion import Blocks, MotionModel, from_blocks, to_blocks


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
        The hand.
    motion : MotionModel
        The step between frames.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker [m].
    gate : float
        Probability that a true marker passes the Mahalanobis gate.

    Attributes
    ----------
    setting, placed : Setting, Placed
        All this, and memory for the hand's place, for compiled code.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        motion: MotionModel,
        prior: PosturePrior,
        marker_sd: Floats,
        gate: float,
    ) -> None:
        lowest, highest = np.ascontiguousarray(kinematics.hand.joint_range.T)
        self._motion = motion
        self._usual = np.ones(kinematics.hand.n_dof)
        self.setting = Setting(
            tree=kinematics.tree,
            markers=kinematics.marker_points,
            transition=motion.transition,
            noise=motion.noise_blocks,
            mean=np.asarray(prior.mean, dtype=float),
            lowest=lowest,
            highest=highest,
            root_weight=1 / marker_sd,
            gate=float(chdtri(3, 1 - gate)),
            angle_gate=float(chdtri(1, 1 - gate)),
        )
        self.placed = memory_of(kinematics.tree)

    def start(self, q: Floats) -> State:
        """Return a state at a fitted configuration, at rest, with the spread of any hand."""
        return State(q, np.zeros(len(self._usual)), to_blocks(self._motion.stationary))

    def predict(self, state: State, activity: Floats | None = None) -> State:
        """Return the state one step later.

        `activity` are factors on the standard deviation of the process noise, shape (n_dof,).
        """
        factors = self._usual if activity is None else activity
        return State(*predict(self.setting, state.q, state.velocity, state.blocks, factors))

    def update(
        self,
        state: State,
        observed: Floats,
        gated: bool = True,
        readings: JointReadings = NO_READINGS,
        frame: int = 0,
    ) -> Update:
        """Correct a predicted state by a frame of markers; see `correction.correct`.

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
        frame : int
            Which frame of the readings this is.

        Returns
        -------
        Update
            The corrected state, and which markers it used.
        """
        *corrected, used, at_limit, solved = correct(
            self.setting,
            self.placed,
            state.q,
            state.velocity,
            state.blocks,
            observed,
            readings,
            frame,
            gated,
        )
        return Update(State(*corrected), used, at_limit, solved[:-1], solved[-1])
