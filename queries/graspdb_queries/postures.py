"""Joint angles out of the rows of an answer, and their principal components."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import FINGERS, JOINT_ANGLES

Array = NDArray[np.float64]

_OF_DIGITS: Final = tuple(name for name in JOINT_ANGLES if not name.startswith("wrist_"))
_SANTELLO: Final = (
    "thumb_cmc_flexion",
    "thumb_cmc_abduction",
    "thumb_mcp_flexion",
    "thumb_ip_flexion",
    *(f"{finger}_{joint}_flexion" for finger in FINGERS for joint in ("mcp", "pip")),
    *(f"{finger}_mcp_abduction" for finger in ("index", "ring", "little")),
)
JOINTS: Final[dict[str, tuple[str, ...]]] = {
    "digits": _OF_DIGITS,
    "all": JOINT_ANGLES,
    "santello1998": _SANTELLO,
}
"""Sets of joint angles that the synergies can be those of.

santello1998 is nearest to the 15 angles of Santello, Flanders and Soechting (1998): of the thumb rotation,
abduction, mcp and ip flexion, of each finger mcp and pip flexion, and the three abductions between
neighbouring fingers, for which each finger's own abduction from the middle finger stands here.
"""

_LEAST_VARIANCE: Final = 1e-12
"""Share of the variance below which a component is rounding."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Number, mean and scatter of postures, gathered batch by batch.

    Attributes
    ----------
    n : int
        Number of postures.
    mean : ndarray, shape (d,)
        Their mean [rad].
    scatter : ndarray, shape (d, d)
        Sum of the outer products of what differs from the mean [rad2].
    """

    n: int
    mean: Array
    scatter: Array

    def with_rows(self, angles: Array) -> "Moments":
        """Return the moments with more postures, shape (m, d)."""
        if not len(angles):
            return self
        mean = angles.mean(axis=0)
        centred, step, n = angles - mean, mean - self.mean, self.n + len(angles)
        # Chan, Golub and LeVeque (1983), equations 2.1.
        scatter = self.scatter + centred.T @ centred + np.outer(step, step) * (self.n * len(angles) / n)
        return Moments(n, self.mean + step * (len(angles) / n), scatter)


@dataclass(frozen=True, eq=False)
class Components:
    """Principal components of postures.

    Attributes
    ----------
    mean : ndarray, shape (d,)
        Mean posture [rad].
    scale : ndarray, shape (d,)
        What each angle is divided by: 1, or its standard deviation [rad]; infinite where it never varies.
    variances : ndarray, shape (k,)
        Variance along each component, largest first [rad2, or 1].
    axes : ndarray, shape (k, d)
        Unit vectors; the loading that is largest in size is positive.
    total : float
        Variance of all angles together [rad2, or 1].
    """

    mean: Array
    scale: Array
    variances: Array
    axes: Array
    total: float

    def scaled(self, angles: Array) -> Array:
        """Return what differs from the mean posture, in units of `scale`, shape (n, d)."""
        scaled: Array = (angles - self.mean) / self.scale
        return scaled


def joints_of(parameters: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the joint angles that were asked for."""
    return JOINTS[parameters["joints"]]


def at_least_one(parameters: Mapping[str, Any], name: str) -> int:
    """Return a parameter that counts something.

    Raises
    ------
    ParameterError
        It is less than one.
    """
    value = parameters[name]
    if value is None or value < 1:
        raise ParameterError(f"parameter {name}", value, "an integer of at least 1")
    return int(value)


def whole_rows(
    rows: Iterable[pa.RecordBatch], joints: tuple[str, ...]
) -> Iterable[tuple[pa.RecordBatch, Array]]:
    """Yield the rows that have every joint angle, and these angles in the order of `joints`, shape (n, d).

    The rows have a column ``angles``, a list of the 23 of JOINT_ANGLES.
    """
    places = [JOINT_ANGLES.index(name) for name in joints]
    for batch in rows:
        column = batch.column("angles").drop_null()
        kept = batch.filter(batch.column("angles").is_valid())
        angles = column.flatten().to_numpy(zero_copy_only=False).reshape(-1, len(JOINT_ANGLES))[:, places]
        whole = np.isfinite(angles).all(axis=1)
        yield kept.filter(pa.array(whole)), angles[whole]


def moments(rows: Iterable[pa.RecordBatch], joints: tuple[str, ...]) -> Moments:
    """Return the moments of the postures in rows; rows without all angles are left out."""
    gathered = Moments(0, np.zeros(len(joints)), np.zeros((len(joints), len(joints))))
    for _, angles in whole_rows(rows, joints):
        gathered = gathered.with_rows(angles)
    return gathered


def principal_components(found: Moments, normalisation: str) -> Components:
    """Return the principal components of postures; those without variance are left out.

    Parameters
    ----------
    found : Moments
        The postures.
    normalisation : str
        covariance: angles as they are; correlation: each divided by its standard deviation first.
    """
    covariance = found.scatter / max(found.n - 1, 1)
    scale = np.ones(len(found.mean))
    if normalisation == "correlation":
        sd = np.sqrt(np.diag(covariance))
        scale = np.where(sd > 0, sd, np.inf)
    covariance = covariance / np.outer(scale, scale)
    total = float(np.trace(covariance))
    variances, axes = np.linalg.eigh(covariance)
    order = [i for i in np.argsort(-variances, kind="stable") if variances[i] > _LEAST_VARIANCE * total]
    axes = axes.T[order]
    largest = axes[np.arange(len(axes)), np.abs(axes).argmax(axis=1)] if len(axes) else np.ones(0)
    return Components(found.mean, scale, variances[order], axes * np.sign(largest)[:, None], total)
