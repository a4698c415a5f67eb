"""Where joints usually are: mean and covariance of the joint angles of a hand.

Joints that no marker shows go where hands have them. The default is made from textbook ranges and
two well-known couplings: the two interphalangeal joints of a finger flex together, and so do
neighbouring fingers (postural synergies; Santello, Flanders and Soechting 1998).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import multigammaln

from graspdb_ingest.hand.model import HandModel
from graspdb_schemas.vocabulary import FINGERS

MEAN_AND_SPREAD: Final[dict[str, tuple[float, float]]] = {
    "wrist_flexion": (-10, 20),
    "wrist_deviation": (-5, 10),
    "thumb_cmc_flexion": (0, 18),
    "thumb_cmc_abduction": (10, 18),
    "thumb_mcp_flexion": (15, 18),
    "thumb_mcp_abduction": (0, 8),
    "thumb_ip_flexion": (20, 22),
    **{f"{finger}_mcp_flexion": (30, 25) for finger in FINGERS},
    **{f"{finger}_mcp_abduction": (2, 9) for finger in FINGERS},
    **{f"{finger}_pip_flexion": (35, 27) for finger in FINGERS},
    **{f"{finger}_dip_flexion": (20, 16) for finger in FINGERS},
}
"""Mean and standard deviation [degrees]: a relaxed hand, about a quarter of each range."""

NEIGHBOURING_FINGERS: Final = 0.75
"""Correlation of the same flexion of two neighbouring fingers."""

FLEXIONS: Final = ("mcp_flexion", "pip_flexion", "dip_flexion")
FLEXIONS_OF_A_FINGER: Final = np.array([[1.0, 0.35, 0.30], [0.35, 1.0, 0.80], [0.30, 0.80, 1.0]])
"""Correlation of a finger's mcp, pip and dip flexion."""

DEFAULT_WEIGHTS: Final = tuple(2.0**power for power in range(9))
"""As how many postures the default's covariance may count, beside those that were seen."""


@dataclass(frozen=True)
class PosturePrior:
    """A normal distribution of the hinges' angles.

    Attributes
    ----------
    mean : ndarray, shape (n_hinges,)
        Mean angles [rad].
    covariance : ndarray, shape (n_hinges, n_hinges)
        Their covariance [rad2].
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]


def default_prior(hand: HandModel) -> PosturePrior:
    """Return the prior for a hand by the names of its joints.

    Each joint of another kind of hand gets the middle of its range and a quarter of it as its spread.
    """
    limits = hand.joint_range
    mean, spread = limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 4
    if hand.foreign:
        return PosturePrior(mean=mean, covariance=np.diag(spread**2))
    for i, joint in enumerate(hand.joints):
        if joint in MEAN_AND_SPREAD:
            mean[i], spread[i] = np.deg2rad(MEAN_AND_SPREAD[joint])
    return PosturePrior(mean=mean, covariance=_correlation(hand.joints) * np.outer(spread, spread))


def _correlation(joints: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the Kronecker product of the two couplings on the fingers' flexions, identity elsewhere."""
    correlation = np.eye(len(joints))
    place = {joint: i for i, joint in enumerate(joints)}
    flexions = [f"{finger}_{flexion}" for finger in FINGERS for flexion in FLEXIONS]
    steps = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
    coupled = np.kron(NEIGHBOURING_FINGERS**steps, FLEXIONS_OF_A_FINGER)
    here = [i for i, name in enumerate(flexions) if name in place]
    rows = [place[flexions[i]] for i in here]
    correlation[np.ix_(rows, rows)] = coupled[np.ix_(here, here)]
    return correlation


def learned_prior(
    default: PosturePrior, angles: NDArray[np.float64], spreads: NDArray[np.float64], n_independent: float
) -> PosturePrior:
    """Return the prior that a default one becomes after postures have been seen.

    The conjugate (normal and inverse Wishart) posterior mean. The default counts as one posture for the
    mean and as `_default_weight` of them for the covariance. Postures are seldom known exactly, so their own
    covariances are part of the spread (expectation maximisation's second step); a joint that no
    marker shows then keeps the spread it had.

    Parameters
    ----------
    default : PosturePrior
        What is known of any hand.
    angles : ndarray, shape (n_postures, n_hinges)
        Estimates of the joint angles [rad].
    spreads : ndarray, shape (n_postures, n_hinges, n_hinges)
        Covariance of each estimate [rad2].
    n_independent : float
        How many independent postures they are worth; neighbouring frames are one and the same.

    Returns
    -------
    PosturePrior
        The prior for this hand.
    """
    found = angles.mean(axis=0)
    mean = (default.mean + n_independent * found) / (1 + n_independent)
    about, off = angles - found, found - default.mean
    scatter = n_independent * (about.T @ about / len(angles) + spreads.mean(axis=0))
    scatter += n_independent / (1 + n_independent) * np.outer(off, off)
    weight = _default_weight(default.covariance, scatter, n_independent)
    covariance = (weight * default.covariance + scatter) / (weight + n_independent)
    return PosturePrior(mean=mean, covariance=(covariance + covariance.T) / 2)


def _default_weight(
    default: NDArray[np.float64], scatter: NDArray[np.float64], n_independent: float
) -> float:
    """Return as how many postures the default's covariance counts: the weight with the greatest evidence.

    Of an inverse Wishart distribution with the default as its mean: w = degrees of freedom - joints - 1.
    Its marginal likelihood (Gelman et al., Bayesian Data Analysis, section 3.6) is near its greatest at w if
    the hand's postures differ from the default about as much as w postures drawn from it would.
    """
    n_joints = len(default)

    def evidence(weight: float) -> float:
        freedom = weight + n_joints + 1
        _, before = np.linalg.slogdet(weight * default)
        _, after = np.linalg.slogdet(weight * default + scatter)
        gained = multigammaln((freedom + n_independent) / 2, n_joints) - multigammaln(freedom / 2, n_joints)
        return float(freedom * before - (freedom + n_independent) * after) / 2 + float(gained)

    return max(DEFAULT_WEIGHTS, key=evidence)
