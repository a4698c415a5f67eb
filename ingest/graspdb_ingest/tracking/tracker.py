"""A hand followed through a recording: forward and backward, until faults and liveliness are known."""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.activity import next_activity, noise_ratio, parts_of
from graspdb_ingest.tracking.correction import JointReadings
from graspdb_ingest.tracking.faults import (
    Fault,
    find_breaks,
    find_drifts,
    find_frozen,
    find_swaps,
    judge,
    without,
)
from graspdb_ingest.tracking.fit import visible
from graspdb_ingest.tracking.following import Stretch, follow, make_follower
from graspdb_ingest.tracking.motion import MotionNoise, motion_model
from graspdb_ingest.tracking.placing import moved_within_limits, point_positions, point_spreads
from graspdb_ingest.tracking.smoother import Disturbances, ForwardPass, Record, Smoothed
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.vocabulary import N_SITES


@dataclass(frozen=True)
class HandTrack:
    """A hand in every frame of a recording.

    Attributes
    ----------
    q : ndarray, shape (n_frames, n_q)
        Configurations, NaN before the hand was found.
    q_sd : ndarray, shape (n_frames, n_dof)
        Standard deviations of the degrees of freedom.
    sites : ndarray, shape (n_frames, 20, 3)
        Centres of the spheres [m].
    sites_sd : ndarray, shape (n_frames, 20)
        Their standard deviations in space, the root of the trace of each one's covariance: the root
        mean square distance to its true place that is to be expected [m].
    residuals : ndarray, shape (n_frames, n_markers, 3)
        Observed minus tracked marker positions [m], rejected markers included, NaN where not seen.
    used : ndarray of bool, shape (n_frames, n_markers)
        Markers that were seen and passed the gate.
    at_limit : ndarray of bool, shape (n_frames,)
        Where a joint was held at its limit.
    faults : tuple of Fault
        Stretches in which labels were not on their markers: exchanged ones were put right, the
        others left out.
    """

    q: Floats
    q_sd: Floats
    sites: Floats
    sites_sd: Floats
    residuals: Floats
    used: Bools
    at_limit: Bools
    faults: tuple[Fault, ...] = ()

    @property
    def tracked(self) -> Bools:
        """Frames in which the hand is known, shape (n_frames,)."""
        return np.asarray(np.isfinite(self.q[:, 0]))

    @property
    def residual_rms(self) -> Floats:
        """Rms distance of the used markers to the hand in each frame [m], shape (n_frames,)."""
        squared = np.where(self.used, np.sum(self.residuals**2, axis=2), 0.0)
        counts = self.used.sum(axis=1)
        none = np.full(len(counts), np.nan)
        mean: Floats = np.divide(squared.sum(axis=1), counts, out=none, where=counts > 0)
        return np.sqrt(mean)


