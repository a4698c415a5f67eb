"""Contact points against measured centres of pressure: the paper's first experiment, its Table I."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from graspdb.database import Database
from graspdb_schemas.errors import QueryError

Floats = NDArray[np.float64]

CONFIDENCE: Final = 0.95

PAPER: Final[dict[str, tuple[str, ...]]] = {
    "thumb+index": ("3.9/4.5", "2.3/3.2", "4.1/4.3"),
    "thumb+middle": ("2.1/3.7", "3.5/4.2", "4.2/2.6"),
    "thumb+ring": ("3.6/4.4", "3.3/4.1", "3.4/2.3"),
    "thumb+little": ("3.2/4.9", "4.4/3.8", "5.0/4.8"),
}
"""The paper's Table I [mm]: thumb and finger, for each of its three subjects."""


@dataclass(frozen=True)
class MeanError:
    """The mean of some distances, and how well it is known.

    Attributes
    ----------
    n : int
        Number of distances.
    mean : float
        Their mean [m]; NaN without any.
    low, high : float
        Limits of its 95 % confidence interval by Student's t, not below zero [m]; NaN for fewer than two.
    """

    n: int
    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class ContactError:
    """The errors of one digit in one subject's grasps with one pair of digits.

    Attributes
    ----------
    subject, pair, digit : str
        Whose, with which digits (``thumb+index``), and of which of them.
    n_missed : int
        Grasps in which the digit pressed and no contact of it was found.
    all_points : MeanError
        Of the mean of the digit's contact points, as the paper defines it.
    weighted : MeanError
        Of their mean weighted as elastic pads press: by the square of how far each gap is below h.
    most_distal : MeanError
        Of the contact point of the digit's most distal touching site.
    """

    subject: str
    pair: str
    digit: str
    n_missed: int
    all_points: MeanError
    weighted: MeanError
    most_distal: MeanError


def contact_errors(database: Database) -> tuple[ContactError, ...]:
    """Return the errors of contact points by subject, pair of digits and digit.

    Parameters
    ----------
    database : Database
        A database with trials that have `reference_contacts`.

    Raises
    ------
    QueryError
        If no grasp has a centre of pressure measured at its snapshot.
    """
    groups: dict[tuple[str, str, str], list[list[float]]] = {}
    rows = database.query("contact_errors").table.to_pylist()
    for row in rows:
        key = (row["subject"], row["pair"], row["digit"])
        found = [row[name] for name in ("error", "weighted_error", "distal_error")]
        groups.setdefault(key, []).append([np.nan if value is None else value for value in found])
    if not rows:
        raise QueryError(
            "no grasp in the database has a centre of pressure measured at its snapshot",
            "Name the file of measured centres with reference_contacts in the manifest's trials, and ingest.",
        )
    return tuple(_contact_error(*key, np.array(errors)) for key, errors in groups.items())


def _contact_error(subject: str, pair: str, digit: str, errors: Floats) -> ContactError:
    missed = int(np.isnan(errors[:, 0]).sum())
    return ContactError(subject, pair, digit, missed, *(mean_error(column) for column in errors.T))


def mean_error(distances: Sequence[float] | Floats) -> MeanError:
    """Return the mean of distances [m] with its confidence interval; NaN ones are left out."""
    values = np.asarray(distances, dtype=float)
    values = values[np.isfinite(values)]
    n = len(values)
    if n < 2:
        mean = float(values[0]) if n else np.nan
        return MeanError(n, mean, np.nan, np.nan)
    mean = float(values.mean())
    reach = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2) * values.std(ddof=1) / np.sqrt(n))
    return MeanError(n, mean, max(0.0, mean - reach), mean + reach)
