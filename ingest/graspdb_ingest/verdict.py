"""Whether a tracked hand may be believed: the verdict on a trial, with its reasons."""

from collections.abc import Iterator

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.tracker import HandTrack
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.vocabulary import Side

COMPARED_FRAMES = 3
"""Frames in which a hand that fits badly is compared with the other hand."""


def check_track(
    track: HandTrack,
    hand: HandModel,
    markers: Floats,
    prior: PosturePrior,
    side: Side,
    parameters: TrackingParameters,
) -> None:
    """Raise an error with all reasons for which a track is not to be believed.

    Parameters
    ----------
    track : HandTrack
        The tracked hand.
    hand : HandModel
        Its model.
    markers : ndarray, shape (n_frames, n_markers, 3)
        Its markers as recorded [m].
    prior : PosturePrior
        Where joints usually are.
    side : Side
        Which hand it is said to be.
    parameters : TrackingParameters
        The thresholds.

    Raises
    ------
    TrackingError
        If the hand is known too seldom or too badly, or does not fit its markers.
    """
    reasons = [*_unknown(track, parameters), *_unfit(track, hand, markers, prior, parameters)]
    if reasons:
        raise TrackingError(
            f"the {side} hand {'; it '.join(reasons)}",
            "Check the labels, the hand's side and its size; cut the trial with start and end, or "
            "record it again.",
        )


def _unknown(track: HandTrack, parameters: TrackingParameters) -> Iterator[str]:
    share = float(track.tracked.mean())
    if share < parameters.minimum_tracked:
        yield f"is known in {share:.0%} of the frames, less than {parameters.minimum_tracked:.0%}"
    typical = np.median(track.sites_sd[track.tracked], axis=1)
    unsure = float((typical > parameters.uncertain_sd).mean()) if len(typical) else 0.0
    if unsure > parameters.maximum_uncertain:
        yield (
            f"is known to no better than {1e3 * parameters.uncertain_sd:g} mm in {unsure:.0%} of these "
            f"frames, more than {parameters.maximum_uncertain:.0%}"
        )


def _unfit(
    track: HandTrack, hand: HandModel, markers: Floats, prior: PosturePrior, parameters: TrackingParameters
) -> Iterator[str]:
    distances = np.linalg.norm(track.residuals, axis=2)
    seen = np.isfinite(distances)
    if not seen.any():
        return
    rejected = float((seen & ~track.used).sum() / seen.sum())
    if rejected > parameters.maximum_rejected:
        yield (
            f"had to do without {rejected:.0%} of its seen markers, which fit no movement of it "
            f"(more than {parameters.maximum_rejected:.0%})"
        )
    median = float(np.nanmedian(distances))
    if median > parameters.maximum_residual:
        yield (
            f"lies {1e3 * median:.1f} mm from its markers (median), "
            f"more than {1e3 * parameters.maximum_residual:g} mm"
        )
    if median > parameters.maximum_residual / 3:
        own, mirrored = _mirrored_fit(hand, markers[track.tracked], prior, parameters)
        if mirrored < own / 2:
            yield (
                f"lies {1e3 * own:.1f} mm from its markers where the other hand would lie "
                f"{1e3 * mirrored:.1f} mm from them, so it is the other hand"
            )


def _mirrored_fit(
    hand: HandModel, markers: Floats, prior: PosturePrior, parameters: TrackingParameters
) -> tuple[float, float]:
    """Return the median rms distance [m] of some well-seen frames to the hand, and of their mirror image."""
    kinematics, sd = Kinematics(hand), np.full(len(hand.markers), parameters.marker_sd)
    counts = visible(markers).sum(axis=1)
    best = np.argsort(-counts, kind="stable")[: max(COMPARED_FRAMES, len(counts) // 4)]
    chosen = np.sort(best)[np.linspace(0, len(best) - 1, COMPARED_FRAMES).astype(int)]
    fits = [
        [fit_frame(kinematics, frame @ turned, prior, sd).rms for frame in markers[chosen]]
        for turned in (np.eye(3), np.diag([-1.0, 1.0, 1.0]))
    ]
    own, mirrored = np.median(fits, axis=1)
    return float(own), float(mirrored)