def track_hand(
    hand: HandModel,
    markers: Floats,
    rate: float,
    prior: PosturePrior,
    parameters: TrackingParameters,
    glove: JointReadings | None = None,
    noise: MotionNoise | None = None,
    marker_sd: Floats | None = None,
) -> HandTrack:
    """Follow a hand through a recording.

    A first pass forward and backward shows which markers are faulty. A second one, without them, and the
    first say how lively the hand moves from moment to moment; the last one knows both.

    Parameters
    ----------
    hand : HandModel
        The calibrated hand.
    markers : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], in the order of ``hand.markers``, NaN where not seen.
    rate : float
        Frames per second [Hz].
    prior : PosturePrior
        Where joints usually are.
    parameters : TrackingParameters
        Gate and thresholds.
    glove : JointReadings, optional
        Joint angles of a data glove, in every frame.
    noise : MotionNoise, optional
        Scales of movement and marker noise; those that the parameters assume where left out.
    marker_sd : ndarray, shape (n_markers,), optional
        Standard deviation that each marker has at the least, as calibration found it [m].

    Returns
    -------
    HandTrack
        The hand in every frame from the first that shows enough markers on.

    Raises
    ------
    TrackingError
        If no frame has enough markers to start from.
    """
    enough = visible(markers).sum(axis=1) >= parameters.minimum_start_markers
    if not enough.any():
        raise TrackingError(
            f"no frame shows {parameters.minimum_start_markers} of the hand's {len(hand.markers)} markers",
            "Check marker_names in session.yaml, or the recording's labels.",
        )
    noise = MotionNoise.assumed(parameters) if noise is None else noise
    least = np.zeros(len(hand.markers)) if marker_sd is None else marker_sd
    deviations = np.maximum(least, noise.marker_sd)
    passes = _Passes(hand, rate, prior, parameters, glove, noise, deviations, len(markers))
    usual, parts = np.ones((len(markers), hand.n_dof)), parts_of(hand)
    first = _first_pass(passes, markers, rate, deviations, usual)
    # What the first pass left out stays out, and the later ones gate nothing: where a hand that kept still
    # sets out, a calm filter would take its markers for wrong.
    repaired, later = without(markers, first.faults), passes.without_gate()
    repaired[first.rejected] = np.nan
    track, disturbances = first.track, first.disturbances
    relabelled = without(markers, [fault for fault in first.faults if fault.kind == "swapped"])
    if not np.array_equal(repaired, first.used, equal_nan=True):
        track, disturbances = later.track(relabelled, repaired, usual)
    left = np.where(track.used[..., None], track.residuals, np.nan) / deviations[:, None]
    ratio = noise_ratio(left, disturbances, rate)
    activity = next_activity(disturbances, parts, rate, usual, ratio)
    activity = next_activity(later.disturbances(repaired, activity), parts, rate, activity, ratio)
    return replace(later.track(relabelled, repaired, activity, spreads=True)[0], faults=first.faults)


@dataclass(frozen=True)
class _FirstPass:
    """What a gated pass with the usual process noise shows.

    Attributes
    ----------
    track : HandTrack
        The hand as it was tracked.
    disturbances : Disturbances
        What moved it.
    faults : tuple of Fault
        Which labels were not on their markers.
    rejected : ndarray of bool, shape (n_frames, n_markers)
        Markers that did not pass the gate, but for exchanged ones that are put right.
    used : ndarray, shape (n_frames, n_markers, 3)
        Markers as the pass used them [m], NaN where it used none.
    """

    track: HandTrack
    disturbances: Disturbances
    faults: tuple[Fault, ...]
    rejected: Bools
    used: Floats


def _first_pass(
    passes: "_Passes", markers: Floats, rate: float, deviations: Floats, usual: Floats
) -> _FirstPass:
    """Track with a gate, and judge which markers are faulty."""
    frozen = list(find_frozen(markers, rate))
    kept = without(markers, frozen)
    suspects = find_breaks(kept, rate, float(deviations.max()))
    trusted = without(kept, [replace(suspect, kind="jumping") for suspect in suspects])
    track, disturbances = passes.track(markers, trusted, usual)
    modelled = markers - track.residuals
    outside = visible(trusted) & ~track.used
    swaps = list(find_swaps(trusted, modelled, outside))
    put_right, rejected = _put_right(trusted, outside, swaps)
    faults = (
        *frozen,
        *judge(suspects, kept, modelled, rate),
        *swaps,
        *find_drifts(put_right - modelled, rejected, rate, deviations),
    )
    used = np.where(outside[..., None], np.nan, trusted)
    return _FirstPass(track, disturbances, faults, rejected, used)


def _put_right(markers: Floats, rejected: Bools, swaps: list[Fault]) -> tuple[Floats, Bools]:
    """Return markers and rejections with exchanged labels put right."""
    rejected = rejected.copy()
    for fault in swaps:
        rejected[fault.start : fault.stop, list(fault.markers)] = False
    return without(markers, swaps), rejected


