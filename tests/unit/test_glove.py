"""A data glove beside markers: which sensor is which joint, its offset, noise and clock, hidden digits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graspdb_ingest.glove_angles import GloveAngles, select_glove
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import GloveParameters, TrackingParameters
from graspdb_ingest.readers.glove import GloveRecording
from graspdb_ingest.recording import Recording
from graspdb_ingest.tracking.correction import JointReadings
from graspdb_ingest.tracking.glove import correlation_length, fit_glove
from graspdb_ingest.tracking.tracker import track_hand
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.vocabulary import JOINT_ANGLES, SITES, Side

RATE, N = 120.0, 600
TIMES = np.arange(N) / RATE
PARAMETERS = GloveParameters()


def moving(hand, rng) -> Floats:
    """Return joint angles that swing about the middle of their ranges, shape (N, 23)."""
    low, high = hand.joint_range.T
    phase, frequency = rng.uniform(0, 2 * np.pi, len(low)), rng.uniform(0.3, 1.0, len(low))
    swing = np.sin(2 * np.pi * frequency * TIMES[:, None] + phase)
    return (low + high) / 2 + 0.25 * (high - low) * swing


def worn(angles: Floats, offset: Floats, delay: float, noise: Floats, rate: float = 100.0) -> GloveAngles:
    """Return a glove with a sensor on every joint but the wrist's."""
    when = np.arange(0, TIMES[-1], 1 / rate)
    shown = np.stack([np.interp(when - delay, TIMES, column) for column in angles[:, 2:].T], axis=1)
    return GloveAngles(JOINT_ANGLES[2:], np.arange(2, 23), when, shown + offset + noise[: len(when)])


