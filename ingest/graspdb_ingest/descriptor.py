"""Descriptor of a graspable feature: what its surface is like, point by point and as a whole.

Two parts, neither of which depends on a pose or on other features, so that a database can grow for ever
without a codebook that ages:

- the mean of random Fourier features of the points' FPFH. With as many of them as we like this is the mean
  map of the distribution of histograms under a Gaussian kernel (Rahimi and Recht 2007, NIPS; Smola et al.
  2007, ALT), which tells distributions apart that mean and deviation do not. The frequencies are a
  low-discrepancy sequence, the same everywhere.
- the distribution of pairs of points over distance, angle of the normals, and bend (after point pair
  features; Wahl et al. 2003, 3DIM). Distances are in metres, so size counts.
"""

from functools import cache, lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist
from scipy.stats import norm, qmc

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import CloudParameters

N_FOURIER: Final = 128
PAIR_BINS: Final = (12, 5, 5)
LENGTH: Final = N_FOURIER + int(np.prod(PAIR_BINS))

BANDWIDTH: Final = 0.17
"""Width of the kernel on square roots of histograms, whose distances reach from zero to the root of two."""

PAIRED_POINTS: Final = 256
PAIR_DISTANCES: Final = (0.002, 0.14)
"""Distances from the spacing of a cloud to the span of a hand [m]; their roots are divided evenly."""

BATCH: Final = 2048
"""Points described at a time, so that memory stays bounded."""

VERSION: Final = 1
"""Raised when the same feature gets other numbers."""


def descriptor_kind(parameters: CloudParameters) -> str:
    """Return a text that is the same for descriptors that can be compared."""
    lengths = (parameters.spacing, parameters.smoothing_radius, parameters.fpfh_radius)
    return f"{VERSION}; {' '.join(f'{1e3 * length:g}' for length in lengths)} mm"


def describe(
    points: Floats, normals: Floats, histograms: NDArray[np.float32], areas: Floats
) -> NDArray[np.float32]:
    """Return the descriptor of a part of a surface, float32, shape (428,).

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Positions [m] and outward unit normals, at least one.
    histograms : ndarray, shape (n, 33)
        FPFH of the points.
    areas : ndarray, shape (n,)
        Area that each point stands for.
    """
    return describe_features(points, normals, local_features(histograms), areas)


def describe_features(
    points: Floats, normals: Floats, features: NDArray[np.float32], areas: Floats
) -> NDArray[np.float32]:
    """Return the same from `local_features`, which an object has once for all of its parts."""
    local = (areas / areas.sum()).astype(np.float32) @ features
    return np.concatenate([local, _pairs(points, normals, areas)]).astype(np.float32)


def local_features(histograms: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the Fourier features of histograms of shape (n, 33), shape (n, 128)."""
    frequencies, phases = _fourier(histograms.shape[1])
    features = np.empty((len(histograms), N_FOURIER), dtype=np.float32)
    for start in range(0, len(histograms), BATCH):
        some = histograms[start : start + BATCH]
        total = some.sum(axis=1, keepdims=True, dtype=np.float64)
        roots = np.sqrt(np.maximum(some, 0) / np.where(total > 0, total, 1.0))
        features[start : start + BATCH] = np.sqrt(2 / N_FOURIER) * np.cos(roots @ frequencies + phases)
    return features


@cache
def _fourier(bins: int) -> tuple[Floats, Floats]:
    """Return frequencies, shape (bins, 128), and phases of the Fourier features."""
    # Sobol's sequence comes in powers of two; its first point, zero, is no frequency.
    even = qmc.Sobol(bins + 1, scramble=False).random(2 * N_FOURIER)[1 : N_FOURIER + 1]
    return np.asarray(norm.ppf(even[:, :-1]).T / BANDWIDTH), 2 * np.pi * even[:, -1]


def _pairs(points: Floats, normals: Floats, areas: Floats) -> Floats:
    """Return the square roots of the shares of pairs in each cell, shape (300,)."""
    n = len(points)
    chosen = np.unique(np.linspace(0, n - 1, min(n, PAIRED_POINTS)).round().astype(np.int64))
    if len(chosen) < 2:
        return np.zeros(int(np.prod(PAIR_BINS)))
    points, normals, areas = points[chosen] - points[chosen].mean(axis=0), normals[chosen], areas[chosen]
    pairs = _upper(len(chosen))
    distances = pdist(points)
    # The normals' difference along the step between two points, by dot products of all with all.
    dots = normals @ points.T
    own = np.diagonal(dots)
    bends = (own[:, None] + own - dots - dots.T).ravel()[pairs] / np.maximum(distances, 1e-12)
    cosines = (normals @ normals.T).ravel()[pairs]
    ranges = (tuple(np.sqrt(PAIR_DISTANCES)), (-1.0, 1.0), (-2.0, 2.0))
    shares = np.outer(areas, areas).ravel()[pairs]
    cells = _soft_histogram((np.sqrt(distances), cosines, bends), ranges, shares)
    # Sums of products leave cells that nothing falls into a rounding error off zero.
    return np.asarray(np.sqrt(np.maximum(cells, 0.0) / cells.sum()))


@lru_cache(maxsize=64)
def _upper(n: int) -> NDArray[np.int64]:
    """Return the places above the diagonal of a matrix of n rows laid out flat, row by row."""
    first, second = np.triu_indices(n, 1)
    return np.asarray(n * first + second, dtype=np.int64)


def _soft_histogram(
    values: tuple[Floats, Floats, Floats], ranges: tuple[tuple[float, ...], ...], weights: Floats
) -> Floats:
    """Return a histogram whose entries are shared among neighbouring cells, by distance, flat.

    An entry's shares in the eight cells around it are products of its places within the lowest of them, so
    the sums of these products over each lowest cell are all that is needed of the entries.
    """
    place = np.zeros(len(weights), dtype=np.int64)
    moments = np.empty((8, len(weights)))
    moments[0] = weights
    for i, (value, (low, high), bins) in enumerate(zip(values, ranges, PAIR_BINS, strict=True)):
        scaled = np.clip((value - low) / (high - low) * (bins - 1), 0, bins - 1)
        lower = np.minimum(scaled.astype(np.int64), bins - 2)
        place = place * bins + lower
        np.multiply(moments[: 2**i], scaled - lower, out=moments[2**i : 2 ** (i + 1)])
    n_cells = int(np.prod(PAIR_BINS))
    sums = np.array([np.bincount(place, row, minlength=n_cells) for row in moments])
    sums = sums.reshape(2, 2, 2, *PAIR_BINS)  # what the last value multiplies comes first
    for axis in (2, 1, 0):
        sums = sums[0] - sums[1] + np.roll(sums[1], 1, axis=axis - 3)
    return np.asarray(sums.ravel())
