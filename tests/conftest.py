"""Where tests find recordings that are not part of the repository."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real recordings: GRASPDB_TEST_DATA, or ../shared/data beside the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("GRASPDB_TEST_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"needs the recordings in {folder}; GRASPDB_TEST_DATA may name another folder")
    return folder
