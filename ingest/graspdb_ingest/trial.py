"""One trial from its recording to its rows: track, gap, hold, contact, enclose, describe."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.contact_events import UNKNOWN, ContactEvent, States, contact_events, contact_states
from graspdb_ingest.events import Hold, find_holds
from graspdb_ingest.glove_angles import GloveAngles
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.live import CloudTrack
from graspdb_ingest.objects.live_surface import LiveSurface
from graspdb_ingest.objects.pose import ObjectTrack, track_object
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.rigid import inverse_transform_points
from graspdb_ingest.surface import HandPoints, key_points
from graspdb_ingest.surface.touch import PosedHand, pose_hand
from graspdb_ingest.tracking.correction import JointReadings
from graspdb_ingest.tracking.fit import FREE, SEVEN
from graspdb_ingest.tracking.glove import GloveFit, fit_glove
from graspdb_ingest.tracking.tracker import HandTrack, track_hand
from graspdb_ingest.trial_markers import TrialMarkers
from graspdb_ingest.verdict import check_track
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class TrackedObject:
    """The object of a trial: what it is and where it was.

    Attributes
    ----------
    model : PreparedObject or LiveSurface
        Surface, cloud and histograms; or the live clouds that are all that is known of it.
    track : ObjectTrack
        Pose in every frame.
    fitness : ndarray, shape (n_frames,), or None
        Fitness of the registration to a live cloud; None where markers told the pose.
    """

    model: PreparedObject | LiveSurface
    track: ObjectTrack
    fitness: Floats | None = None

    def pose_hand(self, points: HandPoints, surface: str) -> PosedHand:
        """Return a hand's surface and gaps, for key points of shape (n_frames, 21, 3) in the object frame."""
        if isinstance(self.model, PreparedObject):
            return pose_hand(points, surface, self.model.distance)
        posed = pose_hand(points, surface, None)
        for number, live in enumerate(self.model.clouds):
            frames = np.flatnonzero(self.model.of_frame == number)
            if len(frames):
                some = replace(points, key_points=points.key_points[frames])
                posed.gaps.fill(frames, pose_hand(some, surface, live.distance).gaps)
        return posed

    @property
    def middle(self) -> Floats:
        """The object's middle in every frame, lab frame [m], shape (n_frames, 3)."""
        pose = self.track
        if not isinstance(self.model, PreparedObject):
            return pose.positions
        middle = self.model.cloud.points.mean(axis=0)
        return np.asarray(np.einsum("nij,j->ni", pose.rotations, middle) + pose.positions)


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
    posed : PosedHand
        Its surface and gaps in every frame, NaN where hand or object is not known.
    states : ndarray of int, shape (n_frames, 20)
        Whether each site touches, is free, or is unknown.
    events : tuple of ContactEvent
        When each site touched.
    holds : tuple of Hold
        When the hand held the object.
    glove : GloveFit or None
        What its data glove was worth, where it wore one.
    """

    prepared: PreparedHand
    track: HandTrack
    sites_object: Floats
    posed: PosedHand
    states: States
    events: tuple[ContactEvent, ...]
    holds: tuple[Hold, ...]
    glove: GloveFit | None = None


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
    gloves: Mapping[Side, GloveAngles] | None = None,
    clouds: CloudTrack | LiveSurface | None = None,
) -> TrackedTrial:
    """Follow the hands and the object of a trial, and find the holds.

    Parameters
    ----------
    markers : TrialMarkers
        The recording, by hand and object.
    hands : mapping of Side to PreparedHand
        The subject's calibrated hands.
    prepared : PreparedObject or None
        The object, where there is a model of it.
    up : ndarray, shape (3,)
        Vertical of the lab frame.
    parameters : IngestParameters
        All thresholds.
    gloves : mapping of Side to GloveAngles, optional
        Data gloves that the hands wore.
    clouds : CloudTrack or LiveSurface, optional
        The object as followed in live clouds, in place of its markers, or as they alone show it.

    Raises
    ------
    TrackingError
        If a hand cannot be followed, or not in enough frames, or does not fit its markers.
    """
    followed = _follow_object(markers, prepared, clouds, parameters)
    tracked = {}
    for side, hand in hands.items():
        positions, rate = markers.hands[side], markers.recording.rate
        track = follow(hand, positions, rate, parameters)
        glove = None
        if gloves is not None and side in gloves:
            glove = _compare(gloves[side], hand, markers, track, parameters)
            track = follow(hand, positions, rate, parameters, glove.measurement)
        check_track(track, hand.hand, positions, hand.prior, side, parameters.tracking)
        tracked[side] = replace(_with_holds(hand, track, followed, markers, up, parameters), glove=glove)
    return TrackedTrial(markers, followed, tracked)


def _follow_object(
    markers: TrialMarkers,
    prepared: PreparedObject | None,
    clouds: CloudTrack | LiveSurface | None,
    parameters: IngestParameters,
) -> TrackedObject | None:
    if isinstance(clouds, LiveSurface):
        return TrackedObject(clouds, clouds.track, clouds.fitness)
    if prepared is None:
        return None
    if clouds is not None:
        return TrackedObject(prepared, clouds.track, clouds.fitness)
    places = np.asarray(prepared.marker_positions, dtype=np.float64)
    return TrackedObject(prepared, track_object(markers.object_markers, places, parameters.pose))


def follow(
    hand: PreparedHand,
    markers: Floats,
    rate: float,
    parameters: IngestParameters,
    glove: JointReadings | None = None,
) -> HandTrack:
    """Follow one prepared hand through markers of shape (n_frames, n_markers, 3) [m] at a rate [Hz]."""
    return track_hand(
        hand.hand,
        markers,
        rate,
        hand.prior,
        parameters.tracking,
        glove,
        hand.noise,
        hand.marker_sd,
    )


def _compare(
    glove: GloveAngles,
    hand: PreparedHand,
    markers: TrialMarkers,
    track: HandTrack,
    parameters: IngestParameters,
) -> GloveFit:
    """Compare a glove with the hand that was followed by its markers alone."""
    angles, angles_sd = track.q[:, SEVEN:], track.q_sd[:, FREE:]
    return fit_glove(glove, hand.hand, markers.times, angles, angles_sd, parameters.glove)


def _with_holds(
    hand: PreparedHand,
    track: HandTrack,
    followed: TrackedObject | None,
    markers: TrialMarkers,
    up: Floats,
    parameters: IngestParameters,
) -> TrackedHand:
    n_frames = len(markers.times)
    sites, wrists = np.full((n_frames, 20, 3), np.nan), np.full((n_frames, 3), np.nan)
    if followed is not None:
        pose = followed.track
        sites = inverse_transform_points(
            pose.rotations, pose.positions, np.asarray(track.sites, dtype=np.float64)
        )
        wrists = inverse_transform_points(pose.rotations, pose.positions, _wrists(hand, track))[:, 0]
    points = HandPoints(key_points(wrists, sites), hand.hand.radii, hand.hand.side)
    name, threshold, timing = parameters.contact.surface, parameters.contact.threshold, parameters.events
    if followed is None:
        posed = pose_hand(points, name, None)
        states = np.full((n_frames, 20), UNKNOWN, dtype=np.int8)
        return TrackedHand(hand, track, sites, posed, states, (), ())
    posed = followed.pose_hand(points, name)
    gap = posed.gaps.gap
    holds = find_holds(markers.times, gap, followed.middle, track.sites, up, threshold, timing)
    # Of the three directions of space one lies along the gap.
    states = contact_states(gap, track.sites_sd / np.sqrt(3), threshold, timing.release_margin)
    events = contact_events(states, markers.recording.rate, timing)
    return TrackedHand(hand, track, sites, posed, states, events, holds)


def _wrists(hand: PreparedHand, track: HandTrack) -> NDArray[np.float64]:
    """Return the palm's origin, the wrist, in every frame, lab frame [m], shape (n_frames, 1, 3)."""
    wrists = np.full((len(track.q), 1, 3), np.nan)
    wrists[track.tracked, 0] = hand.hand.palms(track.q[track.tracked])[0]
    return wrists