def test_offset_noise_and_delay_are_found_within_their_statistics(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(0)
    angles = moving(hand, rng)
    offset = rng.normal(0, np.deg2rad(6), 21)
    glove = worn(angles, offset, 0.04, np.deg2rad(3) * rng.standard_normal((N, 21)))
    fit = fit_glove(glove, hand, TIMES, angles, np.full_like(angles, 0.01), PARAMETERS)
    assert fit.joints == JOINT_ANGLES[2:]
    assert fit.delay == pytest.approx(0.04, abs=0.003)
    assert np.mean(np.abs(fit.offset - offset) < 2 * fit.offset_sd) > 0.85
    assert np.abs(fit.offset - offset).max() < np.deg2rad(0.7)
    # interpolated between two samples, white noise loses up to half its variance
    assert np.all((fit.sd > np.deg2rad(2)) & (fit.sd < np.deg2rad(3.3)))
    assert np.all(fit.measurement.variance >= fit.sd**2)


def test_a_joint_that_no_marker_shows_keeps_the_usual_spread_and_says_so(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(1)
    angles = moving(hand, rng)
    sd = np.full_like(angles, 0.01)
    sd[:, 5] = 0.5
    glove = worn(angles, np.zeros(21), 0.0, np.zeros((N, 21)))
    fit = fit_glove(glove, hand, TIMES, angles, sd, PARAMETERS)
    unseen = fit.joints.index(JOINT_ANGLES[5])
    assert (fit.offset[unseen], fit.offset_sd[unseen]) == (0.0, PARAMETERS.offset_sd)
    assert fit.measurement.variance[unseen] > 100 * np.median(fit.measurement.variance)


def test_samples_whose_errors_hang_together_count_for_fewer(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(2)
    angles = moving(hand, rng)
    white = np.deg2rad(3) * rng.standard_normal((N, 21))
    slow = np.deg2rad(3) * np.sqrt(2) * np.sin(2 * np.pi * 0.4 * TIMES[:, None] + rng.uniform(0, 6, 21))
    known = np.full_like(angles, 0.01)
    fits = [
        fit_glove(worn(angles, np.zeros(21), 0.0, noise, RATE), hand, TIMES, angles, known, PARAMETERS)
        for noise in (white, slow)
    ]
    assert np.median(fits[1].measurement.variance) > 10 * np.median(fits[0].measurement.variance)
    assert np.median(fits[0].measurement.variance) < 2 * np.deg2rad(3) ** 2


def test_correlation_length_of_white_and_of_autoregressive_noise():
    rng = np.random.default_rng(3)
    white = rng.standard_normal(20_000)
    assert correlation_length(white, 100) == pytest.approx(1, abs=0.1)
    share, slow = 0.8, np.zeros(200_000)
    for i, shock in enumerate(rng.standard_normal(len(slow) - 1)):
        slow[i + 1] = share * slow[i] + shock
    assert correlation_length(slow, 100) == pytest.approx((1 + share) / (1 - share), rel=0.1)
    holes = np.where(rng.random(len(slow)) < 0.3, np.nan, slow)
    assert correlation_length(holes, 100) == pytest.approx(9, rel=0.15)


def test_a_sensor_on_the_wrong_joint_is_left_out_and_named(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(4)
    angles = moving(hand, rng)
    glove = worn(angles, np.zeros(21), 0.0, np.zeros((N, 21)))
    place = glove.joints.index("ring_pip_flexion")
    wrong = glove.angles.copy()
    wrong[:, place] = np.deg2rad(50) * np.sign(np.sin(9 * glove.times))
    fit = fit_glove(replace(glove, angles=wrong), hand, TIMES, angles, np.full_like(angles, 0.01), PARAMETERS)
    assert "ring_pip_flexion" not in fit.joints
    assert len(fit.joints) == 20
    assert any("ring_pip_flexion" in note and "left out" in note for note in fit.notes)


def test_samples_out_of_a_joints_range_are_left_out_and_counted(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(5)
    angles = moving(hand, rng)
    glove = worn(angles, np.zeros(21), 0.0, np.zeros((N, 21)))
    spoiled = glove.angles.copy()
    spoiled[100:150, 3] = np.deg2rad(170)
    fit = fit_glove(
        replace(glove, angles=spoiled), hand, TIMES, angles, np.full_like(angles, 0.01), PARAMETERS
    )
    assert any("out of the joint's range in 1" in note for note in fit.notes)
    assert np.nanmax(fit.measurement.angles[:, 3]) < np.deg2rad(100)


def recording(n: int = N, start: float = 0.0) -> Recording:
    return Recording(Path("m.c3d"), ("a",), np.zeros((n, 1, 3)), RATE, start)


def glove_recording(sensors=("index_pip_flexion",), start=0.0, n=500, own_clock=True) -> GloveRecording:
    times = start + np.arange(n) / 100
    return GloveRecording(Path("g.csv"), tuple(sensors), np.zeros((n, len(sensors))), times, own_clock)


def test_sensors_are_found_by_joint_and_by_side(hands):
    right = {Side.RIGHT: hands[Side.RIGHT]}
    for name in ("index_pip_flexion", "right_index_pip_flexion"):
        picked, notes = select_glove(glove_recording((name, "battery")), recording(), TIMES, right)
        assert picked[Side.RIGHT].joints == ("index_pip_flexion",)
        assert notes == ("columns of the glove that are no joint: battery",)
    picked, _ = select_glove(glove_recording(("left_ring_pip_flexion",)), recording(), TIMES, hands)
    assert tuple(picked) == (Side.LEFT,)


@pytest.mark.parametrize(
    ("glove", "complaint"),
    [
        (glove_recording(("index_pip",)), "names a joint: index_pip; did you mean 'index_pip_flexion'"),
        (glove_recording(("left_index_pip_flexion",)), "names a joint"),
        (glove_recording(start=20.0), "run from 20 to 24.99 s, and the trial from 0 to 4.99167 s"),
        (glove_recording(n=200), "run from 0 to 1.99 s"),
        (glove_recording(n=300, own_clock=False), r"lasts 2.99 s and the recording of the markers 4.99 s"),
    ],
)
def test_a_glove_of_another_hand_or_trial_is_refused(hands, glove, complaint):
    with pytest.raises(RecordingError, match=complaint):
        select_glove(glove, recording(), TIMES, {Side.RIGHT: hands[Side.RIGHT]})


def test_a_glove_without_times_starts_with_the_recording(hands):
    picked, _ = select_glove(
        glove_recording(own_clock=False), recording(start=7.0), TIMES + 7, {Side.RIGHT: hands[Side.RIGHT]}
    )
    assert picked[Side.RIGHT].times[0] == 7.0


def test_resampling_keeps_to_samples_that_are_near():
    times = np.array([0.0, 0.01, 0.02, 0.5, 0.51])
    angles = np.array([[0.0], [1.0], [np.nan], [3.0], [4.0]])
    glove = GloveAngles(("a",), np.array([0]), times, angles)
    got = glove.at(np.array([-0.001, 0.005, 0.015, 0.2, 0.505, 0.6]))[:, 0]
    assert np.allclose(got, [np.nan, 0.5, np.nan, np.nan, 3.5, np.nan], equal_nan=True)
    assert glove.at(np.array([0.0]), delay=0.005)[0, 0] == pytest.approx(0.5)


def test_a_hidden_digit_goes_where_the_glove_says_forward_and_backward(hands):
    """The bar is 4 mm with three degrees of noise; without the glove the tip is far off."""
    hand, rng = hands[Side.RIGHT], np.random.default_rng(6)
    q = np.repeat(hand.neutral()[None], N, axis=0)
    q[:, 7:] = moving(hand, rng)
    true = hand.forward(q)
    markers = true.markers + rng.normal(0, 0.001, true.markers.shape)
    index = [i for i, label in enumerate(hand.markers) if label.startswith("index")]
    hidden = slice(240, 360)
    markers[hidden, index] = np.nan
    prior, tracking = default_prior(hand), TrackingParameters()
    alone = track_hand(hand, markers, RATE, prior, tracking)
    offset = rng.normal(0, np.deg2rad(5), 21)
    glove = worn(q[:, 7:], offset, 0.0, np.deg2rad(3) * rng.standard_normal((N, 21)))
    fit = fit_glove(glove, hand, TIMES, alone.q[:, 7:], alone.q_sd[:, 6:], PARAMETERS)
    helped = track_hand(hand, markers, RATE, prior, tracking, fit.measurement)
    tip = SITES.index("index_tip")
    errors = [np.linalg.norm(t.sites - true.sites, axis=2)[hidden, tip].mean() for t in (alone, helped)]
    assert errors[1] < 0.003
    assert errors[0] > 2 * errors[1]
    seen = np.r_[0:240, 360:N]
    kept = [np.linalg.norm(t.sites - true.sites, axis=2)[seen].mean() for t in (alone, helped)]
    assert kept[1] < 1.1 * kept[0]


def test_a_glove_alone_moves_no_other_joint_than_its_own(hands):
    """A frame with no marker and one angle is still a measurement of that joint."""
    hand = hands[Side.RIGHT]
    q = np.repeat(hand.neutral()[None], 60, axis=0)
    markers = hand.forward(q).markers.copy()
    markers[30:] = np.nan
    hinge = JOINT_ANGLES.index("index_pip_flexion")
    angles = np.full((60, 1), np.deg2rad(60))
    angles[:30] = 0.0
    glove = JointReadings(np.array([hinge]), angles, np.array([np.deg2rad(1) ** 2]))
    track = track_hand(hand, markers, RATE, default_prior(hand), TrackingParameters(), glove)
    assert np.rad2deg(track.q[-1, 7 + hinge]) == pytest.approx(60, abs=5)
