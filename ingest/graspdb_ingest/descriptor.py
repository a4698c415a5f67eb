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

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
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
    return describe_featured(points, normals, fourier_features(histograms), areas)


def describe_featured(
    points: Floats, normals: Floats, features: Floats, areas: Floats
) -> NDArray[np.float32]:
    """Return the same from the points' `fourier_features`, for many parts of one surface."""
    local = areas @ features / areas.sum()
    return np.concatenate([local, _pairs(points, normals, areas)]).astype(np.float32)


def fourier_features(histograms: NDArray[np.float32]) -> Floats:
    """Return the Fourier features of histograms, shape (n, 128)."""
    total = histograms.sum(axis=1, keepdims=True, dtype=np.float64)
    roots = np.sqrt(np.maximum(histograms, 0) / np.where(total > 0, total, 1.0))
    frequencies, phases = _fourier(roots.shape[1])
    return np.asarray(np.sqrt(2 / N_FOURIER) * np.cos(roots @ frequencies + phases))


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
    pairs = _upper(len(chosen))
    if not len(pairs):
        return np.zeros(int(np.prod(PAIR_BINS)))
    points, normals, areas = points[chosen] - points[chosen].mean(axis=0), normals[chosen], areas[chosen]
    squares = np.einsum("ni,ni->n", points, points)
    squared = (squares[:, None] + squares - 2 * points @ points.T).ravel()[pairs]
    distances = np.sqrt(np.maximum(squared, 0.0))
    # (n_j - n_i) . (p_j - p_i), from the products of every normal with every point.
    along = normals @ points.T
    own = np.diagonal(along)
    bends = (own[:, None] + own - along - along.T).ravel()[pairs] / np.maximum(distances, 1e-12)
    cosines = (normals @ normals.T).ravel()[pairs]
    ranges = (tuple(np.sqrt(PAIR_DISTANCES)), (-1.0, 1.0), (-2.0, 2.0))
    shares = np.outer(areas, areas).ravel()[pairs]
    cells = _soft_histogram((np.sqrt(distances), cosines, bends), ranges, shares)
    return np.asarray(np.sqrt(cells / cells.sum()))


@cache
def _upper(n: int) -> NDArray[np.int64]:
    """Return the places, in a flattened matrix of n rows, of the pairs of different points."""
    first, second = np.triu_indices(n, 1)
    return np.asarray(n * first + second)


def _soft_histogram(
    values: tuple[Floats, Floats, Floats], ranges: tuple[tuple[float, ...], ...], weights: Floats
) -> Floats:
    """Return a histogram whose entries are shared among neighbouring cells, by distance, flat."""
    n_cells = int(np.prod(PAIR_BINS))
    lower = np.zeros(len(weights), dtype=np.int64)
    corners = [(0, weights)]
    stride = n_cells
    for value, (low, high), bins in zip(values, ranges, PAIR_BINS, strict=True):
        stride //= bins
        place = np.clip((value - low) * ((bins - 1) / (high - low)), 0, bins - 1)
        whole = np.minimum(place.astype(np.int64), bins - 2)
        lower += stride * whole
        beyond = place - whole
        corners = [
            corner
            for step, share in corners
            for upper in (share * beyond,)
            for corner in ((step, share - upper), (step + stride, upper))
        ]
    cells = np.zeros(n_cells)
    for step, share in corners:
        cells[step:] += np.bincount(lower, share, minlength=n_cells)[: n_cells - step]
    return cells
