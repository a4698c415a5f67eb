"""Read an hdf5 export with robomimic: every window of every demonstration, by side of the split too.

Runs in an environment of its own: python tests/exports/check_robomimic.py FOLDER
"""

import sys
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import robomimic.utils.file_utils as file_utils
import robomimic.utils.obs_utils as obs_utils
from robomimic.utils.dataset import SequenceDataset

OBSERVED = ("state", "environment_state")
WINDOW = 10


def dataset(path: Path, side: str | None) -> SequenceDataset:
    """Return the windows of one side, or of all."""
    return SequenceDataset(
        str(path),
        obs_keys=OBSERVED,
        dataset_keys=("actions", "rewards", "dones"),
        seq_length=WINDOW,
        hdf5_cache_mode="low_dim",
        filter_by_attribute=side,
    )


def main() -> None:
    """Check a folder and say what was found."""
    path = Path(sys.argv[1]) / "demos.hdf5"
    obs_utils.initialize_obs_utils_with_obs_specs([{"obs": {"low_dim": list(OBSERVED)}}])
    assert file_utils.get_env_metadata_from_dataset(str(path))["env_name"] == "graspdb"
    windows = dataset(path, None)
    with h5py.File(path) as file:
        assert len(windows) == file["data"].attrs["total"]
        for i in range(len(windows)):
            demo = windows._index_to_demo_id[i]
            start = i - windows._demo_id_to_start_indices[demo]
            there = file[f"data/{demo}/actions"][start : start + WINDOW]
            window = windows[i]
            np.testing.assert_array_equal(window["actions"][: len(there)], there)
            assert window["obs"]["state"].shape[0] == WINDOW
            assert np.isfinite(window["next_obs"]["environment_state"]).all()
        sides = {side: [name.decode() for name in file[f"mask/{side}"]] for side in file.get("mask", ())}
    for side, demos in sides.items():
        assert dataset(path, side).demos == demos
    found = f"{windows.n_demos} demonstrations, every one of {len(windows)} windows"
    print(f"robomimic {version('robomimic')}: {found}, sides: {' and '.join(sides) or 'none'}")


if __name__ == "__main__":
    main()
