"""The distance of descriptors: principal components of what the database holds, evened out by half.

Nothing of it is stored. It follows from the descriptors of a snapshot, at most 20,000 of them, chosen by
the digest of their keys; so it is the same for whoever opens that snapshot, and grows with the database.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vectors = NDArray[np.float32]

BLOCKS: Final = ((128, 1.0), (300, 0.6))
"""Length of each part of a descriptor, and its weight in the squared distance."""

COMPONENTS: Final = 64
"""Principal components kept of each part."""

EVENED: Final = 0.5
"""Power of the deviations that components are divided by: 0 leaves them, 1 makes all equal."""

LEAST_LEARNED: Final = 64
"""Fewer features than this say too little of how features vary; then descriptors count as they are."""

MOST_LEARNED: Final = 20_000


@dataclass(frozen=True, eq=False)
class Metric:
    """A map of descriptors to vectors whose Euclidean distance compares features.

    Attributes
    ----------
    offset : ndarray, shape (n,)
        Taken from a descriptor first.
    projection : ndarray, shape (n, d)
        Linear map of the rest.
    learned_from : int
        Number of features that it follows from; zero where there were too few.
    """

    offset: Floats
    projection: Floats
    learned_from: int

    @property
    def length(self) -> int:
        """Numbers in a vector."""
        return int(self.projection.shape[1])

    def vectors(self, descriptors: Vectors) -> Vectors:
        """Return the vectors of descriptors, float32, shape (n, d).

        Every row is computed by itself, in double precision, so that it does not depend on its neighbours.
        """
        centred = descriptors.astype(np.float64) - self.offset
        return np.asarray(np.einsum("ni,id->nd", centred, self.projection, optimize=False), dtype=np.float32)


def learn_metric(descriptors: Vectors) -> Metric:
    """Return the metric of a sample of descriptors, shape (n, 428).

    Each part is scaled so that the mean squared distance of its vectors from their mean is its weight.
    """
    n = len(descriptors)
    if n < LEAST_LEARNED:
        weights = np.concatenate([np.full(length, np.sqrt(weight)) for length, weight in BLOCKS])
        return Metric(np.zeros(len(weights)), np.diag(weights), 0)
    offset = descriptors.mean(axis=0, dtype=np.float64)
    parts, start = [], 0
    for length, weight in BLOCKS:
        block = descriptors[:, start : start + length].astype(np.float64) - offset[start : start + length]
        spread, axes = np.linalg.eigh(block.T @ block / n)
        kept = np.flatnonzero(spread > 1e-9 * max(spread[-1], 1e-30))[::-1][:COMPONENTS]
        if len(kept):
            scale = spread[kept] ** (-EVENED / 2)
            total = float(np.sum(spread[kept] * scale**2))
            part = np.zeros((len(offset), len(kept)))
            part[start : start + length] = axes[:, kept] * scale * np.sqrt(weight / total)
            parts.append(part)
        start += length
    return Metric(offset, np.concatenate(parts, axis=1) if parts else np.eye(len(offset)), n)
