"""How lively a hand moves from moment to moment: the scale of its process noise, from the recording itself.

A hand holds still, reaches and closes; one process noise for all of it is too much at rest and too little
in a fast movement, and the standard deviations that follow from it are wrong both times. So the noise of
each part of the hand is scaled in time, each moment by the scale with the greatest evidence. The
fixed point of the evidence (MacKay 1992, Bayesian interpolation, equation 4.4) is the squared size of
what disturbed the movement, as the smoother sees it, over the number of disturbances that the markers tell:
both come with the backward pass (de Jong 1989).

A filter weighs process noise against the markers' noise. The latter is assumed on the large side, so the
process noise is scaled against what the recording shows of it; else a quiet recording would be smoothed until
it strays as far as was assumed.
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
WINDOW: Final = WINDOW_SD * float(np.sqrt(2 * np.pi))
"""How long an even window is that weighs as much [s]."""
USUAL: Final = 0.5
"""Number of disturbances of usual size that each window is given besides its own."""
SMALLEST: Final = 1e-3
"""Least scale, and least ratio of noise: of a part, or a recording, that seems to be at complete rest."""
SLOW_TIME: Final = 0.1
"""Noise that is still there after this time is slow [s]."""


def parts_of(hand: HandModel) -> NDArray[np.int64]:
    """Return which part each degree of freedom belongs to, shape (n_dof,).

    Translation and rotation of the forearm, and the posture, each have a scale of their own: their noises are
    independent, while those of the hinges hang together as the posture prior says.
    """
    return np.array([0] * 3 + [1] * (FREE - 3) + [2] * len(hand.joints))


def noise_ratio(residuals: Floats, disturbances: Disturbances, rate: float) -> float:
    """Return the variance of the markers' noise over the assumed one, from what a smoothed track leaves.

    Of white noise the track takes up as much as the data tell of disturbances. Noise that moves slowly, skin
    above all, looks like movement: the posture takes up as much of it as it has degrees of freedom. And what
    counts is how far the mean over a window is off: white noise averages out, slow noise does not, so a
    frame of it counts as if it had that much more variance.

    Parameters
    ----------
    residuals : ndarray, shape (n_frames, n_markers, 3)
        Residuals over their assumed standard deviation, NaN where a marker was not used.
    disturbances : Disturbances
        What the track says of the movement.
    rate : float
        Frames per second [Hz].

    Returns
    -------
    float
        The ratio; 1 where next to nothing was measured.
    """
    lag = max(1, round(SLOW_TIME * rate))
    measured = float(np.count_nonzero(np.isfinite(residuals)))
    if len(residuals) <= lag or not measured:
        return 1.0
    later = residuals[lag:] * residuals[:-lag]
    if not np.isfinite(later).any():
        return 1.0
    whole = float(np.nanmean(residuals**2))
    slow = float(np.clip(np.nanmean(later), 0.0, whole))
    postures = disturbances.determined.shape[1] * float(np.isfinite(residuals).any(axis=(1, 2)).sum())
    left = [max(measured - taken, measured / 4) for taken in (disturbances.determined.sum(), postures)]
    frames = max(1.0, WINDOW * rate)
    return max(measured * float((whole - slow) / left[0] + frames * slow / left[1]), SMALLEST)


def next_activity(
    disturbances: Disturbances,
    parts: NDArray[np.int64],
    rate: float,
    activity: Floats,
    noise: float = 1.0,
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
    noise : float
        Variance of the markers' noise over the assumed one; see `noise_ratio`.

    Returns
    -------
    ndarray, shape (n_frames, n_dof)
        The next ones; the last ones where nothing was measured.
    """
    sd = WINDOW_SD * rate
    window = WINDOW * rate  # frames: what turns the filter's mean into a sum
    changed = activity.copy()
    for part in range(int(parts.max()) + 1):
        own = parts == part
        squared, determined = (
            np.maximum(gaussian_filter1d(count[:, own].sum(axis=1), sd, mode="nearest"), 0.0)
            for count in (disturbances.squared / noise, disturbances.determined)
        )
        ratio = (USUAL + window * squared) / (USUAL + window * determined)
        # With f the process noise's share of an innovation's variance, a step goes a share f of the way
        # and so never too far; towards calm, where f is small, up to twice that is safe.
        share = np.minimum(determined / np.count_nonzero(own), 1.0)
        ratio = np.maximum(np.where(ratio < 1, ratio ** (2 - share), ratio), SMALLEST)
        changed[:, own] *= np.sqrt(ratio)[:, None]
    return changed
