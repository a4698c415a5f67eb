"""A data glove's sensors against the hand that the markers show: offset, noise and delay of each.

The paper proposes to hold hidden digits with a glove. A glove's angles are further measurements of
the filter, once it is known how far each sensor is off. That is estimated from the recording itself,
by alternation: the hand is followed by its markers alone, the sensors are compared with it where the
markers show their joints well, and the hand is followed again with both.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.glove_angles import GloveAngles
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.parameters import GloveParameters
from graspdb_ingest.tracking.correction import JointReadings

MINIMUM_FRAMES: Final = 20
"""Frames that must show a joint before its sensor's offset and noise are estimated."""
BETTER: Final = 0.95
"""A delay counts if it brings the squared differences below this share of those without one."""
BEYOND_RANGE: Final = np.deg2rad(15)
"""A sensor may show a joint this far beyond its limits [rad]; further away it shows none."""


@dataclass(frozen=True)
class GloveFit:
    """What a recording says of its glove.

    Attributes
    ----------
    joints : tuple of str
        The joints whose sensors are used.
    offset, offset_sd, sd : ndarray, shape (n_sensors,)
        Each sensor's constant offset, its standard deviation, and that of a sample about it [rad].
    delay : float
        How much later the glove's clock shows a movement [s].
    measurement : JointReadings
        The angles for the filter.
    notes : tuple of str
        What was left out, and why.
    """

    joints: tuple[str, ...]
    offset: Floats
    offset_sd: Floats
    sd: Floats
    delay: float
    measurement: JointReadings
    notes: tuple[str, ...]


def fit_glove(
    glove: GloveAngles,
    hand: HandModel,
    times: Floats,
    angles: Floats,
    angles_sd: Floats,
    parameters: GloveParameters,
) -> GloveFit:
    """Compare a glove's sensors with a hand that was followed by its markers.

    Parameters
    ----------
    glove : GloveAngles
        The sensors.
    hand : HandModel
        The hand.
    times : ndarray, shape (n_frames,)
        Times of the frames [s].
    angles, angles_sd : ndarray, shape (n_frames, n_hinges)
        Joint angles by the markers and their standard deviations [rad], NaN where not known.
    parameters : GloveParameters
        How well a joint must be known, and what a sensor is before anything is known of it.
    """
    shown, shown_sd = angles[:, glove.hinges], angles_sd[:, glove.hinges]
    known = np.where(shown_sd < parameters.known_sd, shown, np.nan)
    delay = _delay(glove, times, known, parameters.longest_delay)
    values = glove.at(times, delay)
    difference = values - known
    rate = (len(times) - 1) / float(times[-1] - times[0])
    window = max(1.0, parameters.memory * rate)
    estimates = [_sensor(column, parameters, window) for column in difference.T]
    offset, offset_sd, sd, variance = (np.array(part) for part in zip(*estimates, strict=True))
    corrected = values - offset
    notes = [f"the glove's clock is {1e3 * delay:.0f} ms late"] if abs(delay) > 1.5 / rate else []
    limits = hand.joint_range[glove.hinges]
    beyond = (corrected < limits[:, 0] - BEYOND_RANGE) | (corrected > limits[:, 1] + BEYOND_RANGE)
    notes += _out_of_range(glove.joints, beyond, np.isfinite(corrected))
    corrected[beyond] = np.nan
    kept = sd <= parameters.maximum_sd
    notes += [
        f"glove sensor {joint} is left out: it differs from the markers by {np.rad2deg(s):.0f} degrees (sd)"
        for joint, s, keep in zip(glove.joints, sd, kept, strict=True)
        if not keep
    ]
    return GloveFit(
        joints=tuple(joint for joint, keep in zip(glove.joints, kept, strict=True) if keep),
        offset=offset[kept],
        offset_sd=offset_sd[kept],
        sd=sd[kept],
        delay=delay,
        measurement=JointReadings(glove.hinges[kept], corrected[:, kept], variance[kept]),
        notes=tuple(notes),
    )


