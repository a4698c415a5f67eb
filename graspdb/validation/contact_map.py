"""Contact maps against contact that was measured on the object's surface, by heat or by paint."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from graspdb_ingest.contact_map import contact_map
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.surface import HandPoints, hand_surface


@dataclass(frozen=True, eq=False)
class MeasuredMap:
    """Contact measured on an object's surface.

    Attributes
    ----------
    positions : ndarray, shape (n, 3)
        Points of the surface, object frame [m].
    normals : ndarray, shape (n, 3)
        Outward unit normals there.
    contact : ndarray, shape (n,)
        Measured contact, 0 for none to 1.
    """

    positions: Floats
    normals: Floats
    contact: Floats


@dataclass(frozen=True)
class Agreement:
    """Points called touched if their gap is at most a threshold, against those measured as touched.

    Attributes
    ----------
    threshold : float
        The gap [m].
    precision, recall, f1 : float
        Share of the points called touched that are, share of those touched that are called so, and
        their harmonic mean.
    """

    threshold: float
    precision: float
    recall: float
    f1: float


@dataclass(frozen=True)
class MapValidation:
    """How well one way of measuring gaps agrees with measured contact.

    Attributes
    ----------
    surface : str
        Surface of the hand: spheres, capsules or skin.
    gap : str
        ``distance``: signed distance to the surface; ``pressing``: see `graspdb_ingest.contact_map`.
    auc : float
        Area under the receiver's operating characteristic.
    best : Agreement
        At the threshold with the largest F1.
    at : tuple of Agreement
        At the thresholds asked for.
    """

    surface: str
    gap: str
    auc: float
    best: Agreement
    at: tuple[Agreement, ...]


def validate_map(
    measured: MeasuredMap,
    hands: Sequence[HandPoints],
    surfaces: Sequence[str],
    contact_above: float,
    thresholds: Sequence[float],
) -> tuple[MapValidation, ...]:
    """Compare the contact maps of one or two hands with measured contact.

    Every point counts alike. A point belongs to the hand that is nearer.

    Parameters
    ----------
    measured : MeasuredMap
        What was measured.
    hands : sequence of HandPoints
        The hands that held the object, in its frame.
    surfaces : sequence of str
        Surfaces of the hand to compare.
    contact_above : float
        A point is touched where the measured contact is above this.
    thresholds : sequence of float
        Gaps at which precision, recall and F1 are wanted [m].

    Returns
    -------
    tuple of MapValidation
        Two for each surface: by distance and by pressing gap.
    """
    touched = measured.contact > contact_above
    found = []
    for name in surfaces:
        gaps = [_gaps(measured, hand, name) for hand in hands]
        for kind, index in (("distance", 0), ("pressing", 1)):
            gap = np.min([both[index] for both in gaps], axis=0)
            at = tuple(agreement(gap, touched, threshold) for threshold in thresholds)
            found.append(MapValidation(name, kind, auc(gap, touched), best_agreement(gap, touched), at))
    return tuple(found)


def _gaps(measured: MeasuredMap, hand: HandPoints, name: str) -> tuple[Floats, Floats]:
    """Return distance and pressing gap of every point to one hand [m]."""
    surface = hand_surface(hand, name)
    found = contact_map(measured.positions, measured.normals, surface, np.inf)
    return found.gaps, found.pressing_gaps


def auc(gap: Floats, touched: Bools) -> float:
    """Return how probable it is that a touched point has a smaller gap than another; NaN without both."""
    n, m = int(touched.sum()), int((~touched).sum())
    if not n or not m:
        return float("nan")
    ranks: NDArray[np.float64] = rankdata(-gap)
    return float((ranks[touched].sum() - n * (n + 1) / 2) / (n * m))


def agreement(gap: Floats, touched: Bools, threshold: float) -> Agreement:
    """Return precision, recall and F1 at a threshold; precision is NaN where no point is called touched."""
    called = gap <= threshold
    hits, n_called, n_touched = (int(mask.sum()) for mask in (called & touched, called, touched))
    return Agreement(
        threshold=threshold,
        precision=hits / n_called if n_called else float("nan"),
        recall=hits / n_touched if n_touched else float("nan"),
        f1=2 * hits / (n_called + n_touched) if n_called + n_touched else float("nan"),
    )


def best_agreement(gap: Floats, touched: Bools) -> Agreement:
    """Return the agreement at the threshold with the largest F1."""
    order = np.argsort(gap, kind="stable")
    hits = np.cumsum(touched[order])
    f1 = 2 * hits / (np.arange(1, len(gap) + 1) + touched.sum())
    # Points of equal gap are called together.
    f1[:-1][np.diff(gap[order]) == 0] = -1.0
    return agreement(gap, touched, float(gap[order[int(f1.argmax())]]))
