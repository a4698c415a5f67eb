"""Read a zarr export with release 2 of zarr, as diffusion policy does: what its replay buffer asserts.

Runs in an environment of its own: python tests/exports/check_zarr.py FOLDER
"""

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import zarr


def main() -> None:
    """Check a folder and say what was found."""
    root = zarr.open(str(Path(sys.argv[1]) / "replay_buffer.zarr"), mode="r")
    ends = root["meta"]["episode_ends"][:]
    assert ends.dtype == np.int64
    assert (np.diff(ends, prepend=0) >= 2).all()
    for name, array in root["data"].items():
        values = array[:]
        assert values.shape[0] == ends[-1], name
        assert np.isfinite(values).all(), name
    state, action = root["data"]["state"][:], root["data"]["action"][:]
    inside = np.setdiff1d(np.arange(len(state)), ends - 1)
    np.testing.assert_array_equal(action[inside], state[inside + 1])
    print(f"zarr {version('zarr')}: {len(ends)} episodes, {ends[-1]} steps of {', '.join(root['data'])}")


if __name__ == "__main__":
    main()
