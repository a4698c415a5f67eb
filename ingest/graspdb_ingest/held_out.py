"""How well a hidden marker is predicted from the others: accuracy without ground truth.

Markers are hidden in random gaps, and what is left is taken through the very same calibration, posture
prior and tracker as in ingest. Nothing of a gap is seen by any of them. Many gaps, far from each
other, are hidden in one pass.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand, prepare_hand
from graspdb_ingest.readers import read_recording
from graspdb_ingest.tracking.fit import visible
from graspdb_ingest.tracking.skin import hidden_marker
from graspdb_ingest.trial import follow
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.manifest import Session, SessionTrial, Subject
from graspdb_schemas.vocabulary import Side

APART: Final = 1.0
"""Time between gaps of one pass, at the least [s]: more than the tracker remembers."""


@dataclass(frozen=True)
class Gap:
    """A stretch of a recording in which one marker is hidden: frames start to stop, stop excluded."""

    trial: str
    marker: int
    start: int
    stop: int


@dataclass(frozen=True)
class GapError:
    """How far the prediction of a hidden marker was off.

    Attributes
    ----------
    subject : str
        The subject.
    side : Side
        The hand.
    trial, marker : str
        Where, and which marker.
    start : float
        When the gap begins, from the trial's first frame [s].
    error : float
        Mean distance of the predicted to the recorded marker over the gap [m]; NaN where the hand was lost.
    """

    subject: str
    side: Side
    trial: str
    marker: str
    start: float
    error: float


@dataclass(frozen=True)
class Pass:
    """Gaps of one hand that are hidden together, and what is needed to predict them."""

    session: Session
    subject: Subject
    side: Side
    gaps: tuple[Gap, ...]
    parameters: IngestParameters

    def run(self) -> tuple[GapError, ...]:
        """Hide the gaps, calibrate, track and compare.

        Raises
        ------
        TrackingError
            If the hand cannot be calibrated or followed.
        """
        trials = {trial.name: trial for trial in _trials(self.session, self.subject, self.side)}
        recorded = {name: _markers(self.session, trial, self.side) for name, trial in trials.items()}
        hidden = {name: hidden_markers(visible(m), self.gaps, name) for name, (m, _) in recorded.items()}
        hand = prepare_hand(self.session, self.subject, self.side, self.parameters.tracking, hidden)
        errors: list[GapError] = []
        for name in dict.fromkeys(gap.trial for gap in self.gaps):
            markers, rate = recorded[name]
            here = [gap for gap in self.gaps if gap.trial == name]
            errors.extend(self._errors(hand, markers, rate, hidden[name], here))
        return tuple(errors)

    def _errors(
        self, hand: PreparedHand, markers: Floats, rate: float, hidden: Bools, gaps: Sequence[Gap]
    ) -> Iterator[GapError]:
        shown = np.where(hidden[..., None], np.nan, markers)
        track = follow(hand, shown, rate, self.parameters)
        for gap in gaps:
            frames = slice(gap.start, gap.stop)
            predicted = hidden_marker(hand.hand, track.q, shown, gap.marker, frames, rate)
            distance = np.linalg.norm(predicted - markers[frames, gap.marker], axis=1)
            yield GapError(
                subject=self.subject.name,
                side=self.side,
                trial=gap.trial,
                marker=hand.hand.markers[gap.marker],
                start=gap.start / rate,
                error=float(np.nanmean(distance)) if np.isfinite(distance).any() else float("nan"),
            )


def plan_passes(
    session: Session, seconds: float, n_gaps: int, seed: int, parameters: IngestParameters
) -> tuple[Pass, ...]:
    """Draw gaps for every marker of every hand of a session, and share them out among passes.

    Parameters
    ----------
    session : Session
        The session.
    seconds : float
        Length of a gap [s].
    n_gaps : int
        Gaps for each marker of a hand; fewer where its recordings have no room for as many.
    seed : int
        The same seed hides the same gaps.
    parameters : IngestParameters
        All thresholds.
    """
    passes: list[Pass] = []
    for number, subject in enumerate(session.subjects.values()):
        for side in subject.sides:
            rng = np.random.default_rng([seed, number, subject.sides.index(side)])
            seen: dict[str, Bools] = {}
            rates: dict[str, float] = {}
            for trial in _trials(session, subject, side):
                markers, rates[trial.name] = _markers(session, trial, side)
                seen[trial.name] = visible(markers)
            gaps = draw_gaps(seen, rates, seconds, n_gaps, rng)
            shared = share_out(gaps, {name: round(APART * rate) for name, rate in rates.items()})
            passes.extend(Pass(session, subject, side, part, parameters) for part in shared)
    return tuple(passes)


def draw_gaps(
    seen: Mapping[str, Bools],
    rates: Mapping[str, float],
    seconds: float,
    n_gaps: int,
    rng: np.random.Generator,
) -> tuple[Gap, ...]:
    """Draw gaps for each marker, evenly over all places where it was seen throughout.

    Parameters
    ----------
    seen : mapping of str to ndarray of bool, shape (n_frames, n_markers)
        Where each marker was seen, by trial.
    rates : mapping of str to float
        Frames per second of each trial [Hz].
    seconds : float
        Length of a gap [s].
    n_gaps : int
        Gaps for each marker.
    rng : numpy.random.Generator
        Draws them.
    """
    gaps: list[Gap] = []
    n_markers = max((shown.shape[1] for shown in seen.values()), default=0)
    for marker in range(n_markers):
        room: list[Gap] = []
        for trial, shown in seen.items():
            length = max(1, round(seconds * rates[trial]))
            # a frame in which it is seen on either side, or the gap would be longer than asked for
            count, whole = np.concatenate([[0], np.cumsum(shown[:, marker])]), length + 2
            if len(shown) < whole:
                continue
            starts = (np.flatnonzero(count[whole:] - count[:-whole] == whole) + 1).tolist()
            room.extend(Gap(trial, marker, start, start + length) for start in starts)
        gaps.extend(room[int(i)] for i in rng.permutation(len(room))[:n_gaps])
    return tuple(gaps[int(i)] for i in rng.permutation(len(gaps)))


def share_out(gaps: Sequence[Gap], apart: Mapping[str, int]) -> tuple[tuple[Gap, ...], ...]:
    """Put each gap into the first pass whose gaps in the same trial are all far enough from it.

    `apart` is the number of frames between two gaps, by trial.
    """
    passes: list[list[Gap]] = []
    for gap in gaps:
        distance = apart[gap.trial]
        for part in passes:
            if all(
                other.trial != gap.trial
                or other.start >= gap.stop + distance
                or gap.start >= other.stop + distance
                for other in part
            ):
                part.append(gap)
                break
        else:
            passes.append([gap])
    return tuple(map(tuple, passes))


def hidden_markers(shown: Bools, gaps: Sequence[Gap], trial: str) -> Bools:
    """Return which markers the gaps hide in a trial, shape (n_frames, n_markers)."""
    hidden = np.zeros(shown.shape, dtype=bool)
    for gap in gaps:
        if gap.trial == trial:
            hidden[gap.start : gap.stop, gap.marker] = True
    return hidden


def _trials(session: Session, subject: Subject, side: Side) -> Iterator[SessionTrial]:
    """Yield the trials of a hand whose recordings can be read."""
    for trial in session.trials:
        if trial.subject == subject.name and side in session.sides_of(trial):
            try:
                _markers(session, trial, side)
            except GraspDBError:
                continue
            yield trial


def _markers(session: Session, trial: SessionTrial, side: Side) -> tuple[Floats, float]:
    """Return a hand's markers [m] and the rate [Hz] of a trial."""
    recording = read_recording(trial.file, session.file_scale)
    return select_markers(recording, session, trial).hands[side], recording.rate
