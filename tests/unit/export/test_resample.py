"""Other times of a path: frames where they are frames, even turns, nothing across what is not known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_trials import turning
from scipy.spatial.transform import Rotation

from graspdb.export.resample import rotated, sample, straight

rates = st.integers(1, 240)


@given(rate=rates, fps=rates, n=st.integers(2, 300))
def test_times_are_even_and_within_the_recording(rate: int, fps: int, n: int) -> None:
    time = 2.5 + np.arange(n) / rate
    samples = sample(time, fps)
    new = straight(time, samples)
    # A time within a thousandth of a frame is the frame's.
    np.testing.assert_allclose(new - 2.5, np.arange(len(new)) / fps, rtol=0, atol=1.1e-3 / rate)
    assert new[-1] <= time[-1]
    assert time[-1] - new[-1] < 1 / fps


@given(factor=st.integers(1, 8), n=st.integers(2, 100))
def test_a_whole_fraction_of_the_rate_takes_the_frames_themselves(factor: int, n: int) -> None:
    time = np.arange(n) / (30.0 * factor)
    values = np.random.default_rng(n).normal(size=(n, 3))
    np.testing.assert_array_equal(straight(values, sample(time, 30)), values[::factor])


def test_a_rate_written_with_rounding_loses_no_frame() -> None:
    # As a file of motion has it that says 0.008333334 seconds a frame.
    time = np.arange(4000) * 0.008333334
    samples = sample(time, 120)
    np.testing.assert_array_equal(samples.before, np.arange(4000))
    assert samples.are_frames


@pytest.mark.parametrize("fps", [7, 30, 64, 100, 144])
def test_an_even_turn_stays_even(fps: int) -> None:
    time = np.arange(101) / 100
    samples = sample(time, fps)
    turned = rotated(turning(101, 100.0, 1, 5.0), samples)
    expected = turning(len(turned), float(fps), 1, 5.0)
    np.testing.assert_allclose(turned, expected, atol=1e-3 * 5.0 / 100)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1, atol=1e-12)


def test_signs_of_quaternions_do_not_matter_but_the_first() -> None:
    rng = np.random.default_rng(3)
    path = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.2, (60, 3)), axis=0)).as_quat(scalar_first=True)
    samples = sample(np.arange(60) / 60.0, 25)
    signs = np.where(rng.uniform(size=(60, 1)) < 0.5, -1.0, 1.0)
    signs[0] = 1.0
    turned = rotated(path * signs, samples)
    np.testing.assert_allclose(turned, rotated(path, samples), atol=1e-12)
    assert (np.sum(turned[1:] * turned[:-1], axis=1) > 0).all()
    np.testing.assert_array_equal(turned[0], path[0])


def test_nothing_is_made_up_across_what_is_not_known() -> None:
    time = np.arange(10) / 10.0
    values, turn = np.arange(10.0)[:, None], turning(10, 10.0, 0, 1.0)
    values[4] = turn[4] = np.nan
    samples = sample(time, 20)
    known = np.isfinite(straight(values, samples)[:, 0])
    # Times 0.35, 0.4 and 0.45 need the frame at 0.4; those at 0.3 and 0.5 are frames.
    np.testing.assert_array_equal(np.flatnonzero(~known), [7, 8, 9])
    np.testing.assert_array_equal(np.isfinite(rotated(turn, samples)).all(axis=1), known)
