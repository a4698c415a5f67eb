"""The posture prior of a hand, learned from its recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior, learned_prior
from graspdb_ingest.tracking.fit import FREE, SEVEN, FrameFit, fit_frame, refit_frame, visible
from graspdb_ingest.tracking.frame_choice import MINIMUM_FRAMES, MINIMUM_MARKERS

N_FRAMES: Final = 250
"""Frames that a prior is learned from at the most, spread evenly over the recordings."""
ROUNDS: Final = 3
"""Rounds of expectation maximisation."""
DOUBTFUL: Final = 0.9999
"""Probability of a marker's residual beyond which its frame is not learned from."""


@dataclass(frozen=True)
class LearnedPrior:
    """Where the joints of one hand usually are.

    Attributes
    ----------
    prior : PosturePrior
        Mean and covariance of the joint angles.
    n_frames : int
        Frames that it was learned from; 0 where it is the one of any hand.
    n_independent : float
        Number of independent postures that they are worth.
    """

    prior: PosturePrior
    n_frames: int
    n_independent: float


def learn_prior(
    hand: HandModel,
    frames: Floats,
    seconds: float,
    default: PosturePrior,
    marker_sd: Floats,
    posture_time: float,
) -> LearnedPrior:
    """Learn where a hand's joints usually are, and how they move together.

    Each frame is fitted by itself. What it leaves uncertain, joints that no marker shows above
    all, counts with its covariance, so such joints keep the default's spread and are tied to the
    others as the default says.

    Parameters
    ----------
    hand : HandModel
        The calibrated hand.
    frames : ndarray, shape (n_frames, n_markers, 3)
        A sample of frames, even in time [m].
    seconds : float
        How long the recordings are that they were sampled from [s].
    default : PosturePrior
        What is known of any hand.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker [m].
    posture_time : float
        Time scale r^-1 of joint angles as a Matern process of smoothness 3/2 [s]. Its squared
        correlation has the integral 5/2 r^-1: so long does it take for a new sample of a covariance.

    Returns
    -------
    LearnedPrior
        The prior; the default where fewer than eight frames show the hand well.
    """
    usable = np.flatnonzero(visible(frames).sum(axis=1) >= min(MINIMUM_MARKERS, frames.shape[1]))
    spread_evenly = np.linspace(0, len(usable) - 1, min(N_FRAMES, len(usable))).astype(int)
    frames = frames[usable[spread_evenly]]
    kinematics, prior = Kinematics(hand), default
    fits = _fit_in_turn(kinematics, frames, prior, marker_sd)
    kept = [i for i, fit in enumerate(fits) if _fits(fit, marker_sd)]
    if len(kept) < MINIMUM_FRAMES:
        return LearnedPrior(default, 0, 0.0)
    frames, fits = frames[kept], [fits[i] for i in kept]
    independent = min(float(len(frames)), seconds / (2.5 * posture_time))
    for _ in range(ROUNDS):
        angles = np.array([fit.q[SEVEN:] for fit in fits])
        spreads = np.array([_spread(kinematics, fit, prior, marker_sd) for fit in fits])
        prior = learned_prior(default, angles, spreads, independent)
        fits = [
            refit_frame(kinematics, frame, prior, marker_sd, fit.q)
            for frame, fit in zip(frames, fits, strict=True)
        ]
    return LearnedPrior(prior, len(frames), independent)


def _fit_in_turn(
    kinematics: Kinematics, frames: Floats, prior: PosturePrior, marker_sd: Floats
) -> Sequence[FrameFit]:
    """Fit each frame from the last one's posture, and from nowhere where that does not explain it."""
    fits: list[FrameFit] = []
    for frame in frames:
        near = refit_frame(kinematics, frame, prior, marker_sd, fits[-1].q) if fits else None
        if near is None or not _fits(near, marker_sd):
            near = fit_frame(kinematics, frame, prior, marker_sd)
        fits.append(near)
    return fits


def _fits(fit: FrameFit, marker_sd: Floats) -> bool:
    squared = np.sum(fit.residuals**2, axis=1) / marker_sd**2
    return bool(np.nanmax(squared) < chdtri(3, 1 - DOUBTFUL))


def _spread(kinematics: Kinematics, fit: FrameFit, prior: PosturePrior, marker_sd: Floats) -> Floats:
    """Return the covariance of a frame's joint angles [rad2]."""
    kinematics.move(fit.q)
    seen = visible(fit.residuals)
    rows = (kinematics.marker_jacobian() / marker_sd[:, None, None])[seen].reshape(-1, kinematics.hand.n_dof)
    normal = rows.T @ rows
    normal[FREE:, FREE:] += np.linalg.inv(prior.covariance)
    return np.asarray(np.linalg.inv(normal)[FREE:, FREE:])
