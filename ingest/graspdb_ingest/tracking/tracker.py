"""A hand followed through a recording."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.filter import HandFilter, JointReadings, State, Update
from graspdb_ingest.tracking.fit import SEVEN, fit_frame, visible
from graspdb_ingest.tracking.glove import GloveMeasurement
from graspdb_ingest.tracking.motion import MotionModel, motion_model
from graspdb_ingest.tracking.smoother import ForwardPass
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.vocabulary import N_SITES

LOST_AFTER: Final = 10
"""Frames in a row with most of the seen markers rejected after which the hand counts as lost."""
FORGOTTEN_AFTER: Final = 1.0
"""Time without any marker after which tracking starts anew [s]."""


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
    """

    q: Floats
    q_sd: Floats
    sites: Floats
    sites_sd: Floats
    residuals: Floats
    used: Bools
    at_limit: Bools

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
    glove: GloveMeasurement | None = None,
) -> HandTrack:
    """Follow a hand through a recording.

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
        Noise, gate and movement.
    glove : GloveMeasurement, optional
        Joint angles of a data glove, in every frame.

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
    motion = motion_model(hand, prior, parameters, 1 / rate)
    marker_sd = np.full(len(hand.markers), parameters.marker_sd)
    kinematics = Kinematics(hand)
    filter_ = HandFilter(kinematics, motion, prior, marker_sd, parameters.gate)
    follower = _Follower(kinematics, filter_, prior, marker_sd, parameters, round(FORGOTTEN_AFTER * rate))
    smoother = _Smoother(kinematics, motion, markers)
    for i, observed in enumerate(markers):
        followed = follower.step(observed, None if glove is None else glove.frame(i))
        smoother.append(i, followed)
    return smoother.finish()


@dataclass(frozen=True)
class _Followed:
    """A frame of the forward pass: what the filter made of it, None while the hand is not known."""

    predicted: State | None
    update: Update | None
    started: bool = False


class _Smoother:
    """Collects the forward pass and smooths each stretch in which the hand was never lost."""

    def __init__(self, kinematics: Kinematics, motion: MotionModel, markers: Floats) -> None:
        hand = kinematics.hand
        self._kinematics, self._motion, self._markers = kinematics, motion, markers
        self._pass = ForwardPass(len(markers), hand.n_dof)
        self._first = 0
        self._q = np.full((len(markers), hand.n_q), np.nan)
        self._q_sd = np.full((len(markers), hand.n_dof), np.nan)
        self._sites = np.full((len(markers), N_SITES, 3), np.nan)
        self._sites_sd = np.full((len(markers), N_SITES), np.nan)
        self._residuals = np.full(markers.shape, np.nan)
        self._used = np.zeros(markers.shape[:2], dtype=bool)
        self._at_limit = np.zeros(len(markers), dtype=bool)

    def append(self, frame: int, followed: _Followed) -> None:
        """Take the next frame of the forward pass."""
        if followed.started or followed.update is None:
            self._smooth()
            self._first = frame
        if followed.predicted is not None and followed.update is not None:
            update = followed.update
            self._pass.append(followed.predicted, update)
            self._q[frame], self._used[frame] = followed.predicted.q, update.used
            self._at_limit[frame] = update.at_limit

    def finish(self) -> HandTrack:
        """Return the whole track."""
        self._smooth()
        return HandTrack(
            self._q, self._q_sd, self._sites, self._sites_sd, self._residuals, self._used, self._at_limit
        )

    def _smooth(self) -> None:
        hand, limits = self._kinematics.hand, self._kinematics.hand.joint_range
        for part in self._pass.smooth(self._motion):
            frames = range(self._first + part.frames.start, self._first + part.frames.stop)
            jacobians = np.empty((len(frames), 3 * N_SITES, hand.n_dof))
            for i, frame in enumerate(frames):
                q = hand.integrate(self._q[frame], part.step[i])
                q[SEVEN:] = np.clip(q[SEVEN:], limits[:, 0], limits[:, 1])
                self._q[frame] = q
                self._kinematics.move(q)
                self._sites[frame] = self._kinematics.sites
                self._residuals[frame] = self._markers[frame] - self._kinematics.markers
                jacobians[i] = self._kinematics.site_jacobian().reshape(jacobians[i].shape)
            variance = np.sum((jacobians @ part.covariance) * jacobians, axis=2)
            rows = slice(frames.start, frames.stop)
            self._q_sd[rows] = np.sqrt(np.diagonal(part.covariance, axis1=1, axis2=2))
            self._sites_sd[rows] = np.sqrt(variance.reshape(len(frames), N_SITES, 3).sum(axis=2))
        self._pass.clear()


class _Follower:
    """The filter with its start, its loss of the hand and its re-acquisition."""

    def __init__(
        self,
        kinematics: Kinematics,
        filter_: HandFilter,
        prior: PosturePrior,
        marker_sd: Floats,
        parameters: TrackingParameters,
        forgotten_after: int,
    ) -> None:
        self._kinematics = kinematics
        self._filter = filter_
        self._prior = prior
        self._marker_sd = marker_sd
        self._minimum = parameters.minimum_start_markers
        self._forgotten_after = forgotten_after
        self._state: State | None = None
        self._doubtful = 0
        self._unseen = 0

    def step(self, observed: Floats, readings: JointReadings | None = None) -> _Followed:
        """Take one frame."""
        seen = visible(observed)
        self._unseen = 0 if seen.any() else self._unseen + 1
        if self._doubtful > LOST_AFTER or self._unseen > self._forgotten_after:
            self._state = None
        if self._state is None:
            if seen.sum() < self._minimum:
                return _Followed(None, None)
            fit = fit_frame(self._kinematics, observed, self._prior, self._marker_sd)
            predicted = self._filter.start(fit.q)
            update = self._filter.update(predicted, observed, gated=False, readings=readings)
            self._doubtful, started = 0, True
        else:
            predicted = self._filter.predict(self._state)
            update = self._filter.update(predicted, observed, readings=readings)
            rejected = seen.sum() - update.used.sum()
            self._doubtful, started = self._doubtful + 1 if 2 * rejected > seen.sum() else 0, False
        self._state = update.state
        return _Followed(predicted, update, started)