class _Passes:
    """Forward and backward passes over one recording."""

    def __init__(
        self,
        hand: HandModel,
        rate: float,
        prior: PosturePrior,
        parameters: TrackingParameters,
        glove: JointReadings | None,
        noise: MotionNoise,
        marker_sd: Floats,
        n_frames: int,
    ) -> None:
        self._hand, self._rate = hand, rate
        self._prior, self._parameters, self._glove = prior, parameters, glove
        self._noise, self._marker_sd = noise, marker_sd
        self._kinematics = Kinematics(hand)
        self._motion = motion_model(hand, prior, noise, 1 / rate)
        self._forward = ForwardPass(n_frames, hand.n_dof, len(hand.markers))
        self._gated = True

    def without_gate(self) -> "_Passes":
        """Return the same passes, in which every marker counts."""
        other = copy(self)
        other._gated = False
        return other

    def track(
        self, relabelled: Floats, repaired: Floats, activity: Floats, spreads: bool = False
    ) -> tuple[HandTrack, Disturbances]:
        """Return the smoothed track of the repaired markers, and what disturbed it.

        Residuals are those of all markers; `activity` are factors on the standard deviation of the process
        noise, shape (n_frames, n_dof). Sites and standard deviations are left out but for `spreads`.
        """
        track, disturbances = _empty_track(self._hand, relabelled), _no_disturbances(activity.shape)
        for stretch, part, rows in self._smoothed(repaired, activity, spreads):
            self._write(track, stretch.forward.record, part, rows)
            if spreads:
                self._write_spreads(track, part, rows)
            _note(disturbances, part, rows)
        track.residuals[:] += relabelled
        return track, disturbances

    def disturbances(self, markers: Floats, activity: Floats) -> Disturbances:
        """Return what disturbed the movement, zero where the hand is not known."""
        disturbances = _no_disturbances(activity.shape)
        for _, part, rows in self._smoothed(markers, activity, covariance=False):
            _note(disturbances, part, rows)
        return disturbances

    def _smoothed(
        self, markers: Floats, activity: Floats, covariance: bool
    ) -> Iterator[tuple[Stretch, Smoothed, slice]]:
        """Yield smoothed blocks with the stretch that each is part of and its frames in the recording."""
        follower = make_follower(
            self._kinematics,
            self._motion,
            self._prior,
            self._parameters,
            self._rate,
            self._noise,
            self._marker_sd,
            self._gated,
        )
        for stretch in follow(follower, markers, self._glove, self._forward, activity):
            for part in stretch.forward.smooth(self._motion, activity[stretch.rows], covariance):
                first, last = stretch.first + part.frames.start, stretch.first + part.frames.stop
                yield stretch, part, slice(first, last)

    def _write(self, track: HandTrack, record: Record, part: Smoothed, rows: slice) -> None:
        """Write a block of smoothed frames into the track, as residuals minus where the markers are."""
        workspace = self._kinematics
        q = moved_within_limits(record.q[part.frames], part.step, self._hand.joint_range)
        track.q[rows] = q
        track.used[rows], track.at_limit[rows] = record.used[part.frames], record.at_limit[part.frames]
        track.residuals[rows] = -point_positions(workspace.tree, workspace.marker_points, q)

    def _write_spreads(self, track: HandTrack, part: Smoothed, rows: slice) -> None:
        """Write the sites of a block of frames, and all standard deviations."""
        tree, sites, q = self._kinematics.tree, self._kinematics.site_points, track.q[rows]
        track.sites[rows] = point_positions(tree, sites, q)
        track.sites_sd[rows] = point_spreads(tree, sites, q, part.covariance)
        track.q_sd[rows] = np.sqrt(np.diagonal(part.covariance, axis1=1, axis2=2))


def _no_disturbances(shape: tuple[int, ...]) -> Disturbances:
    return Disturbances(np.zeros(shape), np.zeros(shape))


def _note(disturbances: Disturbances, part: Smoothed, rows: slice) -> None:
    disturbances.squared[rows] = part.disturbances.squared
    disturbances.determined[rows] = part.disturbances.determined


def _empty_track(hand: HandModel, markers: Floats) -> HandTrack:
    n_frames = len(markers)
    return HandTrack(
        q=np.full((n_frames, hand.n_q), np.nan),
        q_sd=np.full((n_frames, hand.n_dof), np.nan),
        sites=np.full((n_frames, N_SITES, 3), np.nan),
        sites_sd=np.full((n_frames, N_SITES), np.nan),
        residuals=np.full(markers.shape, np.nan),
        used=np.zeros(markers.shape[:2], dtype=bool),
        at_limit=np.zeros(n_frames, dtype=bool),
    )
