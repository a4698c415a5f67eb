"""How lively a hand moves from moment to moment: the scale of its process noise, from the recording itself.

A hand holds still, reaches and closes; one process noise for all of it is too much at rest and too little
in a fast movement, and the standard deviations that follow from it are wrong both times. So the noise of
each part of the hand is scaled in time, each moment by the scale with the greatest evidence. The
fixed point of the evidence (MacKay 1992, Bayesian interpolation, equation 4.4) is the squared size of
what disturbed the movement, as the smoother sees it, over the number of disturbances that the markers tell:
both come with the backward pass (de Jong 1989).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.tracking.fit import FREE
from graspdb_ingest.tracking.smoother import Disturbances

WINDOW_SD: Final = 0.05
"""Standard deviation of the Gaussian window in time that shares one scale [s]: a movement's acceleration and
slowing down last about four of them."""
USUAL: Final = 0.5
"""Number of disturbances of usual size that each window is given besides its own."""
CALMING: Final = 2.0
"""Power of a step towards calm. With f the process noise's share of an innovation's variance, a step of power
one goes a share f of the way, never too far; towards calm, where f is small, twice that is safe."""
SMALLEST: Final = 1e-3
"""Least scale of a part that seems to be at complete rest."""


def parts_of(hand: HandModel) -> NDArray[np.int64]:
    """Return which part each degree of freedom belongs to, shape (n_dof,).

    Translation and rotation of the forearm, wrist, thumb and fingers each have a scale of their own.
    """
    parts = {"wrist": 2, "thumb": 3}
    hinges = [parts.get(joint.partition("_")[0], 4) for joint in hand.joints]
    return np.array([0] * 3 + [1] * (FREE - 3) + hinges)


def next_activity(
    disturbances: Disturbances, parts: NDArray[np.int64], rate: float, activity: Floats
) -> Floats:
    """Return factors on the standard deviation of the process noise with more evidence than the last ones.

    Parameters
    ----------
    disturbances : Disturbances
        What the smoother saw with the last factors.
    parts : ndarray of int, shape (n_dof,)
        Which degrees of freedom share a factor; see `parts_of`.
    rate : float
        Frames per second [Hz].
    activity : ndarray, shape (n_frames, n_dof)
        The last factors.

    Returns
    -------
    ndarray, shape (n_frames, n_dof)
        The next ones; the last ones where nothing was measured.
    """
    sd = WINDOW_SD * rate
    window = sd * np.sqrt(2 * np.pi)  # frames: what turns the filter's mean into a sum
    changed = activity.copy()
    for part in range(int(parts.max()) + 1):
        own = parts == part
        squared, determined = (
            window * gaussian_filter1d(count[:, own].sum(axis=1), sd, mode="nearest")
            for count in (disturbances.squared, disturbances.determined)
        )
        ratio = (USUAL + np.maximum(squared, 0.0)) / (USUAL + np.maximum(determined, 0.0))
        ratio = np.maximum(np.where(ratio < 1, ratio**CALMING, ratio), SMALLEST)
        changed[:, own] *= np.sqrt(ratio)[:, None]
    return changed
