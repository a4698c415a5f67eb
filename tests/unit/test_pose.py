"""The object's pose from its markers: exact where they fix it, absent where they do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.pose import track_object
from graspdb_ingest.rigid import transform_points
from graspdb_schemas.errors import ParameterError

MODEL = np.array([[0.0, 0, 0], [0.08, 0, 0.01], [0.02, 0.06, 0], [0, 0.03, 0.09], [0.05, 0.05, 0.05]])
N = 60


def moving_markers(seed: int, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rotations, positions and noisy markers of an object that turns and travels."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(np.linspace(0, 1, N)[:, None] * rng.normal(size=3) * 4)
    rotations = (turn * Rotation.random(rng=rng)).as_matrix()
    positions = np.linspace(rng.normal(size=3), rng.normal(size=3), N)
    markers = transform_points(rotations, positions, MODEL)
    return rotations, positions, markers + noise * rng.normal(size=markers.shape)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_pose_is_exact_with_any_three_markers(seed: int) -> None:
    rotations, positions, markers = moving_markers(seed)
    rng = np.random.default_rng(seed)
    for frame in range(N):
        markers[frame, rng.choice(5, size=rng.integers(0, 3), replace=False)] = np.nan
    track = track_object(markers, MODEL)
    assert track.rotations == pytest.approx(rotations, abs=1e-6)
    assert track.positions == pytest.approx(positions, abs=1e-7)
    assert track.residuals == pytest.approx(0, abs=1e-7)
    assert np.array_equal(track.n_markers, np.isfinite(markers[..., 0]).sum(axis=1))
    assert (np.sum(track.quaternions[1:] * track.quaternions[:-1], axis=1) > 0.9).all()
    assert not track.left_out.any()


def test_fewer_than_three_markers_give_no_pose() -> None:
    _, _, markers = moving_markers(1)
    markers[10, 2:] = np.nan
    markers[11] = np.nan
    markers[12, :, 1] = np.nan
    track = track_object(markers, MODEL)
    assert np.flatnonzero(~track.known).tolist() == [10, 11, 12]
    for field in (track.positions, track.rotations, track.quaternions, track.residuals):
        assert np.isnan(field[10:13]).all()
    assert track.n_markers[9:14].tolist() == [5, 2, 0, 0, 5]


def test_collinear_markers_give_no_pose_even_with_noise() -> None:
    rng = np.random.default_rng(2)
    model = np.array([[0.0, 0, 0], [0.05, 0, 0], [0.12, 0, 0], [0.02, 0.07, 0]])
    markers = np.repeat(model[None], 20, axis=0) + 0.0005 * rng.normal(size=(20, 4, 3))
    markers[5:9, 3] = np.nan
    track = track_object(markers, model)
    assert np.flatnonzero(~track.known).tolist() == [5, 6, 7, 8]
    assert track.n_markers[5] == 3


@pytest.mark.parametrize("marker", range(5))
@pytest.mark.parametrize("hidden", [None, 0, 4])
def test_a_marker_that_jumps_is_left_out_and_counted(marker: int, hidden: int | None) -> None:
    rotations, positions, markers = moving_markers(3, noise=0.0003)
    markers[20:30, marker] += [0.03, -0.02, 0.025]
    if hidden is not None and hidden != marker:
        markers[:, hidden] = np.nan
    track = track_object(markers, MODEL)
    expected = np.zeros((N, 5), dtype=bool)
    expected[20:30, marker] = True
    assert np.array_equal(track.left_out, expected)
    assert np.linalg.norm(track.positions - positions, axis=1).max() < 0.003
    assert np.abs(track.rotations - rotations).max() < 0.05
    assert track.n_markers[25] == track.n_markers[10] - 1


def test_noise_alone_leaves_no_marker_out() -> None:
    _, positions, markers = moving_markers(4, noise=0.001)
    track = track_object(markers, MODEL)
    assert not track.left_out.any()
    assert track.known.all()
    assert 0.0005 < np.median(track.residuals) < 0.002
    assert np.linalg.norm(track.positions - positions, axis=1).max() < 0.006


def test_markers_that_are_not_the_objects_give_no_pose() -> None:
    _, _, markers = moving_markers(5)
    markers[30:33] = markers[30:33, [1, 0, 3, 2, 4]]
    track = track_object(markers, MODEL)
    assert np.flatnonzero(~track.known).tolist() == [30, 31, 32]
    assert (track.residuals[30:33] > 0.02).all()


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ParameterError, match=r"markers.*\(4, 5, 3\).*3"):
        track_object(np.zeros((4, 5, 3)), np.zeros((3, 3)))
    with pytest.raises(ParameterError, match="model"):
        track_object(np.zeros((4, 3, 3)), np.full((3, 3), np.nan))


def test_a_trial_without_frames_has_an_empty_track() -> None:
    track = track_object(np.zeros((0, 5, 3)), MODEL)
    assert track.positions.shape == (0, 3)
    assert track.quaternions.shape == (0, 4)
