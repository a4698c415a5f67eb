"""Runs of frames, against going through them one by one."""

import numpy as np
import pytest

from graspdb_ingest.runs import lasting


@pytest.mark.parametrize("shortest", [1, 2, 3, 4, 7, 40])
@pytest.mark.parametrize("share", [0.2, 0.8, 0.97])
def test_lasting_runs_are_those_of_enough_frames_one_after_the_other(shortest: int, share: float) -> None:
    mask = np.random.default_rng(shortest).random((60, 5)) < share
    expected = np.zeros_like(mask)
    for column, found in zip(mask.T, expected.T, strict=True):
        for start in range(len(column) - shortest + 1):
            if column[start : start + shortest].all():
                found[start : start + shortest] = True
    assert np.array_equal(lasting(mask, shortest), expected)
