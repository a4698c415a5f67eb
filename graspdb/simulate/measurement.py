"""What a motion-capture system makes of true markers: skin movement, noise, occlusion, swapped labels."""

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from graspdb.simulate.arrays import Floats
from graspdb_schemas.errors import ParameterError

Booleans = NDArray[np.bool_]


@dataclass(frozen=True)
class NoiseParameters:
    """How far measured markers are from true ones; zeros give perfect recordings.

    Attributes
    ----------
    marker_sd : float
        White noise of each axis of every marker [m].
    skin_sd : float
        Skin movement: standard deviation of a hand marker along each of the two directions in
        the skin, over long times [m].
    skin_angle_share : float
        Share of the skin movement's variance that follows the joint angle under the marker; the
        rest drifts by itself.
    skin_time : float
        Time scale of the drift [s].
    occlusion : float
        Share of frames in which a marker is not seen, 0 to below 1.
    occlusion_burst : tuple of float
        Shortest and longest burst of occlusion [s].
    swaps : float
        Mean number of stretches in a trial in which two markers have each other's label.
    swap_duration : tuple of float
        Shortest and longest such stretch [s].
    pressure_sd : float
        Noise of each axis of the force panels' centre of pressure [m].
    glove_sd, glove_offset_sd : float
        White noise of each sensor of a data glove, and spread of the sensors' constant offsets [rad].
    """

    marker_sd: float = 0.0005
    skin_sd: float = 0.001
    skin_angle_share: float = 0.5
    skin_time: float = 1.0
    occlusion: float = 0.03
    occlusion_burst: tuple[float, float] = (0.05, 0.5)
    swaps: float = 0.0
    swap_duration: tuple[float, float] = (0.1, 0.5)
    pressure_sd: float = 0.001
    glove_sd: float = 0.052
    glove_offset_sd: float = 0.087

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            low = value[0] if isinstance(value, tuple) else value
            if not low >= 0:
                raise ParameterError(name, value, "zero or more")
        if not self.occlusion < 0.9:
            raise ParameterError("occlusion", self.occlusion, "a share from 0 to below 0.9")
        if not self.skin_angle_share <= 1:
            raise ParameterError("skin_angle_share", self.skin_angle_share, "a share from 0 to 1")
        for name in ("occlusion_burst", "swap_duration"):
            short, long = getattr(self, name)
            if not 0 < short <= long:
                raise ParameterError(name, (short, long), "two durations above zero, the shorter one first")

    @classmethod
    def none(cls) -> "NoiseParameters":
        """Return a perfect measurement."""
        return cls(marker_sd=0, skin_sd=0, occlusion=0, swaps=0, pressure_sd=0, glove_sd=0, glove_offset_sd=0)


@dataclass(frozen=True)
class Swap:
    """A stretch in which two markers have each other's label: frames start to stop, stop excluded."""

    first: str
    second: str
    start: int
    stop: int


@dataclass(frozen=True)
class Measured:
    """Markers as recorded, and what was done to them.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3)
        As recorded [m]; NaN where not seen.
    occluded : ndarray of bool, shape (n_frames, n_markers)
        Where a marker was not seen, by the marker's true identity.
    swaps : tuple of Swap
        Swapped labels.
    """

    positions: Floats
    occluded: Booleans
    swaps: tuple[Swap, ...] = field(default=())


def skin_movement(
    axes: Floats,
    angles: Floats,
    limits: Floats,
    noise: NoiseParameters,
    rate: float,
    rng: np.random.Generator,
) -> Floats:
    """Return how far markers slide with the skin [m], shape (n_frames, n_markers, 3).

    Parameters
    ----------
    axes : ndarray, shape (n_frames, n_markers, 3, 2)
        The two directions in the skin under each marker.
    angles : ndarray, shape (n_frames, n_markers)
        The joint angle that pulls the skin under each marker [rad].
    limits : ndarray, shape (n_markers, 2)
        Limits of those joints [rad].
    noise : NoiseParameters
        Amounts and time scale.
    rate : float
        Frames per second [Hz].
    rng : numpy.random.Generator
        Draws directions and drifts.
    """
    n_frames, n_markers = angles.shape
    middle, half = limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 2
    # An angle spread evenly over its range has variance 1/3 of its half range.
    pulled = np.sqrt(3) * (angles - middle) / half
    direction = rng.standard_normal((n_markers, 2))
    drift = slow_drift((n_frames, n_markers, 2), noise.skin_time * rate, rng)
    share = noise.skin_angle_share
    along = np.sqrt(share) * pulled[..., None] * direction + np.sqrt(1 - share) * drift
    return np.asarray(noise.skin_sd * np.einsum("fmij,fmj->fmi", axes, along))


