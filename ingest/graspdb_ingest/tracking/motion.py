"""How a hand moves when nobody looks: the filter's process model, one 2 x 2 block a degree of freedom.

The free joint has white acceleration (nearly constant velocity). Joint angles are a Matern process
with smoothness 3/2 about the mean posture, in its state-space form (Hartikainen and Sarkka 2010):
left alone, they return to the posture prior, with its covariance, in a few of its time scales.
So a joint that no marker shows goes where joints go, and its standard deviation says so.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.fit import FREE

Blocks = Floats
"""A symmetric matrix over positions and velocities as `to_blocks` lays it out, shape (4, n, n)."""


@dataclass(frozen=True)
class MotionNoise:
    """The scales of movement and of the markers' noise; all that is estimated from a recording.

    Attributes
    ----------
    translation_acceleration : float
        Spread of the forearm's acceleration, root of its spectral density [m/s^1.5].
    rotation_acceleration : float
        The same for its rotation [rad/s^1.5].
    wrist_time, thumb_time, finger_time : float
        Time scales of joint angles about the mean posture [s].
    marker_sd : float
        Standard deviation of a marker about its place on the model [m].
    """

    translation_acceleration: float
    rotation_acceleration: float
    wrist_time: float
    thumb_time: float
    finger_time: float
    marker_sd: float

    @classmethod
    def assumed(cls, parameters: TrackingParameters) -> "MotionNoise":
        """Return the scales that are assumed before any recording has been seen."""
        return cls(
            translation_acceleration=parameters.translation_acceleration,
            rotation_acceleration=parameters.rotation_acceleration,
            wrist_time=parameters.posture_time,
            thumb_time=parameters.posture_time,
            finger_time=parameters.posture_time,
            marker_sd=parameters.marker_sd,
        )


@dataclass(frozen=True)
class MotionModel:
    """The step from one frame to the next: x' = A x + w for position and velocity of each dof.

    Attributes
    ----------
    transition : ndarray, shape (4, n_dof)
        The elements of each degree of freedom's 2 x 2 transition A: position from position, position
        from velocity, velocity from position, velocity from velocity.
    noise : ndarray, shape (2 * n_dof, 2 * n_dof)
        Covariance of w, positions first.
    stationary : ndarray, shape (2 * n_dof, 2 * n_dof)
        Covariance of a hand of which nothing is known but that it is one: the prior for the
        joint angles, a wide one for the free joint.
    """

    transition: Floats
    noise: Floats
    stationary: Floats

    @cached_property
    def noise_blocks(self) -> Blocks:
        """Covariance of w as `to_blocks` lays it out, shape (4, n_dof, n_dof)."""
        return to_blocks(self.noise)


def motion_model(hand: HandModel, prior: PosturePrior, noise: MotionNoise, step: float) -> MotionModel:
    """Build the process model for a time step [s].

    Matern 3/2 with rate r = 1 / time scale: A = exp(-r t) [[1 + r t, t], [-r^2 t, 1 - r t]],
    stationary covariance diag(1, r^2) times the prior's, Q = S - A S A^T. White acceleration of
    spectral density s: A = [[1, t], [0, 1]], Q = s [[t^3/3, t^2/2], [t^2/2, t]].

    Hinges that the prior couples but whose time scales differ cannot both keep the prior's
    covariance exactly; of their Q the nearest one that is a covariance is taken.
    """
    n, free = hand.n_dof, np.arange(hand.n_dof) < FREE
    rate = np.concatenate([np.ones(FREE), 1 / _hinge_times(hand, noise)])
    decay = np.exp(-rate * step)
    from_position = np.where(free, 1.0, decay * (1 + rate * step))
    from_velocity = np.where(free, step, decay * step)
    to_velocity = np.where(free, 0.0, -decay * rate**2 * step)
    of_velocity = np.where(free, 1.0, decay * (1 - rate * step))
    stationary = np.zeros((2 * n, 2 * n))
    stationary[FREE:n, FREE:n] = prior.covariance
    stationary[n + FREE :, n + FREE :] = prior.covariance * np.outer(rate[FREE:], rate[FREE:])
    matrix = np.block(
        [
            [np.diag(from_position), np.diag(from_velocity)],
            [np.diag(to_velocity), np.diag(of_velocity)],
        ]
    )
    spread = _nearest_covariance(stationary - matrix @ stationary @ matrix.T)
    density = np.repeat([noise.translation_acceleration**2, noise.rotation_acceleration**2], 3)
    for i, s in enumerate(density):
        spread[np.ix_([i, n + i], [i, n + i])] = s * np.array(
            [[step**3 / 3, step**2 / 2], [step**2 / 2, step]]
        )
    wide = np.repeat([0.1, 1.0], 3)  # a hand is started where it fits its first frame
    stationary[range(FREE), range(FREE)] = wide**2
    stationary[range(n, n + FREE), range(n, n + FREE)] = (wide / noise.finger_time) ** 2
    return MotionModel(
        transition=np.array([from_position, from_velocity, to_velocity, of_velocity]),
        noise=spread,
        stationary=stationary,
    )


def _hinge_times(hand: HandModel, noise: MotionNoise) -> Floats:
    """Return the time scale of each hinge [s]; a hinge with a name of its own moves like a finger."""
    times = {"wrist": noise.wrist_time, "thumb": noise.thumb_time}
    return np.array([times.get(joint.partition("_")[0], noise.finger_time) for joint in hand.joints])


def _nearest_covariance(matrix: Floats) -> Floats:
    """Return the matrix made symmetric and without negative eigenvalues, as a correlation matrix."""
    scale = np.sqrt(np.maximum(np.diagonal(matrix), 0))
    outer = np.outer(scale, scale)
    safe = np.where(outer > 0, outer, 1.0)
    values, vectors = np.linalg.eigh((matrix + matrix.T) / (2 * safe))
    nearest = (vectors * np.maximum(values, 0)) @ vectors.T * outer
    return np.asarray((nearest + nearest.T) / 2)


def to_blocks(matrix: Floats) -> Blocks:
    """Return the blocks of a symmetric matrix over positions and velocities, shape (4, n, n).

    Their order is position-velocity, velocity-velocity, position-position, velocity-position: so
    each half of the columns is one array, and so are the three that fix a symmetric matrix.
    """
    n = len(matrix) // 2
    return np.array([matrix[:n, n:], matrix[n:, n:], matrix[:n, :n], matrix[n:, :n]])


def from_blocks(blocks: Blocks) -> Floats:
    """Return the matrix, shape (2 * n, 2 * n), that has these blocks."""
    return np.block([[blocks[2], blocks[0]], [blocks[3], blocks[1]]])
