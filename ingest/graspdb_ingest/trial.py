"""One trial from its recording to its rows: track, gap, hold, contact, enclose, describe."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from graspdb_ingest.contact import Gaps, no_gaps, signed_gaps
from graspdb_ingest.events import Hold, find_holds
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.pose import ObjectTrack, track_object
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand, PreparedObject
from graspdb_ingest.rigid import inverse_transform_points
from graspdb_ingest.tracking.tracker import HandTrack, track_hand
from graspdb_ingest.trial_markers import TrialMarkers
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class TrackedObject:
    """The object of a trial: what it is and where it was.

    Attributes
    ----------
    prepared : PreparedObject
        Surface, cloud and histograms.
    track : ObjectTrack
        Pose in every frame.
    """

    prepared: PreparedObject
    track: ObjectTrack


@dataclass(frozen=True)
class TrackedHand:
    """A hand of a trial: where it was, its gaps to the object, and when it held it.

    Attributes
    ----------
    prepared : PreparedHand
        The calibrated hand.
    track : HandTrack
        Posture in every frame.
    sites_object : ndarray, shape (n_frames, 20, 3)
        Sphere centres in the object frame [m], NaN where hand or object is not known.
    gaps : Gaps
        Signed distances in every frame, NaN where hand or object is not known.
    holds : tuple of Hold
        When the hand held the object.
    """

    prepared: PreparedHand
    track: HandTrack
    sites_object: Floats
    gaps: Gaps
    holds: tuple[Hold, ...]


@dataclass(frozen=True)
class TrackedTrial:
    """A trial in which everything has been followed.

    Attributes
    ----------
    markers : TrialMarkers
        What was recorded.
    object : TrackedObject or None
        The object.
    hands : mapping of Side to TrackedHand
        The hands.
    """

    markers: TrialMarkers
    object: TrackedObject | None
    hands: Mapping[Side, TrackedHand]


def track_trial(
    markers: TrialMarkers,
    hands: Mapping[Side, PreparedHand],
    prepared: PreparedObject | None,
    up: Floats,
    parameters: IngestParameters,
) -> TrackedTrial:
    """Follow the hands and the object of a trial, and find the holds.

    Parameters
    ----------
    markers : TrialMarkers
        The recording, by hand and object.
    hands : mapping of Side to PreparedHand
        The subject's calibrated hands.
    prepared : PreparedObject or None
        The object.
    up : ndarray, shape (3,)
        Vertical of the lab frame.
    parameters : IngestParameters
        All thresholds.

    Raises
    ------
    TrackingError
        If a hand cannot be followed, or not in enough frames, or does not fit its markers.
    """
    followed = None
    if prepared is not None:
        followed = TrackedObject(
            prepared,
            track_object(
                markers.object_markers,
                np.asarray(prepared.marker_positions, dtype=np.float64),
                parameters.pose,
            ),
        )
    tracked = {}
    for side, hand in hands.items():
        track = follow(hand, markers.hands[side], markers.recording.rate, parameters)
        _check(track, side, parameters)
        tracked[side] = _with_holds(hand, track, followed, markers, up, parameters)
    return TrackedTrial(markers, followed, tracked)


def follow(hand: PreparedHand, markers: Floats, rate: float, parameters: IngestParameters) -> HandTrack:
    """Follow one prepared hand through markers of shape (n_frames, n_markers, 3) [m] at a rate [Hz]."""
    return track_hand(hand.hand, markers, rate, hand.prior, parameters.tracking)


def _check(track: HandTrack, side: Side, parameters: IngestParameters) -> None:
    share = float(track.tracked.mean())
    if share < parameters.tracking.minimum_tracked:
        raise TrackingError(
            f"the {side} hand is known in {share:.0%} of the frames",
            f"At least {parameters.tracking.minimum_tracked:.0%} are needed: record it again, or cut "
            "the trial with start and end.",
        )
    median = float(np.nanmedian(np.linalg.norm(track.residuals, axis=2)))
    if median > parameters.tracking.maximum_residual:
        raise TrackingError(
            f"the {side} hand's markers lie {1e3 * median:.1f} mm from the tracked hand (median)",
            f"At most {1e3 * parameters.tracking.maximum_residual:g} mm are allowed: check the labels, "
            "the hand's side and its size.",
        )


def _with_holds(
    hand: PreparedHand,
    track: HandTrack,
    followed: TrackedObject | None,
    markers: TrialMarkers,
    up: Floats,
    parameters: IngestParameters,
) -> TrackedHand:
    if followed is None:
        nowhere = np.full(track.sites.shape, np.nan)
        return TrackedHand(hand, track, nowhere, no_gaps(nowhere), ())
    pose, cloud = followed.track, followed.prepared.cloud
    sites_object = inverse_transform_points(
        pose.rotations, pose.positions, np.asarray(track.sites, dtype=np.float64)
    )
    gaps = signed_gaps(sites_object, hand.hand.radii, cloud)
    middle = np.einsum("nij,j->ni", pose.rotations, cloud.points.mean(axis=0)) + pose.positions
    holds = find_holds(
        markers.times,
        gaps.gap,
        middle,
        track.sites,
        up,
        parameters.contact.threshold,
        parameters.events,
    )
    return TrackedHand(hand, track, sites_object, gaps, holds)
