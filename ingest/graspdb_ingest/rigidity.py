"""Whether an object's markers keep the distances that the manifest gives them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.manifest import Vector

_LOOSE: Final = 0.002
"""Standard deviation of a distance that noise does not explain [m]."""
_OFF: Final = 0.005
"""Difference from the model that measuring marker positions does not explain [m]."""
_SAME_FACTOR: Final = 0.05
_MOST_TO_PERMUTE: Final = 6
_FLAT: Final = 0.02


@dataclass(frozen=True)
class DistanceReport:
    """The distance between two markers of an object over a trial.

    Attributes
    ----------
    first, second : str
        The markers.
    model : float
        Distance by the manifest [m].
    mean, sd : float
        Mean and standard deviation over the frames where both were seen [m]; NaN without such.
    n_frames : int
        Number of these frames.
    """

    first: str
    second: str
    model: float
    mean: float
    sd: float
    n_frames: int

    @property
    def difference(self) -> float:
        """Mean less model [m]."""
        return self.mean - self.model


def measure_distances(
    model: Mapping[str, Vector], positions: NDArray[np.float64]
) -> tuple[DistanceReport, ...]:
    """Compare all distances between an object's markers with the manifest's.

    Parameters
    ----------
    model : mapping of str to tuple of float
        Marker positions in the mesh's frame [m].
    positions : ndarray, shape (n_frames, len(model), 3)
        Where they were seen [m], NaN where not.

    Returns
    -------
    tuple of DistanceReport
        One for each pair of markers.
    """
    places = [np.array(place) for place in model.values()]
    reports = []
    for (i, first), (j, second) in combinations(enumerate(model), 2):
        apart = np.linalg.norm(positions[:, i] - positions[:, j], axis=1)
        apart = apart[np.isfinite(apart)]
        mean, sd = (float(apart.mean()), float(apart.std())) if apart.size else (np.nan, np.nan)
        expected = float(np.linalg.norm(places[i] - places[j]))
        reports.append(DistanceReport(first, second, expected, mean, sd, apart.size))
    return tuple(reports)


def rigidity_warnings(
    model: Mapping[str, Vector], positions: NDArray[np.float64], distances: Sequence[DistanceReport]
) -> tuple[str, ...]:
    """Say in words what is wrong with an object's markers, and the likely reason.

    Parameters
    ----------
    model : mapping of str to tuple of float
        Marker positions in the mesh's frame [m].
    positions : ndarray, shape (n_frames, len(model), 3)
        Where they were seen [m].
    distances : sequence of DistanceReport
        What `measure_distances` found.
    """
    seen = [entry for entry in distances if entry.n_frames]
    warnings = [
        f"the distance of {entry.first} and {entry.second} is not steady (standard deviation "
        f"{1000 * entry.sd:.1f} mm): a loose marker, or labels that change places"
        for entry in seen
        if entry.sd > _LOOSE
    ]
    off = [entry for entry in seen if abs(entry.difference) > _OFF]
    if not off:
        if _mirrored(model, positions):
            warnings.append(
                "the object's markers are the mirror image of the manifest's: check the signs of their "
                "coordinates and that the lab frame is right-handed"
            )
        return tuple(warnings)
    factor = _common_factor(seen)
    if factor is not None:
        warnings.append(
            f"all distances of the object's markers are {factor:.3g} times the manifest's: "
            "check the units of the recording and of the markers in session.yaml"
        )
        return tuple(warnings)
    warnings += [
        f"{entry.first} and {entry.second} are {1000 * entry.mean:.1f} mm apart, in the manifest "
        f"{1000 * entry.model:.1f} mm"
        for entry in off
    ]
    swapped = _swapped(model, distances)
    if swapped:
        warnings.append(f"the distances would fit if {swapped}: check marker_names and the labels")
    return tuple(warnings)


def _common_factor(distances: Sequence[DistanceReport]) -> float | None:
    """Return the factor that all distances are off by, if it is one factor for at least three."""
    ratios = np.array([entry.mean / entry.model for entry in distances])
    if ratios.size < 3:
        return None
    factor = float(np.median(ratios))
    if factor <= 0 or np.abs(ratios / factor - 1).max() > _SAME_FACTOR:
        return None
    return factor


def _swapped(model: Mapping[str, Vector], distances: Sequence[DistanceReport]) -> str | None:
    """Return which exchange of labels makes all distances fit, if there is one."""
    labels = list(model)
    if not 3 <= len(labels) <= _MOST_TO_PERMUTE or not all(entry.n_frames for entry in distances):
        return None
    places = np.array(list(model.values()))
    expected = np.linalg.norm(places[:, None] - places[None], axis=2)
    pairs = list(combinations(range(len(labels)), 2))
    measured = np.array([entry.mean for entry in distances])
    for order in permutations(range(len(labels))):
        fitted = np.array([expected[order[i], order[j]] for i, j in pairs])
        if np.abs(measured - fitted).max() <= _OFF:
            moved = [f"{labels[i]} were {labels[k]}" for i, k in enumerate(order) if i != k]
            return ", ".join(moved)
    return None


def _mirrored(model: Mapping[str, Vector], positions: NDArray[np.float64]) -> bool:
    """Whether four markers that are not in a plane turn the other way round than in the manifest."""
    places = np.array(list(model.values()))
    votes = []
    for four in combinations(range(len(places)), 4):
        expected = _volume(places[None, four])[0]
        measured = _volume(positions[:, four])
        measured = measured[np.isfinite(measured)]
        if abs(expected) > _FLAT and measured.size:
            votes.append(np.sign(np.median(measured)) != np.sign(expected))
    return bool(votes) and all(votes)


def _volume(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed volume of four points by the product of its edges, shape (n_frames,)."""
    edges = points[:, 1:] - points[:, :1]
    lengths = np.linalg.norm(edges, axis=2).prod(axis=1)
    turn = np.einsum("fi,fi->f", np.cross(edges[:, 0], edges[:, 1]), edges[:, 2])
    return np.asarray(turn / lengths)