def _sensor(
    difference: Floats, parameters: GloveParameters, window: float
) -> tuple[float, float, float, float]:
    """Return offset, its sd, the sd of a sample, and the variance that the filter is to use.

    The filter takes samples as independent, and forgets what is older than `window` frames. Errors
    that hang together over time count for fewer samples, and an offset's own error is the same in
    every one of them, so both are scaled up until the window as a whole says no more than it knows.
    """
    usual, prior = parameters.usual_sd**2, parameters.offset_sd**2
    seen = np.isfinite(difference)
    if seen.sum() < MINIMUM_FRAMES:
        return 0.0, parameters.offset_sd, parameters.usual_sd, usual + window * prior
    centre = float(np.median(difference[seen]))
    spread = 1.4826 * float(np.median(np.abs(difference[seen] - centre)))
    sd = max(spread, parameters.minimum_sd)
    inlying = seen & (np.abs(difference - centre) < 3 * sd)
    residual = np.where(inlying, difference - difference[inlying].mean(), np.nan)
    sd = max(float(np.sqrt(np.nanmean(residual**2))), parameters.minimum_sd)
    together = correlation_length(residual, window)
    of_mean = sd**2 * together / inlying.sum()
    offset_variance = 1 / (1 / of_mean + 1 / prior)
    offset = float(difference[inlying].mean()) * offset_variance / of_mean
    return offset, float(np.sqrt(offset_variance)), sd, sd**2 * together + window * offset_variance


def correlation_length(residual: Floats, longest: float) -> float:
    """Return how many successive samples count for one: 1 + 2 * sum of autocorrelations.

    The sum goes up to the first that is not positive, and at most to a lag of `longest` (Geyer 1992,
    initial positive sequence). Pairs with a missing sample are left out.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Samples about zero, NaN where missing.
    longest : float
        Longest lag, and the largest value returned.
    """
    power = float(np.nanmean(residual**2))
    total = 1.0
    for lag in range(1, min(int(longest) + 1, len(residual))):
        products = residual[lag:] * residual[:-lag]
        if power <= 0 or not np.isfinite(products).any():
            break
        correlation = float(np.nanmean(products)) / power
        if correlation <= 0:
            break
        total += 2 * correlation
    return min(total, longest)


def _delay(glove: GloveAngles, times: Floats, known: Floats, longest: float) -> float:
    """Return the delay at which the sensors' movement agrees best with the markers' [s]."""
    step = float(times[-1] - times[0]) / (len(times) - 1)
    count = int(longest / step)
    if count == 0 or np.isfinite(known).sum() < MINIMUM_FRAMES:
        return 0.0
    delays = step * np.arange(-count, count + 1)
    costs = np.array([_disagreement(glove.at(times, delay) - known) for delay in delays])
    best = int(np.nanargmin(costs)) if np.isfinite(costs).any() else count
    if not costs[best] < BETTER * costs[count]:
        return 0.0
    if 0 < best < 2 * count:
        before, here, after = costs[best - 1 : best + 2]
        bend = before - 2 * here + after
        return float(delays[best] + (step * 0.5 * (before - after) / bend if bend > 0 else 0.0))
    return float(delays[best])


def _disagreement(difference: Floats) -> float:
    """Return the mean variance of the sensors' differences; NaN without any."""
    counts = np.isfinite(difference).sum(axis=0)
    enough = counts >= MINIMUM_FRAMES
    return float(np.mean(np.nanvar(difference[:, enough], axis=0))) if enough.any() else float("nan")


def _out_of_range(joints: tuple[str, ...], beyond: Floats, given: Floats) -> list[str]:
    shares = beyond.sum(axis=0) / np.maximum(given.sum(axis=0), 1)
    return [
        f"glove sensor {joint} is out of the joint's range in {share:.0%} of its samples, which are left out"
        for joint, share in zip(joints, shares, strict=True)
        if share > 0
    ]
