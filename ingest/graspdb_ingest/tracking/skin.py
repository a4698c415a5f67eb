"""Where a marker sits on the skin: its offset from its place on the model, carried over a gap.

Skin slides over bone by millimetres, slowly and differently at each marker, and a model of rigid segments
cannot follow it. A marker that is hidden for a moment sits about where it sat before and after.
"""

from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel

SKIN_TIME: Final = 1.0
"""Time in which a marker's offset is forgotten [s]: that of a movement of the hand, which moves skin."""
WHITE_SHARE: Final = 0.25
"""Variance of an offset's noise from frame to frame, over that of its slow movement."""
REACH: Final = 0.1
"""Offsets this far before and after a gap say what they are inside it [s]."""


def hidden_marker(
    hand: HandModel, q: Floats, observed: Floats, marker: int, gap: slice, rate: float
) -> Floats:
    """Predict a marker in a gap: where the hand carries it, and where it sat on the skin on either side.

    The offset is a Gaussian process with an exponential correlation (Ornstein-Uhlenbeck) in the frame of
    the marker's segment, known with noise in the frames about the gap.

    Parameters
    ----------
    hand : HandModel
        The hand that was followed.
    q : ndarray, shape (n_frames, n_q)
        Configurations, NaN where the hand is not known.
    observed : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen. Those of the marker inside the gap are not used.
    marker : int
        Which marker.
    gap : slice
        The gap's frames.
    rate : float
        Frames per second [Hz].

    Returns
    -------
    ndarray, shape (gap.stop - gap.start, 3)
        Its predicted positions [m], NaN where the hand is not known.
    """
    reach = round(REACH * rate)
    first, last = max(0, gap.start - reach), min(len(q), gap.stop + reach)
    places, rotations = _carried(hand, q[first:last], marker)
    hidden = np.zeros(last - first, dtype=bool)
    hidden[gap.start - first : gap.stop - first] = True
    offsets = np.einsum("fji,fj->fi", rotations, observed[first:last, marker] - places)
    known = ~hidden & np.isfinite(offsets).all(axis=1)
    carried = bridge(np.arange(last - first) / rate, offsets, known)
    return np.asarray((places + np.einsum("fij,fj->fi", rotations, carried))[hidden])


def bridge(times: Floats, offsets: Floats, known: Bools) -> Floats:
    """Return the expected offset at each time, given those that are known; zero where none is.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times [s].
    offsets : ndarray, shape (n, 3)
        Offsets [m].
    known : ndarray of bool, shape (n,)
        Which of them are known.
    """
    correlation = np.exp(-np.abs(np.subtract.outer(times, times[known])) / SKIN_TIME)
    measured = correlation[known] + WHITE_SHARE * np.eye(int(known.sum()))
    return np.asarray(correlation @ np.linalg.solve(measured, offsets[known]))


def _carried(hand: HandModel, q: Floats, marker: int) -> tuple[Floats, Floats]:
    """Return where the hand carries a marker, (n, 3), and how its segment is turned, (n, 3, 3)."""
    kinematics = Kinematics(hand)
    body = int(kinematics.model.site_bodyid[hand.marker_ids[marker]])
    places, rotations = np.full((len(q), 3), np.nan), np.full((len(q), 3, 3), np.nan)
    for i in np.flatnonzero(np.isfinite(q[:, 0])):
        kinematics.move(q[i])
        places[i], rotations[i] = kinematics.markers[marker], kinematics.body_rotations[body]
    return places, rotations
