"""Statistics of episodes in the form of LeRobot: of each episode, then weighted by its length.

Quantiles of a whole data set are there the means of those of its episodes, weighted by their lengths; the
same is done here, so that they can be compared.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FeatureStatistics = dict[str, Floats]
Statistics = dict[str, FeatureStatistics]

QUANTILES: Final = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
STATISTICS: Final = ("min", "max", "mean", "std", "count", *QUANTILES)
"""Names of the statistics of a feature; all but the count have as many numbers as the feature."""


def episode_statistics(columns: Mapping[str, NDArray[np.generic]]) -> Statistics:
    """Return the statistics of each feature of an episode.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (n,) or (n, k)
        Values of a feature, a row a step.

    Returns
    -------
    dict of str to dict of str to ndarray
        Feature -> statistic -> numbers, shape (k,), or (1,) for a count.
    """
    found: Statistics = {}
    # Features of one type at once: of many narrow ones each step would cost more than its work.
    for kind in dict.fromkeys(values.dtype for values in columns.values()):
        names = [name for name, values in columns.items() if values.dtype == kind]
        rows = [np.atleast_2d(columns[name].T) for name in names]
        ends = np.cumsum([len(part) for part in rows])
        joined = _statistics(np.concatenate(rows))
        count = joined.pop("count")
        for name, end, part in zip(names, ends, rows, strict=True):
            own = {statistic: numbers[end - len(part) : end] for statistic, numbers in joined.items()}
            found[name] = {**own, "count": count}
    return {name: found[name] for name in columns}


def _statistics(rows: NDArray[np.generic]) -> FeatureStatistics:
    """Return the statistics of numbers, shape (k, n)."""
    # Along rows that are contiguous, sorting is several times as fast.
    numbers = np.sort(np.ascontiguousarray(rows), axis=1).astype(float)
    n = numbers.shape[1]
    place = np.array(list(QUANTILES.values())) * (n - 1)
    below = np.floor(place).astype(int)
    above = np.minimum(below + 1, n - 1)
    quantiles = numbers[:, below] + (place - below) * (numbers[:, above] - numbers[:, below])
    mean = numbers.mean(axis=1)
    about = numbers - mean[:, None]
    return {
        "min": numbers[:, 0],
        "max": numbers[:, -1],
        "mean": mean,
        "std": np.sqrt(np.einsum("ij,ij->i", about, about) / n),
        "count": np.array([float(n)]),
        **dict(zip(QUANTILES, quantiles.T, strict=True)),
    }


class RunningStatistics:
    """Statistics of a data set, from those of its episodes, a batch at a time."""

    def __init__(self) -> None:
        self._whole: FeatureStatistics = {}

    def add(self, batch: FeatureStatistics) -> None:
        """Add the statistics of a feature in some episodes.

        Parameters
        ----------
        batch : dict of str to ndarray, shape (n_episodes, k), or (n_episodes, 1) for counts
            Statistic -> a row an episode.
        """
        if self._whole:
            batch = {name: np.vstack([self._whole[name], values]) for name, values in batch.items()}
        counts = batch["count"]
        total = counts.sum(axis=0, keepdims=True)
        whole = {
            name: (batch[name] * counts).sum(axis=0, keepdims=True) / total for name in ("mean", *QUANTILES)
        }
        # Chan, Golub and LeVeque (1983, The American Statistician 37, 242): variances of parts, joined.
        joined = (batch["std"] ** 2 + (batch["mean"] - whole["mean"]) ** 2) * counts
        self._whole = {
            **whole,
            "std": np.sqrt(joined.sum(axis=0, keepdims=True) / total),
            "min": batch["min"].min(axis=0, keepdims=True),
            "max": batch["max"].max(axis=0, keepdims=True),
            "count": total,
        }

    def values(self) -> FeatureStatistics:
        """Return the statistics of all that was added, each of shape (k,)."""
        return {name: self._whole[name][0] for name in STATISTICS}
