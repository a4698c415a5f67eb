"""How a hand moves when nobody looks: the filter's process model, one 2 x 2 block a degree of freedom.

The free joint has white acceleration (nearly constant velocity). Joint angles are a Matern process
with smoothness 3/2 about the mean posture, in its state-space form (Hartikainen and Sarkka 2010):
left alone, they return to the posture prior, with its covariance, in a few of its time scales.
So a joint that no marker shows goes where joints go, and its standard deviation says so.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.blas import dgemm

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
    position_position, position_velocity, velocity_position, velocity_velocity : ndarray, shape (n_dof,)
        The four elements of each degree of freedom's 2 x 2 transition A.
    noise : ndarray, shape (2 * n_dof, 2 * n_dof)
        Covariance of w, positions first.
    stationary : ndarray, shape (2 * n_dof, 2 * n_dof)
        Covariance of a hand of which nothing is known but that it is one: the prior for the
        joint angles, a wide one for the free joint.
    """

    position_position: Floats
    position_velocity: Floats
    velocity_position: Floats
    velocity_velocity: Floats
    noise: Floats
    stationary: Floats

    def predict_covariance(self, covariance: Blocks, activity: Floats | None = None) -> Blocks:
        """Return A P A^T + D Q D, with D the factors on the noise's standard deviation, one a dof."""
        noise = self._noise_blocks[1:]
        if activity is not None:
            noise = noise * np.outer(activity, activity)
        return _congruent(covariance, self._forward, noise)

    def disturbance(
        self, adjoint: Floats, matrix: Blocks, activity: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return a^T Q a and tr(Q X), each shared out among the degrees of freedom, shape (n_dof,).

        With adjoint vector and matrix of a prediction, they are the squared size of the smoothed
        disturbance that led to it, w^T Q^-1 w, and the number of disturbances that the data tell.
        """
        factors = np.ones(len(self.position_position)) if activity is None else activity
        felt = (adjoint.reshape(2, -1) * factors).reshape(-1)
        squared = (felt * (self.noise @ felt)).reshape(2, -1).sum(axis=0)
        determined = ((self._noise_blocks * matrix) @ factors).sum(axis=0) * factors
        return squared, determined

    def adjoint(self, vector: Floats) -> Floats:
        """Return A^T x, shape (2 * n_dof,)."""
        of_position, of_velocity = vector.reshape(2, -1)
        adjoint: Floats = self._of_position * of_position
        adjoint += self._of_velocity * of_velocity
        return adjoint.reshape(-1)

    def adjoint_matrix(self, matrix: Blocks) -> Blocks:
        """Return A^T X A of a symmetric X."""
        return _congruent(matrix, self._backward)

    @cached_property
    def _by_offset(self) -> Floats:
        return np.array([self.position_position - 1, self.velocity_position])

    @cached_property
    def _by_velocity(self) -> Floats:
        return np.array([self.position_velocity, self.velocity_velocity])

    @cached_property
    def _of_position(self) -> Floats:
        return np.array([self.position_position, self.position_velocity])

    @cached_property
    def _of_velocity(self) -> Floats:
        return np.array([self.velocity_position, self.velocity_velocity])

    @cached_property
    def _forward(self) -> Floats:
        a, b = self.position_position, self.position_velocity
        c, d = self.velocity_position, self.velocity_velocity
        return _congruence(a, b, c, d)

    @cached_property
    def _backward(self) -> Floats:
        a, b = self.position_position, self.velocity_position
        c, d = self.position_velocity, self.velocity_velocity
        return _congruence(a, b, c, d)

    @cached_property
    def _noise_blocks(self) -> Blocks:
        return to_blocks(self.noise)

    def predict_mean(self, offset: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Return the change of position over the step, and the velocity after it, each (n_dof,).

        `offset` is the posture minus its mean; it plays no part for the free joint.
        """
        moved = self._by_offset * offset
        moved += self._by_velocity * velocity
        return moved[0], moved[1]


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
    wide = np.repeat([1.0, np.pi], 3)
    stationary[range(FREE), range(FREE)] = wide**2
    stationary[range(n, n + FREE), range(n, n + FREE)] = (wide / noise.finger_time) ** 2
    return MotionModel(
        position_position=from_position,
        position_velocity=from_velocity,
        velocity_position=to_velocity,
        velocity_velocity=of_velocity,
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


def left_half(blocks: Blocks) -> Floats:
    """Return the columns of the positions, shape (2 * n, n): a view."""
    return blocks[2:].reshape(-1, blocks.shape[2])


def right_half(blocks: Blocks) -> Floats:
    """Return the columns of the velocities, shape (2 * n, n): a view."""
    return blocks[:2].reshape(-1, blocks.shape[2])


def add_product(out: Floats, factor: float, a: Floats, b: Floats) -> None:
    """Add factor * A B to `out`, in place; all are rows in order, which BLAS sees as transposed columns."""
    dgemm(factor, b.T, a.T, 1.0, out.T, overwrite_c=True)


def make_symmetric(blocks: Blocks) -> None:
    """Make blocks those of a symmetric matrix again, in place, where rounding has left them askew."""
    own = blocks[1:3]
    own += own.transpose(0, 2, 1).copy()
    own *= 0.5
    blocks[0] = blocks[3].T


def _congruence(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return what `_congruent` multiplies blocks with for B of the diagonals [[a, b], [c, d]]."""
    rows = [
        [np.outer(c, d), np.outer(d, d), np.outer(c, c), np.outer(d, c)],
        [np.outer(a, b), np.outer(b, b), np.outer(a, a), np.outer(b, a)],
        [np.outer(c, b), np.outer(d, b), np.outer(c, a), np.outer(d, a)],
    ]
    return np.array(rows).reshape(3, 4, -1)


def _congruent(blocks: Blocks, factors: Floats, more: Floats | None = None) -> Blocks:
    """Return B X B^T of a symmetric X, element by element, B's blocks being diagonal.

    `more`, the last three blocks of another symmetric matrix, is added.
    """
    result = np.empty_like(blocks)
    np.einsum("ijk,jk->ik", factors, blocks.reshape(4, -1), out=result.reshape(4, -1)[1:])
    if more is not None:
        result[1:] += more
    result[0] = result[3].T
    return result
