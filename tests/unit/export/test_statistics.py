"""Statistics of episodes against numpy's, and of all of them against those of all steps."""

import numpy as np
import pytest

from graspdb.export.statistics import QUANTILES, STATISTICS, RunningStatistics, episode_statistics


def test_statistics_of_an_episode_are_those_of_numpy() -> None:
    rng = np.random.default_rng(0)
    columns = {
        "vector": rng.normal(2, 3, (57, 4)).astype(np.float32),
        "other": rng.normal(size=(57, 2)).astype(np.float32),
        "index": np.arange(57),
        "truth": rng.uniform(size=57) < 0.3,
    }
    found = episode_statistics(columns)
    assert list(found) == list(columns)
    for name, values in columns.items():
        rows = values.reshape(57, -1).astype(float)
        assert set(found[name]) == set(STATISTICS)
        assert found[name]["count"] == [57]
        np.testing.assert_allclose(found[name]["mean"], rows.mean(axis=0), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(found[name]["std"], rows.std(axis=0), rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(found[name]["min"], rows.min(axis=0))
        np.testing.assert_array_equal(found[name]["max"], rows.max(axis=0))
        for quantile, share in QUANTILES.items():
            np.testing.assert_allclose(found[name][quantile], np.quantile(rows, share, axis=0), atol=1e-12)


@pytest.mark.parametrize("batches", [[9], [1] * 9, [4, 5]])
def test_statistics_of_all_steps_do_not_depend_on_batches(batches: list[int]) -> None:
    rng = np.random.default_rng(1)
    episodes = [rng.normal(i, 1 + i, (20 + 7 * i, 3)) for i in range(9)]
    each = [episode_statistics({"x": episode})["x"] for episode in episodes]
    running = RunningStatistics()
    start = 0
    for size in batches:
        some = each[start : start + size]
        running.add({name: np.stack([one[name] for one in some]) for name in STATISTICS})
        start += size
    whole, found = np.concatenate(episodes), running.values()
    np.testing.assert_allclose(found["mean"], whole.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(found["std"], whole.std(axis=0), rtol=1e-12)
    np.testing.assert_array_equal(found["min"], whole.min(axis=0))
    np.testing.assert_array_equal(found["max"], whole.max(axis=0))
    assert found["count"] == [len(whole)]
    weights = [len(episode) for episode in episodes]
    medians = np.average([one["q50"] for one in each], axis=0, weights=weights)
    np.testing.assert_allclose(found["q50"], medians, rtol=1e-12)
