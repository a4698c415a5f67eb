"""C3D files that keep ezc3d busy or end it are refused, and the next one is read."""

import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import recording_files as write

from graspdb_ingest.readers import c3d_process
from graspdb_ingest.readers.c3d_process import read_content
from graspdb_schemas.errors import RecordingError

LABELS = ["a", "b"]
POSITIONS = np.random.default_rng(5).uniform(10, 500, (20, 2, 3))


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """Return a file that nobody ever writes to: reading it does not come to an end."""
    file = tmp_path / "endless.c3d"
    os.mkfifo(file)
    return file


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return write.write_c3d(tmp_path / "good.c3d", LABELS, POSITIONS, 100.0)


def test_content_is_what_was_written(good: Path) -> None:
    content = read_content(good)
    np.testing.assert_allclose(content.points, POSITIONS, rtol=1e-6)
    assert content.residuals.shape == (20, 2)
    assert content.values("POINT", "LABELS") == LABELS
    assert content.values("POINT", "NONE") == ()
    content.points[0] = 0  # arrays are the reader's own


def test_a_file_without_end_is_given_up(endless: Path, good: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c3d_process, "_SECONDS", 0.5)
    with pytest.raises(RecordingError, match="busy without end"):
        read_content(endless)
    monkeypatch.undo()
    assert len(read_content(good).points) == 20


def test_a_crash_is_a_refusal(endless: Path, good: Path) -> None:
    read_content(good)
    process = c3d_process._CHILD._process
    assert process is not None

    def crash() -> None:
        time.sleep(0.2)
        process.send_signal(signal.SIGSEGV)

    thread = threading.Thread(target=crash)
    thread.start()
    with pytest.raises(RecordingError, match="makes ezc3d crash"):
        read_content(endless)
    thread.join()
    assert len(read_content(good).points) == 20


def test_memory_for_a_file_has_a_limit(good: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    large = write.write_c3d(good.parent / "large.c3d", LABELS, np.tile(POSITIONS, (1000, 1, 1)), 100.0)
    monkeypatch.setattr(c3d_process, "_MEMORY", 1 << 20)
    with pytest.raises(RecordingError):
        read_content(large)
    monkeypatch.undo()
    assert len(read_content(good).points) == 20
