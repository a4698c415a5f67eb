"""A clip beside its object: gaps, contacts and holds of its hands, fitted with the hand model or not."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from graspdb_ingest.contact_events import (
    UNKNOWN,
    ContactEvent,
    States,
    contact_events,
    contact_states,
)
from graspdb_ingest.events import Hold, find_holds
from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.base import Clip, ClipHand
from graspdb_ingest.importers.fit import FittedHand, fit_hand
from graspdb_ingest.objects.pose import ObjectTrack
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.rigid import (
    continuous_signs,
    inverse_transform_points,
    quaternions_from_rotations,
)
from graspdb_ingest.surface import HandPoints
from graspdb_ingest.surface.touch import PosedHand, pose_hand
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import N_SITES, Side


@dataclass(frozen=True, eq=False)
class FollowedHand:
    """A hand of a clip and what it did with the object.

    Attributes
    ----------
    side : Side
        Which hand.
    key_points : ndarray, shape (n_frames, 21, 3)
        Wrist and sites in the clip's frame [m].
    extrapolated : tuple of str
        Those of them that the data set does not have.
    dimensions : HandDimensions
        Size of the hand.
    posed : PosedHand
        Its surface and gaps, object frame; NaN where hand or object is not known.
    states : ndarray of int, shape (n_frames, 20)
        Whether each site touches, is free, or is unknown.
    events : tuple of ContactEvent
        When each site touched; none in static postures.
    holds : tuple of Hold
        When the hand held the object; in static postures, each known frame.
    fit : FittedHand or None
        The hand model fitted to the key points, if that was asked for; the key points are then its.
    """

    side: Side
    key_points: Floats
    extrapolated: tuple[str, ...]
    dimensions: HandDimensions
    posed: PosedHand
    states: States
    events: tuple[ContactEvent, ...]
    holds: tuple[Hold, ...]
    fit: FittedHand | None = None


@dataclass(frozen=True, eq=False)
class FollowedClip:
    """A clip in which everything has been followed.

    Attributes
    ----------
    clip : Clip
        The clip.
    object : PreparedObject or None
        Its object.
    track : ObjectTrack
        The object's pose in every frame.
    hands : tuple of FollowedHand
        Its hands.
    """

    clip: Clip
    object: PreparedObject | None
    track: ObjectTrack
    hands: tuple[FollowedHand, ...]

    @property
    def times(self) -> Floats:
        """Time of each frame [s], shape (n_frames,); static postures have no time but zero."""
        if self.clip.rate is None:
            return np.zeros(self.clip.n_frames)
        return np.asarray(np.arange(self.clip.n_frames) / self.clip.rate)


def follow_clip(
    clip: Clip,
    dimensions: Mapping[Side, HandDimensions],
    prepared: PreparedObject | None,
    parameters: IngestParameters,
    models: Mapping[Side, PreparedHand] | None = None,
) -> FollowedClip:
    """Follow the hands of a clip beside its object.

    Parameters
    ----------
    clip : Clip
        The clip, checked.
    dimensions : mapping of Side to HandDimensions
        Size of each hand.
    prepared : PreparedObject or None
        The object.
    parameters : IngestParameters
        Thresholds.
    models : mapping of Side to PreparedHand, optional
        Hand models to fit to the key points; without, the key points are taken as they are.

    Raises
    ------
    ParameterError
        If the object's poses are not rigid.
    TrackingError
        If a model cannot be fitted.
    """
    track = object_track(clip)
    hands = []
    for hand in clip.hands:
        fit = None
        if models is not None:
            fit = fit_hand(models[hand.side], hand.key_points, clip.rate, parameters)
            hand = replace(hand, key_points=fit.key_points)
        hands.append(_follow(clip, hand, fit, dimensions[hand.side], prepared, track, parameters))
    return FollowedClip(clip, prepared, track, tuple(hands))


def object_track(clip: Clip) -> ObjectTrack:
    """Return the object's pose in every frame of a clip; where it has none, the frame is the object's.

    Raises
    ------
    ParameterError
        If the poses are not rigid.
    """
    n = clip.n_frames
    poses = np.tile(np.eye(4), (n, 1, 1)) if clip.poses is None else np.array(clip.poses, dtype=np.float64)
    known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    rotations = np.where(known[:, None, None], poses[:, :3, :3], np.nan)
    square = np.einsum("nji,njk->nik", rotations[known], rotations[known])
    turned = np.linalg.det(rotations[known])
    if known.any() and not (np.abs(square - np.eye(3)).max() < 1e-2 and (turned > 0).all()):
        raise ParameterError("poses", "rotations that are none", "rigid poses, (n_frames, 4, 4)")
    quaternions = quaternions_from_rotations(rotations)
    positions = np.where(known[:, None], poses[:, :3, 3], np.nan)
    none = np.full(n, np.nan)
    return ObjectTrack(
        positions,
        rotations,
        continuous_signs(quaternions),
        none,
        np.zeros(n, dtype=np.int64),
        np.zeros((n, 0), dtype=np.bool_),
    )


def _follow(
    clip: Clip,
    hand: ClipHand,
    fit: FittedHand | None,
    dimensions: HandDimensions,
    prepared: PreparedObject | None,
    track: ObjectTrack,
    parameters: IngestParameters,
) -> FollowedHand:
    """Return a hand's gaps to the object, when its sites touched, and when it held."""
    points, n = hand.key_points, clip.n_frames
    in_object = np.full(points.shape, np.nan)
    if prepared is not None:
        in_object = inverse_transform_points(
            track.rotations, track.positions, np.asarray(points, dtype=np.float64)
        )
    located = HandPoints(in_object, dimensions.radii, hand.side)
    target = None if prepared is None else prepared.distance
    posed = pose_hand(located, parameters.contact.surface, target)
    states: States = np.full((n, N_SITES), UNKNOWN, dtype=np.int8)
    events: tuple[ContactEvent, ...] = ()
    holds: tuple[Hold, ...] = ()
    if prepared is not None:
        threshold, timing = parameters.contact.threshold, parameters.events
        # Static postures follow one another by chance, so none keeps the state of the one before.
        margin = timing.release_margin if clip.rate else 0.0
        # Of the three directions of space one lies along the gap.
        sd = None if fit is None or fit.sites_sd is None else fit.sites_sd / np.sqrt(3)
        states = contact_states(posed.gaps.gap, sd, threshold, margin)
        if clip.rate is None:
            holds = _static(posed)
        else:
            events = contact_events(states, clip.rate, timing)
            holds = _moving(clip, points, posed, prepared, track, clip.rate, parameters)
    return FollowedHand(hand.side, points, hand.extrapolated, dimensions, posed, states, events, holds, fit)


def _static(posed: PosedHand) -> tuple[Hold, ...]:
    """Return each frame in which hand and object are known as a hold of its own."""
    known = np.flatnonzero(np.isfinite(posed.gaps.gap).any(axis=1)).tolist()
    return tuple(Hold(frame, frame, False, None, None, frame, "static") for frame in known)


def _moving(
    clip: Clip,
    points: Floats,
    posed: PosedHand,
    prepared: PreparedObject,
    track: ObjectTrack,
    rate: float,
    parameters: IngestParameters,
) -> tuple[Hold, ...]:
    times = np.arange(clip.n_frames) / rate
    cloud = prepared.cloud
    middle = np.einsum("nij,j->ni", track.rotations, cloud.points.mean(axis=0)) + track.positions
    sites = points[:, 1:]
    # With no vertical nothing rises: along a direction of no length all heights are equal.
    up = np.zeros(3) if clip.up is None else np.array(clip.up, dtype=np.float64)
    return find_holds(
        times, posed.gaps.gap, middle, sites, up, parameters.contact.threshold, parameters.events
    )
