"""Scales of movement: their likelihood's gradient, and their estimate."""

from dataclasses import astuple

import numpy as np
import pytest

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking import noise as noise_module
from graspdb_ingest.tracking.motion import MotionNoise
from graspdb_ingest.tracking.noise import SLOW_SD, estimate_noise
from graspdb_schemas.vocabulary import Side

RATE = 60.0
NOISE = MotionNoise(1.0, 5.0, 0.5, 0.5, 0.5, 0.001)


@pytest.fixture(scope="module")
def hand(hands):
    return hands[Side.RIGHT]


@pytest.fixture(scope="module")
def waving(hand):
    """Return the markers of a hand that waves, with 2 mm of noise."""
    time, prior = np.arange(90) / RATE, default_prior(hand)
    q = np.tile(hand.neutral(), (90, 1))
    q[:, 0] = 0.1 * np.sin(5 * time)
    q[:, 7:] = prior.mean + 0.2 * np.sin(4 * time)[:, None]
    markers = hand.forward(q).markers
    return markers + np.random.default_rng(2).normal(0, 0.002, markers.shape)


def test_gradient_of_the_likelihood_is_its_slope(hand, waving):
    kinematics, prior = Kinematics(hand), default_prior(hand)
    windows = noise_module._choose_windows(kinematics, [(waving, RATE)], prior, TrackingParameters())

    def likelihood(logs):
        noise = MotionNoise(*np.exp(logs))
        models = noise_module._models(hand, prior, noise, windows[0].step)
        return noise_module._likelihood(kinematics, windows[0], prior, noise, *models)

    logs = np.log(astuple(NOISE))
    _, score = likelihood(logs)
    for i, step in enumerate(1e-3 * np.eye(len(logs))):
        slope = (likelihood(logs + step)[0] - likelihood(logs - step)[0]) / 2e-3
        # The first frame's prior moves with the time scales too; that part is left out.
        assert score[i] == pytest.approx(slope, rel=0.3 if i in (2, 3, 4) else 0.02, abs=4.0)


def test_marker_noise_is_found(hand, waving):
    found = estimate_noise(hand, [(waving, RATE)], default_prior(hand), TrackingParameters())
    assert found.marker_sd == pytest.approx(0.002, rel=0.15)


def test_marker_noise_is_never_believed_to_be_less_than_skin_movement(hand):
    prior = default_prior(hand)
    still = np.tile(hand.forward(hand.neutral()).markers, (90, 1, 1))
    assert estimate_noise(hand, [(still, RATE)], prior, TrackingParameters()).marker_sd >= 0.999 * SLOW_SD


def test_without_recordings_the_assumed_scales_stand(hand):
    parameters = TrackingParameters()
    assert estimate_noise(hand, [], default_prior(hand), parameters) == MotionNoise.assumed(parameters)
