"""Calibration of a subject's hand: its shape and marker offsets from the recordings themselves."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.bundle import Bundle
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.frame_choice import choose_frames, marker_distances, sample_frames
from graspdb_ingest.tracking.geometry import HandGeometry
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.manifest import MarkerPlacement

ROUGH_SD: Final = 0.003
"""Spread of markers about a hand that nobody has fitted yet, besides that of their places [m]."""
LEARNED: Final = 0.9
"""A length whose standard deviation stays above this share of anthropometry's was not learned."""


@dataclass(frozen=True)
class Calibration:
    """A hand fitted to a subject.

    Attributes
    ----------
    hand : HandModel
        The calibrated hand.
    before, after : ndarray, shape (n_markers,)
        Rms distance of each marker to the model over the chosen frames, with the hand as
        anthropometry and manifest give it, and calibrated [m]; NaN for a marker never seen.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker about its place, each axis, noise and skin movement [m].
    length_sd : mapping of str to float
        Standard deviation of each segment's length [m]; empty for a hand whose bones are given.
    n_frames : int
        Number of frames used.
    notes : tuple of str
        What the recordings could not tell, and what stands in for it.
    """

    hand: HandModel
    before: Floats
    after: Floats
    marker_sd: Floats
    length_sd: Mapping[str, float]
    n_frames: int
    notes: tuple[str, ...]


def calibrate_hand(
    hand: HandModel,
    placements: Mapping[str, MarkerPlacement],
    recordings: Iterable[Floats],
    prior: PosturePrior,
    marker_sd: float,
) -> Calibration:
    """Fit a hand's shape and marker offsets to recordings of it.

    Parameters
    ----------
    hand : HandModel
        The hand to start from, markers where the manifest or its segment's middle puts them.
    placements : mapping of str to MarkerPlacement
        Where each marker sits.
    recordings : iterable of ndarray, each of shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen; taken one after the other.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : float
        Usual standard deviation of a marker about its place on the segment [m].

    Returns
    -------
    Calibration
        The fitted hand and its residuals.

    Raises
    ------
    TrackingError
        If too few frames show enough markers, or the hand does not move enough to find markers
        whose places are unknown.
    """
    frames = choose_frames(sample_frames(recordings))
    _check_movement(frames, hand, placements, marker_sd)
    geometry, kinematics = HandGeometry(hand, placements), Kinematics(hand)
    rough_sd = np.hypot(geometry.marker_sd.max(axis=1), ROUGH_SD)
    fits = [fit_frame(kinematics, frame, prior, rough_sd) for frame in frames]
    postures = [fit.q for fit in fits]
    start = _first_offsets(geometry, kinematics, frames, postures)
    # Chosen frames differ as much as they can, so they are no independent draws from the prior: it
    # counts once for all of them. Once for each, it would bend the shape to make postures usual.
    once = PosturePrior(prior.mean, len(frames) * prior.covariance)
    found = Bundle(geometry, frames, once, marker_sd).solve(start, postures)
    length_sd = geometry.length_sd(found.parameters, found.covariance)
    return Calibration(
        hand=hand.reshaped(geometry.shape(found.parameters)),
        before=_rms_by_marker(np.array([fit.residuals for fit in fits])),
        after=_rms_by_marker(found.residuals),
        marker_sd=found.marker_sd,
        length_sd=length_sd,
        n_frames=len(frames),
        notes=tuple(_notes(geometry, length_sd, frames)),
    )


def _check_movement(
    frames: Floats, hand: HandModel, placements: Mapping[str, MarkerPlacement], marker_sd: float
) -> None:
    """Refuse a hand that keeps still where the places of its digits' markers have to be found."""
    distances = marker_distances(frames)
    distances = distances[:, np.isfinite(distances).sum(axis=0) > 1]
    moved = float(np.max(np.nanstd(distances, axis=0), initial=0.0))
    unknown = [
        label
        for label in hand.markers
        if placements[label].calibrated and placements[label].segment not in ("forearm", "hand")
    ]
    # the distance of two markers that keep still scatters by sqrt(2) of a marker's deviation
    if unknown and moved < 3 * np.sqrt(2) * marker_sd:
        raise TrackingError(
            f"the {hand.side} hand's posture hardly changes: no distance between two of its markers varies "
            f"by more than {1e3 * moved:.1f} mm (standard deviation), so the places of "
            f"{', '.join(unknown)} cannot be told from joint angles",
            "Name a range-of-motion recording in the subject's calibration, or give the markers' offsets.",
        )


def _notes(geometry: HandGeometry, length_sd: Mapping[str, float], frames: Floats) -> Iterable[str]:
    counts = visible(frames).sum(axis=0)
    unseen = [label for i, label in enumerate(geometry.hand.markers) if counts[i] == 0]
    if unseen:
        yield f"never seen, left where the manifest puts them: {', '.join(unseen)}"
    # The whole hand's size is known from the other segments, so only a length's own spread counts.
    own = geometry.prior_sd**2 * (np.arange(geometry.n_parameters) > 0)
    usual = geometry.length_sd(np.zeros(geometry.n_parameters), np.diag(own))
    kept = [segment for segment, sd in length_sd.items() if sd > LEARNED * usual[segment]]
    if kept:
        yield f"the recordings do not tell these lengths, anthropometry's are kept: {', '.join(kept)}"


def _first_offsets(
    geometry: HandGeometry, kinematics: Kinematics, frames: Floats, postures: Sequence[Floats]
) -> Floats:
    """Return parameters with the offsets of the markers to be found at their median over the frames."""
    local = np.full(frames.shape, np.nan)
    bodies = [int(kinematics.model.site_bodyid[i]) for i in kinematics.hand.marker_ids]
    nominal = np.array([kinematics.model.site_pos[i] for i in kinematics.hand.marker_ids])
    for i, (frame, q) in enumerate(zip(frames, postures, strict=True)):
        kinematics.move(q)
        arms = frame - kinematics.body_positions[bodies]
        local[i] = np.einsum("mji,mj->mi", kinematics.body_rotations[bodies], arms)
    parameters = np.zeros(geometry.n_parameters)
    offsets = parameters[-3 * frames.shape[1] :].reshape(-1, 3)
    for m, label in enumerate(kinematics.hand.markers):
        seen = np.isfinite(local[:, m, 0])
        if geometry.placements[label].calibrated and seen.any():
            offsets[m] = np.median(local[seen, m], axis=0) - nominal[m]
    return parameters


def _rms_by_marker(residuals: Floats) -> Floats:
    squared = np.sum(residuals**2, axis=2)
    seen = np.isfinite(squared)
    total = np.where(seen, squared, 0).sum(axis=0)
    unseen = np.full(len(total), np.nan)
    mean: Floats = np.divide(total, seen.sum(axis=0), out=unseen, where=seen.any(axis=0))
    return np.sqrt(mean)
