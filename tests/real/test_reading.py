"""Real recordings are read as their sources describe them."""

from pathlib import Path

import numpy as np
import pytest

from graspdb_ingest.check import check_session
from graspdb_ingest.readers import read_recording

FIXTURES = Path(__file__).resolve().parents[1] / "fixtures"

MISSING = {"thumb_tip": 8.2, "middle_tip": 1.3, "ring_tip": 0.7}
"""Share of frames without each marker, in percent, to a tenth; every other marker is always seen."""


def test_the_pillow_recording_has_its_frames_markers_and_gaps(shared_data: Path) -> None:
    recording = read_recording(shared_data / "pillow-recording/recording.tsv", 0.001)
    assert recording.positions.shape == (6000, 21, 3)
    assert (recording.rate, recording.start_time) == (100.0, 0.0)
    shares = 100 * (1 - recording.seen.mean(axis=0))
    for label, share in zip(recording.labels, shares, strict=True):
        assert share == pytest.approx(MISSING.get(label, 0.0), abs=0.05), label


def test_the_plate_on_the_hand_is_rigid(shared_data: Path) -> None:
    recording = read_recording(shared_data / "pillow-recording/recording.tsv", 0.001)
    column = {label: recording.positions[:, i] for i, label in enumerate(recording.labels)}
    distances = []
    for first, second in (("top", "left"), ("top", "right"), ("left", "right")):
        apart = np.linalg.norm(column[f"hand_{first}"] - column[f"hand_{second}"], axis=1)
        assert apart.std() < 0.000125  # 0.12 mm, rounded
        distances.append(1000 * apart.mean())
    np.testing.assert_allclose(sorted(distances, reverse=True), [55.2, 44.7, 32.4], atol=0.06)


def test_the_pillow_session_is_sound(shared_data: Path) -> None:
    report = check_session(FIXTURES / "pillow", shared_data)
    (trial,) = report.trials
    assert report.readable
    assert trial.not_found == ()
    assert len(trial.markers) == 16
    assert trial.warnings == ()
    for entry in trial.distances:
        assert abs(entry.difference) < 0.0001
        assert entry.sd < 0.001


def test_the_hands_of_three_people_are_complete(shared_data: Path) -> None:
    frames = {"User1": 341, "User2": 318, "User3": 500}
    files = sorted((shared_data / "sig18-markers").glob("*.trc"))
    assert len(files) == 4
    for file in files:
        recording = read_recording(file, 1.0)  # the file says millimetres
        assert recording.positions.shape == (frames[file.name.partition("_")[0]], 19, 3)
        assert recording.rate == 120.0
        assert recording.seen.all()
        back = [recording.labels.index(f"BackHand{i}") for i in (1, 2, 3)]
        width = np.linalg.norm(recording.positions[:, back[0]] - recording.positions[:, back[1]], axis=1)
        assert 0.03 < width.mean() < 0.04
        assert width.std() < 0.0035  # about 1.5 mm of noise per axis


def test_the_session_of_three_people_is_sound(shared_data: Path) -> None:
    report = check_session(FIXTURES / "sig18", shared_data)
    assert report.readable
    assert len(report.trials) == 4
    for trial in report.trials:
        assert (len(trial.markers), trial.not_found, trial.unused, trial.warnings) == (19, (), (), ())
