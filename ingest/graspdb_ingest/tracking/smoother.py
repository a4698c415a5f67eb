"""Backward pass of the Kalman smoother: every frame corrected by all that came after it.

The Rauch-Tung-Striebel smoother in the form of Bryson and Frazier (modified by Bierman 1973), which
gives the same estimates and needs no inverse of a covariance: an adjoint vector and matrix are
carried backwards, and a measurement changes what they say of positions only. Corrections are taken in the
tangent space of the filter's configuration, where the filter's errors are.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from graspdb_ingest.compiled import compiled
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.tracking.algebra import (
    before_measurement,
    before_step,
    copy_matrix,
    copy_vector,
    disturbance,
    left_half,
    smoothed_covariance,
)
from graspdb_ingest.tracking.filter import State, Update
from graspdb_ingest.tracking.motion import Blocks, MotionModel

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
        Covariance of the positions; of no frame where it was not wanted.
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


class Record(NamedTuple):
    """What the frames of a forward pass leave behind, a row a frame; memory that compiled code writes to.

    Attributes
    ----------
    columns : ndarray, shape (n_frames, 2 * n_dof, n_dof)
        Columns of each prediction's covariance that belong to positions.
    inverse, weighted : ndarray, shape (n_frames, n_dof, n_dof), (n_frames, n_dof)
        J^T S^-1 J and J^T S^-1 y of each correction.
    q : ndarray, shape (n_frames, n_q)
        Predicted configurations.
    used : ndarray of bool, shape (n_frames, n_markers)
        Markers that were seen and passed the gate.
    at_limit : ndarray of bool, shape (n_frames,)
        Where a joint was held at its limit.
    """

    columns: Floats
    inverse: Floats
    weighted: Floats
    q: Floats
    used: Bools
    at_limit: Bools


class ForwardPass:
    """What the backward pass needs of each frame of the forward pass.

    Parameters
    ----------
    n_frames : int
        Frames at the most.
    n_dof : int
        Degrees of freedom: six of a free joint, and hinges.
    n_markers : int
        Markers.

    Attributes
    ----------
    record : Record
        The frames, of which the first ``length`` count.
    length : int
        Number of frames.
    """

    def __init__(self, n_frames: int, n_dof: int, n_markers: int) -> None:
        kind = np.float64 if n_frames <= DOUBLE_FRAMES else np.float32
        self.record = Record(
            columns=np.empty((n_frames, 2 * n_dof, n_dof), dtype=kind),
            inverse=np.empty((n_frames, n_dof, n_dof), dtype=kind),
            weighted=np.empty((n_frames, n_dof)),
            q=np.empty((n_frames, n_dof + 1)),
            used=np.empty((n_frames, n_markers), dtype=bool),
            at_limit=np.empty(n_frames, dtype=bool),
        )
        self.length = 0

    def append(self, predicted: State, update: Update) -> None:
        """Take the next frame."""
        i, record = self.length, self.record
        record.columns[i] = left_half(predicted.blocks)
        record.inverse[i], record.weighted[i] = update.inverse, update.weighted
        record.q[i], record.used[i], record.at_limit[i] = predicted.q, update.used, update.at_limit
        self.length += 1

    def smooth(
        self, motion: MotionModel, activity: Floats | None = None, covariance: bool = True
    ) -> Iterator[Smoothed]:
        """Yield the smoothed frames, block by block, the last block first.

        Parameters
        ----------
        motion : MotionModel
            The step between frames that the forward pass predicted with.
        activity : ndarray, shape (n, n_dof), optional
            Factors on the standard deviation of the process noise that it had.
        covariance : bool
            Whether covariances are wanted; they are a third of the work.
        """
        n = self.record.weighted.shape[1]
        adjoint: Floats = np.zeros(2 * n)
        matrix: Blocks = np.zeros((4, n, n))
        factors = np.ones((self.length, n)) if activity is None else activity
        stop = self.length
        while stop > 0:
            first = (stop - 1) // BLOCK * BLOCK
            last = stop == self.length
            adjoint, matrix, *found = _smooth_block(
                self.record,
                first,
                stop,
                last,
                adjoint,
                matrix,
                motion.transition,
                motion.noise_blocks,
                factors,
                covariance,
            )
            steps, covariances, squared, determined = found
            yield Smoothed(slice(first, stop), steps, covariances, Disturbances(squared, determined))
            stop = first


@compiled
def _earlier(
    record: Record, i: int, last: bool, adjoint: Floats, matrix: Blocks, transition: Floats
) -> tuple[Floats, Blocks]:
    """Return adjoint vector and matrix of a frame's prediction from those of the next one's."""
    if not last:
        adjoint, matrix = before_step(adjoint, matrix, transition)
    columns, inverse = record.columns[i].astype(np.float64), record.inverse[i].astype(np.float64)
    return before_measurement(adjoint, matrix, columns, inverse, record.weighted[i])


@compiled
def _smooth_block(
    record: Record,
    first: int,
    stop: int,
    last: bool,
    adjoint: Floats,
    matrix: Blocks,
    transition: Floats,
    noise: Blocks,
    activity: Floats,
    covariance: bool,
) -> tuple[Floats, Blocks, Floats, Floats, Floats, Floats]:
    """Return adjoint vector and matrix of the block's first frame, and what `Smoothed` holds of it."""
    n, length = len(matrix[0]), stop - first
    steps, covariances = np.empty((length, n)), np.empty((length if covariance else 0, n, n))
    squared, determined = np.zeros((length, n)), np.zeros((length, n))
    for i in range(stop - 1, first - 1, -1):
        adjoint, matrix = _earlier(record, i, last and i == stop - 1, adjoint, matrix, transition)
        columns = record.columns[i].astype(np.float64)
        moved = np.dot(adjoint, columns)
        for dof in range(n):
            steps[i - first, dof] = -moved[dof]
        if covariance:
            copy_matrix(smoothed_covariance(matrix, columns), covariances[i - first])
        if i:  # nothing led to the first frame
            felt, told = disturbance(adjoint, matrix, noise, activity[i])
            copy_vector(felt, squared[i - first])
            copy_vector(told, determined[i - first])
    return adjoint, matrix, steps, covariances, squared, determined
