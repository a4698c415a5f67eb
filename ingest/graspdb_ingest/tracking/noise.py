"""How a hand moves and how its markers stray, estimated from recordings of it.

The likelihood of the filter's innovations is maximised over a few scales, with a weak prior about
the assumed ones.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.correction import NO_READINGS
from graspdb_ingest.tracking.filter import HandFilter
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.likelihood import PERTURBATION, Perturbed, likelihood
from graspdb_ingest.tracking.motion import MotionModel, MotionNoise, motion_model, to_blocks

SCALE_SD: Final = 1.0
"""Spread of the logarithm of a scale about the assumed one."""
GOLDEN: Final = (5**0.5 - 1) / 2
WINDOWS: Final = 10
WINDOW_TIME: Final = 0.7
"""Length of a window that the estimate uses [s]."""
WINDOW_RATE: Final = 60.0
"""Rate to which windows are thinned: scales are those of continuous time [Hz]."""
SLOW_SD: Final = 0.001
"""Least standard deviation of a marker: skin moves slowly, so that joint angles take part of its
movement up, and what is left of it to see is less than what there is [m]."""
REACH: Final = 3.5
"""A scale is looked for within so many spreads of the assumed one."""
MAXIMUM_EVALUATIONS: Final = 10
MINIMUM_KEPT: Final = 0.3
"""A window in which fewer of the markers are seen and fit tells nothing."""


@dataclass(frozen=True)
class _Window:
    """A stretch of a recording, thinned, and where the hand is at its first frame."""

    markers: Floats
    step: float
    start: Floats


def estimate_noise(
    hand: HandModel,
    recordings: Sequence[tuple[Floats, float]],
    prior: PosturePrior,
    parameters: TrackingParameters,
) -> MotionNoise:
    """Estimate the scales of movement and marker noise from recordings of a hand.

    Parameters
    ----------
    hand : HandModel
        The calibrated hand.
    recordings : sequence of (ndarray of shape (n_frames, n_markers, 3), float)
        Marker positions [m], NaN where not seen, and frames per second [Hz].
    prior : PosturePrior
        Where joints usually are.
    parameters : TrackingParameters
        The scales to start from, which are also the middle of their priors.

    Returns
    -------
    MotionNoise
        The scales; the assumed ones where no stretch of a recording shows the hand.
    """
    assumed = MotionNoise.assumed(parameters)
    kinematics = Kinematics(hand)
    windows = _choose_windows(kinematics, recordings, prior, parameters)
    if not windows:
        return assumed
    middle = np.log(astuple(assumed))

    def negative(scales: Floats) -> tuple[float, Floats]:
        noise = MotionNoise(*np.exp(scales))
        models = {step: _models(hand, prior, noise, step) for step in {window.step for window in windows}}
        parts = [_likelihood(kinematics, window, prior, noise, *models[window.step]) for window in windows]
        away = (scales - middle) / SCALE_SD
        value = away @ away / 2 - sum(value for value, _ in parts)
        return float(value), away / SCALE_SD - sum(score for _, score in parts)

    bounds = [(m - REACH * SCALE_SD, m + REACH * SCALE_SD) for m in middle]
    bounds[-1] = (float(np.log(SLOW_SD)), bounds[-1][1])
    found = minimize(
        negative,
        middle,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxfun": MAXIMUM_EVALUATIONS, "ftol": 1e-4},
    )
    return MotionNoise(*np.exp(found.x).tolist())


def _choose_windows(
    kinematics: Kinematics,
    recordings: Sequence[tuple[Floats, float]],
    prior: PosturePrior,
    parameters: TrackingParameters,
) -> list[_Window]:
    """Return windows spread over all recordings as evenly as may be, their faulty markers left out.

    Multiples of the golden ratio fall into rest and movement alike, however long a trial's phases are.
    """
    sd = np.full(len(kinematics.hand.markers), parameters.marker_sd)
    if not recordings:
        return []
    durations = np.array([len(markers) / rate for markers, rate in recordings])
    ends = np.cumsum(durations)
    windows = []
    for number in range(WINDOWS):
        time = ends[-1] * (0.5 + number * GOLDEN) % ends[-1]
        which = int(np.searchsorted(ends, time, side="right"))
        markers, rate = recordings[which]
        stride = max(1, round(rate / WINDOW_RATE))
        length = round(WINDOW_TIME * rate)
        first = min(round((time - ends[which] + durations[which]) * rate), max(0, len(markers) - length))
        part = markers[first : first + length : stride]
        enough = visible(part).sum(axis=1) >= parameters.minimum_start_markers
        if enough.any():
            part = np.ascontiguousarray(part[int(np.argmax(enough)) :], dtype=float)
            start = fit_frame(kinematics, part[0], prior, sd)
            windows.append(_Window(part, stride / rate, start.q))
    noise = MotionNoise.assumed(parameters)
    gated = (_without_faults(kinematics, window, prior, noise, parameters.gate) for window in windows)
    return [window for window in gated if visible(window.markers).mean() > MINIMUM_KEPT]


def _without_faults(
    kinematics: Kinematics, window: _Window, prior: PosturePrior, noise: MotionNoise, gate: float
) -> _Window:
    """Return the window with the markers that do not pass the gate taken out, so that none needs it later."""
    kept = window.markers.copy()
    motion = motion_model(kinematics.hand, prior, noise, window.step)
    filter_ = _filter(kinematics, motion, prior, noise, gate)
    state = filter_.start(window.start)
    for i, observed in enumerate(window.markers):
        update = filter_.update(filter_.predict(state) if i else state, observed, gated=i > 0)
        kept[i, ~update.used] = np.nan
        state = update.state
    return _Window(kept, window.step, window.start)


def _filter(
    kinematics: Kinematics, motion: MotionModel, prior: PosturePrior, noise: MotionNoise, gate: float
) -> HandFilter:
    return HandFilter(kinematics, motion, prior, np.full(len(kinematics.hand.markers), noise.marker_sd), gate)


def _models(
    hand: HandModel, prior: PosturePrior, noise: MotionNoise, step: float
) -> tuple[MotionModel, Perturbed]:
    """Return the process model of some scales, and those with each scale of movement perturbed in turn."""
    logs, perturbed = np.log(astuple(noise)), []
    for i in range(len(logs) - 1):
        moved = logs.copy()
        moved[i] += PERTURBATION
        perturbed.append(motion_model(hand, prior, MotionNoise(*np.exp(moved)), step))
    models = Perturbed(
        np.array([model.transition for model in perturbed]),
        np.array([model.noise_blocks for model in perturbed]),
    )
    return motion_model(hand, prior, noise, step), models


def _likelihood(
    kinematics: Kinematics,
    window: _Window,
    prior: PosturePrior,
    noise: MotionNoise,
    motion: MotionModel,
    perturbed: Perturbed,
) -> tuple[float, Floats]:
    """Return the log likelihood of a window and its derivatives by the logarithms of the scales."""
    filter_ = _filter(kinematics, motion, prior, noise, gate=1.0)
    stationary = to_blocks(motion.stationary)
    return likelihood(
        filter_.setting, filter_.placed, window.start, stationary, window.markers, NO_READINGS, perturbed
    )
