"""The forward pass over a recording: start, loss and re-acquisition of the hand, frame by frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.filter import HandFilter, JointReadings, State, Update
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.glove import GloveMeasurement
from graspdb_ingest.tracking.motion import MotionModel, MotionNoise
from graspdb_ingest.tracking.smoother import ForwardPass

LOST_AFTER: Final = 10
"""Frames in a row with most of the seen markers rejected after which the hand counts as lost."""
FORGOTTEN_AFTER: Final = 1.0
"""Time without any marker after which tracking starts anew [s]."""
START_OUTLIER: Final = 0.02
"""A marker this far from the hand that fits a frame by itself is no part of it [m]."""


@dataclass(frozen=True)
class Followed:
    """A frame of the forward pass: what the filter made of it, None while the hand is not known."""

    predicted: State | None
    update: Update | None
    started: bool = False


class Follower:
    """The filter with its start, its loss of the hand and its re-acquisition."""

    def __init__(
        self,
        kinematics: Kinematics,
        filter_: HandFilter,
        prior: PosturePrior,
        marker_sd: Floats,
        parameters: TrackingParameters,
        forgotten_after: int,
        gated: bool = True,
    ) -> None:
        self._kinematics = kinematics
        self._filter = filter_
        self._prior = prior
        self._marker_sd = marker_sd
        self._minimum = parameters.minimum_start_markers
        self._forgotten_after = forgotten_after
        self._gated = gated
        self._state: State | None = None
        self._doubtful = 0
        self._unseen = 0

    def step(
        self,
        observed: Floats,
        readings: JointReadings | None = None,
        activity: Floats | None = None,
    ) -> Followed:
        """Take one frame.

        Parameters
        ----------
        observed : ndarray, shape (n_markers, 3)
            Marker positions [m], NaN where not seen.
        readings : JointReadings, optional
            Joint angles that were measured besides.
        activity : ndarray, shape (n_dof,), optional
            Factors on the standard deviation of the process noise.
        """
        seen = visible(observed)
        n_seen = np.count_nonzero(seen)
        self._unseen = 0 if n_seen else self._unseen + 1
        if self._doubtful > LOST_AFTER or self._unseen > self._forgotten_after:
            self._state = None
        if self._state is None:
            return self._start(observed, readings)
        predicted = self._filter.predict(self._state, activity)
        update = self._filter.update(predicted, observed, self._gated, readings, seen)
        rejected = n_seen - np.count_nonzero(update.used)
        self._doubtful = self._doubtful + 1 if 2 * rejected > n_seen else 0
        self._state = update.state
        return Followed(predicted, update)

    def _start(self, observed: Floats, readings: JointReadings | None) -> Followed:
        """Start from one frame, without the markers that fit no hand together with the others."""
        trusted = observed.copy()
        while visible(trusted).sum() >= self._minimum:
            fit = fit_frame(self._kinematics, trusted, self._prior, self._marker_sd)
            distances = np.nan_to_num(np.linalg.norm(fit.residuals, axis=1), nan=0.0)
            if distances.max() > START_OUTLIER:
                trusted[int(np.argmax(distances))] = np.nan
                continue
            predicted = self._filter.start(fit.q)
            update = self._filter.update(predicted, trusted, gated=False, readings=readings)
            self._doubtful, self._state = 0, update.state
            return Followed(predicted, update, started=True)
        return Followed(None, None)


def make_follower(
    kinematics: Kinematics,
    motion: MotionModel,
    prior: PosturePrior,
    parameters: TrackingParameters,
    rate: float,
    noise: MotionNoise | None = None,
    marker_sd: Floats | None = None,
    gated: bool = True,
) -> Follower:
    """Return the forward pass of a hand, frame by frame; the workspace is its own from now on.

    `marker_sd` are the least standard deviations that markers have, where calibration found them. Without
    `gated` every marker counts, however far it is from its prediction.
    """
    usual = parameters.marker_sd if noise is None else noise.marker_sd
    least = np.zeros(len(kinematics.hand.markers)) if marker_sd is None else marker_sd
    marker_sd = np.maximum(least, usual)
    filter_ = HandFilter(kinematics, motion, prior, marker_sd, parameters.gate)
    forgotten_after = round(FORGOTTEN_AFTER * rate)
    return Follower(kinematics, filter_, prior, marker_sd, parameters, forgotten_after, gated)


@dataclass(frozen=True)
class Stretch:
    """Frames in a row in which the hand was never lost.

    Attributes
    ----------
    first : int
        Its first frame in the recording.
    q : ndarray, shape (n, n_q)
        Predicted configurations.
    used : ndarray of bool, shape (n, n_markers)
        Markers that were seen and passed the gate.
    at_limit : ndarray of bool, shape (n,)
        Where a joint was held at its limit.
    forward : ForwardPass
        What the backward pass needs, until the next stretch is asked for.
    """

    first: int
    q: Floats
    used: Bools
    at_limit: Bools
    forward: ForwardPass

    @property
    def rows(self) -> slice:
        """Its frames in the recording."""
        return slice(self.first, self.first + len(self.q))


def follow(
    follower: Follower,
    markers: Floats,
    glove: GloveMeasurement | None,
    forward: ForwardPass,
    activity: Floats | None = None,
) -> Iterator[Stretch]:
    """Run the filter over a recording and yield every stretch in which the hand was not lost.

    Parameters
    ----------
    follower : Follower
        A follower that has seen nothing yet.
    markers : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    glove : GloveMeasurement or None
        Joint angles of a data glove.
    forward : ForwardPass
        Memory for a stretch as long as the recording.
    activity : ndarray, shape (n_frames, n_dof), optional
        Factors on the standard deviation of the process noise.
    """
    qs: list[Floats] = []
    used: list[Bools] = []
    limits: list[bool] = []
    for i in range(len(markers) + 1):
        followed = Followed(None, None)
        if i < len(markers):
            readings = None if glove is None else glove.frame(i)
            followed = follower.step(markers[i], readings, None if activity is None else activity[i])
        if qs and (followed.started or followed.update is None):
            yield Stretch(i - len(qs), np.array(qs), np.array(used), np.array(limits), forward)
            forward.clear()
            qs, used, limits = [], [], []
        if followed.predicted is not None and followed.update is not None:
            forward.append(followed.predicted, followed.update)
            qs.append(followed.predicted.q)
            used.append(followed.update.used)
            limits.append(followed.update.at_limit)
