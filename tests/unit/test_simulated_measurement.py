"""What the simulated measurement does to markers has the statistics that its parameters say."""

import numpy as np
import pytest

from graspdb.simulate.measurement import NoiseParameters, bursts, measure, skin_movement, slow_drift
from graspdb_schemas.errors import ParameterError

LABELS = tuple(f"m{i}" for i in range(24))
RATE = 120.0


def still(n_frames: int = 2000) -> np.ndarray:
    places = np.random.default_rng(9).uniform(0, 0.2, (24, 3))
    return np.repeat(places[None], n_frames, axis=0)


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_a_perfect_measurement_changes_nothing():
    true = still()
    measured = measure(true, LABELS, NoiseParameters.none(), RATE, rng())
    assert np.array_equal(measured.positions, true)
    assert not measured.occluded.any()
    assert measured.swaps == ()


def test_white_noise_has_its_standard_deviation_on_every_axis_and_no_memory():
    noise = NoiseParameters(marker_sd=0.001, skin_sd=0, occlusion=0)
    error = measure(still(), LABELS, noise, RATE, rng()).positions - still()
    assert error.std(axis=(0, 1)) == pytest.approx(0.001, rel=0.03)
    assert np.abs(error.mean(axis=(0, 1))).max() < 3e-5
    assert abs(np.mean(error[1:] * error[:-1])) < 0.02 * 0.001**2


@pytest.mark.parametrize("share", [0.02, 0.2, 0.5])
def test_the_share_occluded_and_its_bursts_are_as_asked(share):
    noise = NoiseParameters(occlusion=share, occlusion_burst=(0.1, 0.4))
    occluded = bursts((40_000, 24), noise, RATE, rng())
    assert occluded.mean() == pytest.approx(share, rel=0.12)
    edges = np.diff(occluded.astype(int), axis=0)
    n_bursts = (edges == 1).sum()
    # Neighbouring bursts that meet count as one, so the mean is a little above (0.1 + 0.4) / 2 s.
    assert occluded.sum() / n_bursts / RATE == pytest.approx(0.25, rel=0.1)


def test_occluded_positions_are_missing_and_all_others_are_there():
    measured = measure(still(), LABELS, NoiseParameters(occlusion=0.2), RATE, rng())
    assert np.array_equal(np.isnan(measured.positions).all(axis=2), measured.occluded)
    assert np.array_equal(np.isnan(measured.positions).any(axis=2), measured.occluded)


def test_swapped_labels_exchange_two_markers_for_a_stretch_and_nothing_else():
    noise = NoiseParameters(marker_sd=0, skin_sd=0, occlusion=0, swaps=6)
    true = still()
    measured = measure(true, LABELS, noise, RATE, rng())
    assert len(measured.swaps) >= 2
    mended = measured.positions.copy()
    for swap in measured.swaps:
        assert 0.1 * RATE - 1 <= swap.stop - swap.start <= 0.5 * RATE + 1
        pair = [LABELS.index(swap.first), LABELS.index(swap.second)]
        frames = slice(swap.start, swap.stop)
        assert not np.array_equal(measured.positions[frames, pair], true[frames, pair])
        mended[frames, pair] = mended[frames, pair[::-1]]
    assert np.array_equal(mended, true)


def test_slow_drift_has_variance_one_and_is_slow():
    drift = slow_drift((20_000, 30), 40.0, rng())
    assert drift.std() == pytest.approx(1, rel=0.05)
    assert np.diff(drift, axis=0).std() < 0.03


def test_skin_slides_within_the_skin_as_far_as_asked():
    n_frames, n_markers = 30_000, 24
    axes = np.zeros((n_frames, n_markers, 3, 2))
    axes[..., 0, 0] = axes[..., 1, 1] = 1
    limits = np.tile([-0.5, 1.5], (n_markers, 1))
    angles = np.random.default_rng(1).uniform(-0.5, 1.5, (n_frames, n_markers))
    noise = NoiseParameters(skin_sd=0.002, skin_angle_share=0.0)
    moved = skin_movement(axes, angles, limits, noise, RATE, rng())
    assert np.array_equal(moved[..., 2], np.zeros((n_frames, n_markers)))
    assert moved[..., :2].std() == pytest.approx(0.002, rel=0.05)


def test_the_share_that_follows_joint_angles_does():
    n_frames, n_markers = 4000, 200
    axes = np.zeros((n_frames, n_markers, 3, 2))
    axes[..., 0, 0] = axes[..., 1, 1] = 1
    limits = np.tile([-0.5, 1.5], (n_markers, 1))
    angles = np.random.default_rng(1).uniform(-0.5, 1.5, (n_frames, n_markers))
    moved = skin_movement(
        axes, angles, limits, NoiseParameters(skin_sd=0.002, skin_angle_share=1), RATE, rng()
    )
    assert moved[..., :2].std() == pytest.approx(0.002, rel=0.1)
    centred = moved - moved.mean(axis=0)
    pull = angles - angles.mean(axis=0)
    correlation = np.abs(np.mean(centred[..., 0] * pull, axis=0)) / (centred[..., 0].std(0) * pull.std(0))
    assert correlation.min() > 0.999


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("marker_sd", -0.001),
        ("occlusion", 0.95),
        ("occlusion", float("nan")),
        ("skin_angle_share", 1.5),
        ("occlusion_burst", (0.5, 0.1)),
        ("swap_duration", (0.0, 0.1)),
    ],
)
def test_impossible_parameters_are_refused_by_name(key, value):
    with pytest.raises(ParameterError, match=key):
        NoiseParameters(**{key: value})