def slow_drift(shape: tuple[int, ...], scale: float, rng: np.random.Generator) -> Floats:
    """Return Gaussian noise of variance 1, smooth along its first axis over `scale` frames."""
    margin = int(np.ceil(4 * scale))
    white = rng.standard_normal((shape[0] + 2 * margin, *shape[1:]))
    smooth = gaussian_filter1d(white, scale, axis=0, truncate=4.0)[margin : margin + shape[0]]
    impulse = np.zeros(2 * margin + 1)
    impulse[margin] = 1.0
    weights = gaussian_filter1d(impulse, scale, truncate=4.0)
    return np.asarray(smooth / np.sqrt(np.sum(weights**2)))


def measure(
    true: Floats, labels: tuple[str, ...], noise: NoiseParameters, rate: float, rng: np.random.Generator
) -> Measured:
    """Return markers as a motion-capture system records them.

    Parameters
    ----------
    true : ndarray, shape (n_frames, n_markers, 3)
        True positions, skin movement included [m].
    labels : tuple of str
        The markers' labels.
    noise : NoiseParameters
        Amounts.
    rate : float
        Frames per second [Hz].
    rng : numpy.random.Generator
        Draws everything.
    """
    positions = true + noise.marker_sd * rng.standard_normal(true.shape)
    occluded = bursts(true.shape[:2], noise, rate, rng)
    positions[occluded] = np.nan
    swaps = _draw_swaps(true, labels, noise, rate, rng)
    for swap in swaps:
        pair = [labels.index(swap.first), labels.index(swap.second)]
        positions[swap.start : swap.stop, pair] = positions[swap.start : swap.stop, pair[::-1]]
    return Measured(positions, occluded, swaps)


def bursts(shape: tuple[int, int], noise: NoiseParameters, rate: float, rng: np.random.Generator) -> Booleans:
    """Return where markers are occluded, shape (n_frames, n_markers).

    Seen and occluded stretches alternate; occluded ones last evenly between the shortest and the
    longest burst, seen ones exponentially, so that the share occluded is as asked for.
    """
    occluded = np.zeros(shape, dtype=bool)
    if noise.occlusion == 0:
        return occluded
    short, long = (rate * seconds for seconds in noise.occlusion_burst)
    seen_mean = (short + long) / 2 * (1 - noise.occlusion) / noise.occlusion
    for column in occluded.T:
        # Starting long before the recording makes its first frame like any other.
        frame = -20.0 * (seen_mean + long)
        while frame < shape[0]:
            frame += rng.exponential(seen_mean)
            stop = frame + rng.uniform(short, long)
            column[max(0, round(frame)) : max(0, round(stop))] = True
            frame = stop
    return occluded


def _draw_swaps(
    true: Floats, labels: tuple[str, ...], noise: NoiseParameters, rate: float, rng: np.random.Generator
) -> tuple[Swap, ...]:
    """Draw stretches in which a marker and one of its three nearest exchange labels; none overlap."""
    n_frames, n_markers, _ = true.shape
    free = np.ones((n_frames, n_markers), dtype=bool)
    swaps = []
    for _ in range(int(rng.poisson(noise.swaps))):
        length = min(n_frames, max(1, round(rate * rng.uniform(*noise.swap_duration))))
        start = int(rng.integers(0, n_frames - length + 1))
        first, rank = int(rng.integers(n_markers)), int(rng.integers(1, 4))
        distance = np.linalg.norm(true[start] - true[start, first], axis=1)
        second = int(np.argsort(distance, kind="stable")[min(rank, n_markers - 1)])
        stretch = np.ix_(range(start, start + length), (first, second))
        if free[stretch].all():
            free[stretch] = False
            swaps.append(Swap(labels[first], labels[second], start, start + length))
    return tuple(sorted(swaps, key=lambda swap: (swap.start, swap.first)))
