"""What is done once for a session's hands, before its trials: they are calibrated."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from graspdb_ingest.calibration_set import calibration_files, calibration_recordings
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.foreign import HandFile
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior, default_prior
from graspdb_ingest.hand.subject import subject_hand
from graspdb_ingest.one_thread import one_thread
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.readers import read_recording
from graspdb_ingest.tracking.calibration import Calibration, calibrate_hand
from graspdb_ingest.tracking.frame_choice import sample_frames
from graspdb_ingest.tracking.motion import MotionNoise
from graspdb_ingest.tracking.noise import WINDOWS, estimate_noise
from graspdb_ingest.tracking.posture_learning import LearnedPrior, learn_prior
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.errors import GraspDBError, TrackingError
from graspdb_schemas.manifest import Session, SessionTrial, Subject
from graspdb_schemas.vocabulary import Side

NOTHING: Final[Mapping[str, Bools]] = {}


@dataclass(frozen=True)
class PreparedHand:
    """A subject's hand ready for tracking.

    Attributes
    ----------
    subject : str
        Name of the subject.
    hand : HandModel
        The calibrated hand.
    prior : PosturePrior
        Where its joints usually are.
    calibrated_markers : tuple of str
        Markers whose offsets the manifest left to be found.
    calibration : Calibration
        How it was found, and how far its markers lie from it.
    learned : LearnedPrior
        What the prior stands on.
    noise : MotionNoise
        Scales of its movement and of its markers' noise.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation that each marker has at the least in tracking [m]. Skin moves slowly, so that
        postures fitted to single frames take most of its movement up, and calibration sees less of it than
        there is: the usual deviation is added to what it found.
    notes : tuple of str
        What to know of the hand's model.
    recordings : mapping of str to str
        What of the session it was calibrated from, as `calibration_recordings` returns it.
    """

    subject: str
    hand: HandModel
    prior: PosturePrior
    calibrated_markers: tuple[str, ...]
    calibration: Calibration
    learned: LearnedPrior
    noise: MotionNoise
    marker_sd: Floats
    notes: tuple[str, ...] = ()
    recordings: Mapping[str, str] = field(default_factory=dict)


def prepare_hand(
    session: Session,
    subject: Subject,
    side: Side,
    parameters: TrackingParameters,
    hidden: Mapping[str, Bools] = NOTHING,
) -> PreparedHand:
    """Build a subject's hand, calibrate it and learn its postures from the recordings named for it.

    A recording that cannot be read is left to its own trial to report. Recordings are read one
    after the other, and an even sample of their frames is all that is kept of them.

    Parameters
    ----------
    session : Session
        The session.
    subject : Subject
        The subject.
    side : Side
        Which hand.
    parameters : TrackingParameters
        Usual noise and time scale.
    hidden : mapping of str to ndarray of bool, shape (n_frames, n_markers), optional
        What to leave out of each trial, by its name; for validation.

    Raises
    ------
    TrackingError
        If no recording shows enough of the hand.
    """
    file = subject_hand(session, subject, side)
    durations: list[float] = []

    def markers() -> Iterator[Floats]:
        for recording in hand_recordings(session, subject, side, hidden):
            durations.append(len(recording.markers) / recording.rate)
            yield recording.markers

    sample = sample_frames(markers())
    some = _noise_recordings(session, subject, side, hidden)
    hand = hand_from_sample(subject.name, file, sample, sum(durations), some, parameters)
    return replace(hand, recordings=calibration_recordings(session, subject))


def hand_from_sample(
    subject: str,
    file: HandFile,
    sample: Floats,
    duration: float,
    recordings: Sequence[tuple[Floats, float]],
    parameters: TrackingParameters,
) -> PreparedHand:
    """Calibrate a hand and learn its postures from a sample of its frames.

    Parameters
    ----------
    subject : str
        Name of the subject.
    file : HandFile
        The hand before calibration.
    sample : ndarray, shape (n_frames, n_markers, 3)
        An even sample of the frames of its recordings [m].
    duration : float
        How long they are together [s].
    recordings : sequence of tuple (ndarray of shape (n_frames, n_markers, 3), float)
        Some of them with their rates [Hz], that tell the scales of movement and of noise; those that the
        parameters assume stand if there is none.
    parameters : TrackingParameters
        Usual noise and time scale.

    Raises
    ------
    TrackingError
        If the sample does not show enough of the hand.
    """
    default = default_prior(file.hand)
    with one_thread():
        calibration = calibrate_hand(file.hand, file.placements, [sample], default, parameters.marker_sd)
        learned = learn_prior(
            calibration.hand,
            sample,
            duration,
            default,
            calibration.marker_sd,
            parameters.posture_time,
        )
        noise = (
            estimate_noise(calibration.hand, list(recordings), learned.prior, parameters)
            if recordings
            else MotionNoise.assumed(parameters)
        )
    return PreparedHand(
        subject=subject,
        hand=calibration.hand,
        prior=learned.prior,
        calibrated_markers=tuple(m for m, place in file.placements.items() if place.calibrated),
        calibration=calibration,
        learned=learned,
        noise=noise,
        marker_sd=np.hypot(calibration.marker_sd, parameters.marker_sd),
        notes=file.notes,
    )


@dataclass(frozen=True)
class HandRecording:
    """What a recording shows of one hand.

    Attributes
    ----------
    trial : str
        Name of the trial; that of its file for a recording that is no trial.
    rate : float
        Frames per second [Hz].
    markers : ndarray, shape (n_frames, n_markers, 3)
        The hand's markers [m].
    """

    trial: str
    rate: float
    markers: Floats


def hand_recordings(
    session: Session, subject: Subject, side: Side, hidden: Mapping[str, Bools] = NOTHING
) -> Iterator[HandRecording]:
    """Read the recordings that a hand is calibrated from one after the other, as they are asked for.

    `hidden` says for a trial, by its name, which positions to leave out, shape (n_frames, n_markers).

    Raises
    ------
    TrackingError
        If none of them shows the hand.
    """
    found = False
    for trial in _calibration_trials(session, subject):
        recording = _hand_recording(session, trial, side, hidden)
        if recording is not None:
            found = True
            yield recording
    if not found:
        raise TrackingError(
            f"no recording of subject {subject.name} shows the {side} hand",
            "Check the trials' files and marker_names in session.yaml.",
        )


def _hand_recording(
    session: Session, trial: SessionTrial, side: Side, hidden: Mapping[str, Bools]
) -> HandRecording | None:
    """Read what a trial shows of a hand; None where it does not show it or cannot be read."""
    try:
        recording = read_recording(trial.file, session.file_scale)
        markers = select_markers(recording, session, trial).hands.get(side)
    except GraspDBError:
        return None
    if markers is None or not np.isfinite(markers).any():
        return None
    if trial.name in hidden:
        markers = np.where(hidden[trial.name][..., None], np.nan, markers)
    return HandRecording(trial.name, recording.rate, markers)


def _noise_recordings(
    session: Session, subject: Subject, side: Side, hidden: Mapping[str, Bools]
) -> list[tuple[Floats, float]]:
    """Return as many of the hand's recordings, with their rates, as the estimate of its noise looks at."""
    trials = list(_calibration_trials(session, subject))
    chosen = [trials[i] for i in np.unique(np.linspace(0, len(trials) - 1, WINDOWS).astype(int))]
    found = (_hand_recording(session, trial, side, hidden) for trial in chosen)
    return [(recording.markers, recording.rate) for recording in found if recording is not None]


def _calibration_trials(session: Session, subject: Subject) -> Iterator[SessionTrial]:
    """Yield the trials of `calibration_files`; a recording that is none of the session's becomes one."""
    for file in dict.fromkeys(calibration_files(session, subject)):
        own = [t for t in session.trials if t.file == file and t.subject == subject.name]
        if own:
            yield from own
        else:
            yield SessionTrial(name=file.stem, file=file, source_file=file.name, subject=subject.name)
