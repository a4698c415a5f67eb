"""A hand followed through a recording."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.filter import HandFilter, State
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.motion import motion_model
from graspdb_schemas.errors import TrackingError

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

    Returns
    -------
    HandTrack
        The hand in every frame from the first that shows enough markers on.

    Raises
    ------
    TrackingError
        If no frame has enough markers to start from.
    """
    kinematics = Kinematics(hand)
    marker_sd = np.full(len(hand.markers), parameters.marker_sd)
    filter_ = HandFilter(
        kinematics, motion_model(hand, prior, parameters, 1 / rate), prior, marker_sd, parameters.gate
    )
    enough = visible(markers).sum(axis=1) >= parameters.minimum_start_markers
    if not enough.any():
        raise TrackingError(
            f"no frame shows {parameters.minimum_start_markers} of the hand's {len(hand.markers)} markers",
            "Check marker_names in session.yaml, or the recording's labels.",
        )
    follower = _Follower(kinematics, filter_, prior, marker_sd, parameters, round(FORGOTTEN_AFTER * rate))
    q = np.full((len(markers), hand.n_q), np.nan)
    q_sd = np.full((len(markers), hand.n_dof), np.nan)
    used = np.zeros(markers.shape[:2], dtype=bool)
    at_limit = np.zeros(len(markers), dtype=bool)
    for i, observed in enumerate(markers):
        state, used[i], at_limit[i] = follower.step(observed)
        if state is not None:
            q[i] = state.q
            q_sd[i] = np.sqrt(np.diagonal(state.covariance)[: hand.n_dof])
    pose = hand.forward(q)
    return HandTrack(q, q_sd, pose.sites, markers - pose.markers, used, at_limit)


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

    def step(self, observed: Floats) -> tuple[State | None, Bools, bool]:
        """Take one frame; return the state, the markers used and whether a joint is at its limit."""
        seen = visible(observed)
        self._unseen = 0 if seen.any() else self._unseen + 1
        lost = self._doubtful > LOST_AFTER or self._unseen > self._forgotten_after
        if self._state is None or lost:
            if seen.sum() < self._minimum:
                self._state = None if lost else self._state
                return self._state, np.zeros(len(seen), dtype=bool), False
            fit = fit_frame(self._kinematics, observed, self._prior, self._marker_sd)
            update = self._filter.update(self._filter.start(fit.q), observed, gated=False)
            self._doubtful = 0
        else:
            update = self._filter.update(self._filter.predict(self._state), observed)
            rejected = seen.sum() - update.used.sum()
            self._doubtful = self._doubtful + 1 if 2 * rejected > seen.sum() else 0
        self._state = update.state
        return update.state, update.used, update.at_limit
