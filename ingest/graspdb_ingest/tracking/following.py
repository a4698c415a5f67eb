"""The forward pass over a recording: start, loss and re-acquisition of the hand."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled, is_kept
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.hand.tree import Placed
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.algebra import copy_matrix, copy_vector
from graspdb_ingest.tracking.correction import NO_READINGS, JointReadings, Setting, correct, predict
from graspdb_ingest.tracking.filter import HandFilter, State, Update
from graspdb_ingest.tracking.fit import fit_frame, visible
from graspdb_ingest.tracking.motion import MotionModel, MotionNoise
from graspdb_ingest.tracking.smoother import ForwardPass, Record

LOST_AFTER: Final = 10
"""Frames in a row with most of the seen markers rejected after which the hand counts as lost."""
FORGOTTEN_AFTER: Final = 1.0
"""Time without any marker after which tracking starts anew [s]."""
START_OUTLIER: Final = 0.02
"""A marker this far from the hand that fits a frame by itself is no part of it [m]."""


class _Known(NamedTuple):
    """What is known of the hand after a frame; memory that `_advance` writes to.

    `counts` are the frames in a row, up to this one, with most of the seen markers rejected, and without any.
    """

    q: Floats
    velocity: Floats
    blocks: Floats
    counts: NDArray[np.int64]


@dataclass(frozen=True)
class Followed:
    """What is known of the hand after a frame, and the markers that told it."""

    state: State
    used: Bools


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
        n, n_markers = kinematics.hand.n_dof, len(marker_sd)
        self._kinematics = kinematics
        self._filter = filter_
        self._prior = prior
        self._marker_sd = marker_sd
        self._minimum = parameters.minimum_start_markers
        self._forgotten_after = forgotten_after
        self._gated = gated
        self._usual = np.ones((1, n))
        self._known = _Known(np.zeros(n + 1), np.zeros(n), np.zeros((4, n, n)), np.zeros(2, dtype=np.int64))
        self._one = ForwardPass(1, n, n_markers)
        self._following = False

    def step(self, observed: Floats) -> Followed | None:
        """Take one frame, shape (n_markers, 3) [m], NaN where not seen; None while the hand is not known."""
        markers, self._one.length = np.ascontiguousarray(observed[None], dtype=float), 0
        if self._following:
            self._following = self.advance(markers, 0, NO_READINGS, self._usual, self._one) == 1
        if not self._following:
            self._following = self.start(markers[0], NO_READINGS, 0, self._one)
        if not self._following:
            return None
        q, velocity, blocks, _ = self._known
        return Followed(State(q.copy(), velocity.copy(), blocks.copy()), self._one.record.used[0].copy())

    def start(self, observed: Floats, readings: JointReadings, frame: int, forward: ForwardPass) -> bool:
        """Start from one frame, without the markers that fit no hand together with the others.

        Return whether the hand was found; then `forward` has one frame more.
        """
        trusted = observed.copy()
        while visible(trusted).sum() >= self._minimum:
            fit = fit_frame(self._kinematics, trusted, self._prior, self._marker_sd)
            distances = np.nan_to_num(np.linalg.norm(fit.residuals, axis=1), nan=0.0)
            if distances.max() > START_OUTLIER:
                trusted[int(np.argmax(distances))] = np.nan
                continue
            predicted = self._filter.start(fit.q)
            update = self._filter.update(predicted, trusted, False, readings, frame)
            forward.append(predicted, update)
            self._know(update)
            return True
        return False

    def advance(
        self, markers: Floats, first: int, readings: JointReadings, activity: Floats, forward: ForwardPass
    ) -> int:
        """Follow the hand from a frame on; return the first frame in which it is lost, or their number.

        Parameters
        ----------
        markers : ndarray, shape (n_frames, n_markers, 3)
            Marker positions [m], NaN where not seen.
        first : int
            The frame.
        readings : JointReadings
            Joint angles that were measured besides.
        activity : ndarray, shape (n_frames, n_dof)
            Factors on the standard deviation of the process noise.
        forward : ForwardPass
            Takes the frames.
        """
        stop = _advance(
            self._filter.setting,
            self._filter.placed,
            self._known,
            forward.record,
            forward.length,
            markers,
            first,
            readings,
            activity,
            self._gated,
            self._forgotten_after,
        )
        forward.length += stop - first
        return stop

    def _know(self, update: Update) -> None:
        known, state = self._known, update.state
        known.q[:], known.velocity[:], known.blocks[:] = state.q, state.velocity, state.blocks
        known.counts[:] = 0


@compiled
def _advance(
    setting: Setting,
    placed: Placed,
    known: _Known,
    record: Record,
    row: int,
    markers: Floats,
    first: int,
    readings: JointReadings,
    activity: Floats,
    gated: bool,
    forgotten_after: int,
) -> int:
    """Predict and correct frame by frame; see `Follower.advance`."""
    n, doubtful, unseen = len(known.velocity), known.counts[0], known.counts[1]
    q, velocity, blocks = known.q.copy(), known.velocity.copy(), known.blocks.copy()
    for i in range(first, len(markers)):
        observed, n_seen = markers[i], 0
        for marker in range(len(observed)):
            n_seen += np.isfinite(observed[marker, 0] + observed[marker, 1] + observed[marker, 2])
        unseen = 0 if n_seen else unseen + 1
        if doubtful > LOST_AFTER or unseen > forgotten_after:
            return i
        q, velocity, blocks = predict(setting, q, velocity, blocks, activity[i])
        copy_matrix(blocks[2], record.columns[row, :n])
        copy_matrix(blocks[3], record.columns[row, n:])
        copy_vector(q, record.q[row])
        q, velocity, blocks, used, at_limit, solved = correct(
            setting, placed, q, velocity, blocks, observed, readings, i, gated
        )
        copy_matrix(solved[:n], record.inverse[row])
        copy_vector(solved[n], record.weighted[row])
        record.at_limit[row], n_used = at_limit, 0
        for marker in range(len(used)):
            record.used[row, marker] = used[marker]
            n_used += used[marker]
        row += 1
        doubtful = doubtful + 1 if 2 * (n_seen - n_used) > n_seen else 0
    copy_vector(q, known.q)
    copy_vector(velocity, known.velocity)
    for block in range(4):
        copy_matrix(blocks[block], known.blocks[block])
    known.counts[0], known.counts[1] = doubtful, unseen
    return len(markers)


def is_compiled() -> bool:
    """Return whether tracking's machine code is there already; else its first frame takes half a minute."""
    return is_kept(_advance)


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
    forward : ForwardPass
        What became of them, until the next stretch is asked for.
    """

    first: int
    forward: ForwardPass

    @property
    def rows(self) -> slice:
        """Its frames in the recording."""
        return slice(self.first, self.first + self.forward.length)


def follow(
    follower: Follower,
    markers: Floats,
    readings: JointReadings | None,
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
    readings : JointReadings or None
        Joint angles of a data glove, in every frame.
    forward : ForwardPass
        Memory for a stretch as long as the recording.
    activity : ndarray, shape (n_frames, n_dof), optional
        Factors on the standard deviation of the process noise.
    """
    markers, frame = np.ascontiguousarray(markers, dtype=float), 0
    readings = NO_READINGS if readings is None else readings
    factors = np.ones((len(markers), forward.record.weighted.shape[1])) if activity is None else activity
    while frame < len(markers):
        forward.length = 0
        if not follower.start(markers[frame], readings, frame, forward):
            frame += 1
            continue
        stop = follower.advance(markers, frame + 1, readings, factors, forward)
        yield Stretch(frame, forward)
        frame = stop
