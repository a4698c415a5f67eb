"""How much the hand moves from moment to moment: the process noise of each frame.

A hand rests, reaches and closes within a second, so that no one scale of movement fits a trial. The
score of the likelihood by each step's process noise, which the backward pass brings, says where the
noise was taken too small or too large. It is summed over a tenth of a second and each group of joints.
"""

from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.tracking.fit import FREE
from graspdb_ingest.tracking.motion import Blocks, MotionModel

WINDOW: Final = 0.1
"""Standard deviation of the window in time [s]."""
PRIOR_COUNT: Final = 0.3
"""Degrees of freedom with which the expected movement is believed."""
EXPONENT: Final = 2.0
"""The score by itself tells of a change less than there is, as the markers' noise hides part of it."""
FIRST: Final = 8.0
"""Share of the process noise with which a recording is passed first: enough for the fastest movements."""
HIDDEN: Final = 0.3
"""A joint of which a frame tells less than this share of what frames usually tell is hidden in it."""
RANGE: Final = (0.05, 100.0)
"""Least and largest process noise, as shares of the whole recording's."""


def joint_groups(hand: HandModel) -> list[list[int]]:
    """Return the degrees of freedom that move together: translation, rotation, wrist, and each digit."""
    groups: dict[str, list[int]] = {"translation": [0, 1, 2], "rotation": [3, 4, 5]}
    for i, joint in enumerate(hand.joints):
        groups.setdefault(joint.partition("_")[0], []).append(FREE + i)
    return list(groups.values())


def movement(motion: MotionModel, adjoint: Floats, matrix: Blocks) -> Floats:
    """Return what a frame says of its step's process noise Q: found and expected, shape (2, n_dof).

    Twice the derivative of the log likelihood by the logarithm of a degree of freedom's part of Q is
    a^T Q a - tr(Q X), with the adjoint vector a and matrix X of the frame's prediction.
    """
    n = len(adjoint) // 2
    at, rate = adjoint[:n], adjoint[n:]
    both, of_rate, of_position = motion.own_noise
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    return np.array(
        [
            at * at * of_position + 2 * at * rate * both + rate * rate * of_rate,
            diagonal[2] * of_position + 2 * diagonal[0] * both + diagonal[1] * of_rate,
        ]
    )


def activity(movements: Floats, groups: list[list[int]], rate: float) -> Floats:
    """Return the process noise of each frame and degree of freedom, as shares of the assumed one.

    Parameters
    ----------
    movements : ndarray, shape (n_frames, 2, n_dof)
        What `movement` says of each frame of a pass with the share `FIRST`.
    groups : list of list of int
        Degrees of freedom that share a process noise.
    rate : float
        Frames per second [Hz].

    Returns
    -------
    ndarray, shape (n_frames, n_dof)
        Shares, within `RANGE`.
    """
    width = WINDOW * rate
    shares = np.ones((len(movements), movements.shape[2]))
    for group in groups:
        sums = movements[:, :, group].sum(axis=2)
        found, expected = gaussian_filter1d(sums, width, axis=0, mode="nearest").T
        count = width * 2 * np.sqrt(np.pi)  # frames that a Gaussian window is worth
        ratio = (count * FIRST * found + PRIOR_COUNT) / (count * FIRST * expected + PRIOR_COUNT)
        # What no marker shows may move as fast as anything: its neighbours in time say nothing of it.
        shown = sums[:, 1] / (sums[:, 1] + HIDDEN * np.median(sums[:, 1]) + np.finfo(float).tiny)
        shares[:, group] = (FIRST * ratio ** (EXPONENT * shown))[:, None]
    return np.clip(shares, *RANGE)
