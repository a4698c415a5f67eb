"""Backward pass of the Kalman smoother: every frame corrected by all that came after it.

The Rauch-Tung-Striebel smoother in the form of Bryson and Frazier (modified by Bierman 1973), which
gives the same estimates and needs no inverse of a covariance: an adjoint vector and matrix are
carried backwards, and a measurement changes what they say of positions only. Corrections are taken in the
tangent space of the filter's configuration, where the filter's errors are.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.tracking.algebra import before_measurement, smoothed_covariance
from graspdb_ingest.tracking.filter import State, Update
from graspdb_ingest.tracking.motion import Blocks, MotionModel, left_half

BLOCK: Final = 64
"""Frames that are smoothed before anything is done with them: few enough for the processor's cache."""
DOUBLE_FRAMES: Final = 12_000
"""Longer recordings keep their forward pass in single precision, 10 kB a frame for 29 degrees of freedom."""


@dataclass(frozen=True)
class Smoothed:
    """A stretch of frames, corrected by what came after them.

    Attributes
    ----------
    frames : slice
        Which frames of the forward pass.
    step : ndarray, shape (n, n_dof)
        What to add to the filter's predicted configurations, in the degrees of freedom.
    covariance : ndarray, shape (n, n_dof, n_dof)
        Covariance of the positions.
    disturbances : Disturbances
        What disturbed the movement to these frames.
    """

    frames: slice
    step: Floats
    covariance: Floats
    disturbances: "Disturbances"


@dataclass(frozen=True)
class Disturbances:
    """What moved a hand otherwise than the motion model says, as the smoother sees it.

    Attributes
    ----------
    squared : ndarray, shape (n, n_dof)
        Squared size of each frame's disturbance over its variance, summed to w^T Q^-1 w.
    determined : ndarray, shape (n, n_dof)
        How many of the disturbances the data tell: from 0 to 2 a degree of freedom.
    """

    squared: Floats
    determined: Floats


class ForwardPass:
    """What the backward pass needs of each frame of the forward pass.

    Parameters
    ----------
    n_frames : int
        Frames at the most.
    n_dof : int
        Degrees of freedom.
    """

    def __init__(self, n_frames: int, n_dof: int) -> None:
        kind = np.float64 if n_frames <= DOUBLE_FRAMES else np.float32
        self._columns = np.empty((n_frames, 2 * n_dof, n_dof), dtype=kind)
        self._inverse = np.empty((n_frames, n_dof, n_dof), dtype=kind)
        self._weighted = np.empty((n_frames, n_dof))
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def append(self, predicted: State, update: Update) -> None:
        """Take the next frame."""
        i = self._length
        self._columns[i] = left_half(predicted.blocks)
        self._inverse[i] = update.inverse
        self._weighted[i] = update.weighted
        self._length += 1

    def clear(self) -> None:
        """Forget all frames."""
        self._length = 0

    def backward(self, motion: MotionModel) -> Iterator[tuple[int, Floats, Blocks]]:
        """Yield frame, adjoint vector and adjoint matrix, from the last frame to the first.

        They belong to the frame's prediction with mean x and covariance P: the smoothed state is
        x - P a and its covariance P - P X P. The log likelihood of all that is measured from this
        frame on has the derivatives -a by x and (a a^T - X) / 2 by P.

        Parameters
        ----------
        motion : MotionModel
            The step between frames that the forward pass predicted with.
        """
        n = self._weighted.shape[1]
        adjoint: Floats = np.zeros(2 * n)
        matrix: Blocks = np.zeros((4, n, n))
        for i in reversed(range(self._length)):
            if i < self._length - 1:
                adjoint, matrix = motion.before(adjoint, matrix)
            inverse = np.asarray(self._inverse[i], dtype=float)
            adjoint, matrix = before_measurement(adjoint, matrix, self._left(i), inverse, self._weighted[i])
            yield i, adjoint, matrix

    def smooth(self, motion: MotionModel, activity: Floats | None = None) -> Iterator[Smoothed]:
        """Yield the smoothed frames, block by block, the last block first.

        Parameters
        ----------
        motion : MotionModel
            The step between frames that the forward pass predicted with.
        activity : ndarray, shape (n, n_dof), optional
            Factors on the standard deviation of the process noise that it had.
        """
        n, stop = self._weighted.shape[1], self._length
        steps, covariances = np.empty((BLOCK, n)), np.empty((BLOCK, n, n))
        squared, determined = np.empty((2, BLOCK, n))
        for i, adjoint, matrix in self.backward(motion):
            place, columns = i % BLOCK, self._left(i)
            steps[place] = -(adjoint @ columns)
            covariances[place] = smoothed_covariance(matrix, columns)
            factors = None if activity is None else activity[i]
            squared[place], determined[place] = motion.disturbance(adjoint, matrix, factors)
            if i == 0:  # nothing led to the first frame
                squared[0] = determined[0] = 0.0
            if place == 0:
                length = stop - i
                found = Disturbances(squared[:length].copy(), determined[:length].copy())
                yield Smoothed(slice(i, stop), steps[:length].copy(), covariances[:length].copy(), found)
                stop = i

    def _left(self, frame: int) -> Floats:
        """Return the columns of a prediction's covariance that belong to positions, (2 * n_dof, n_dof)."""
        return np.asarray(self._columns[frame], dtype=float)
