"""Where tests find recordings that are not part of the repository."""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

# pytest runs a process a core already; in it, one worker follows trials unless a test says otherwise.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")

# A shell starts its background jobs with Ctrl-C ignored, and with that a test of an interrupt never ends.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples on every run, and no limit of time, which a busy machine would break.
settings.register_profile("graspdb", derandomize=True, deadline=None)
settings.load_profile("graspdb")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real recordings: GRASPDB_TEST_DATA, or ../shared/data beside the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("GRASPDB_TEST_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"needs the recordings in {folder}; GRASPDB_TEST_DATA may name another folder")
    return folder
