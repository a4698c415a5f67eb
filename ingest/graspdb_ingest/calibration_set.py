"""Which recordings a subject's hand is calibrated from, and when a hand keeps those that it has."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from graspdb_ingest.file_hash import file_sha256, value_hash
from graspdb_schemas.manifest import Session, SessionTrial, Subject

HAND_INPUTS: Final = ("session.", "subjects.", "file.hand_model", "parameters.tracking", "software")
"""How those inputs of a trial begin that decide what its hand is calibrated to from given recordings."""


@dataclass(frozen=True)
class CalibratedHand:
    """A hand that a database has: what it was made from.

    Attributes
    ----------
    subject : str
        Whose.
    inputs : mapping of str to str
        Inputs of a trial that stands on it.
    recordings : mapping of str to str
        What it was calibrated from, as `calibration_recordings` returns it.
    """

    subject: str
    inputs: Mapping[str, str]
    recordings: Mapping[str, str]


def calibration_files(session: Session, subject: Subject) -> tuple[Path, ...]:
    """Return the recordings a subject's hand is calibrated from: those named, else the own trials."""
    return subject.calibration or tuple(trial.file for trial in _own_trials(session, subject))


def calibration_recordings(session: Session, subject: Subject) -> dict[str, str]:
    """Return what a subject's hand is calibrated from: file as the manifest names it -> hash.

    The hash is of the file's content and of the part of it that is used.
    """
    named = session.raw["subjects"][subject.name].get("calibration", [])
    names = dict(zip(subject.calibration, named, strict=False))
    own: dict[Path, list[SessionTrial]] = {}
    for trial in _own_trials(session, subject):
        own.setdefault(trial.file, []).append(trial)
    found = {}
    for file in calibration_files(session, subject):
        trials = own.get(file, [])
        used = [[trial.start, trial.end, list(trial.sides)] for trial in trials]
        name = trials[0].source_file if trials else names.get(file, file.name)
        found[name] = value_hash([file_sha256(file), used])
    return found


def keep_calibrations(
    session: Session, hands: Sequence[CalibratedHand], inputs: Mapping[str, Mapping[str, str]]
) -> Session:
    """Let subjects without calibration recordings keep those that their hands were calibrated from.

    Such a hand is calibrated from all of the subject's trials when it is first ingested. Trials that are
    recorded later do not change it, as long as all that it was made from is still there, unchanged.

    Parameters
    ----------
    session : Session
        The session.
    hands : sequence of CalibratedHand
        Hands that the database has of its subjects, the one to be kept first.
    inputs : mapping of str to mapping of str to str
        What decides the hand of each subject beside the recordings, as `hand_inputs` returns it.

    Returns
    -------
    Session
        The session, in which such subjects name their recordings.
    """
    subjects = dict(session.subjects)
    for hand in reversed(hands):
        subject = session.subjects.get(hand.subject)
        if subject is None or subject.calibration or hand.subject not in inputs:
            continue
        files = {trial.source_file: trial.file for trial in _own_trials(session, subject)}
        if not hand.recordings or not files.keys() >= hand.recordings.keys():
            continue
        kept = replace(subject, calibration=tuple(files[name] for name in hand.recordings))
        same = calibration_recordings(session, kept) == dict(hand.recordings)
        if same and _of_hand(hand.inputs) == inputs[hand.subject]:
            subjects[hand.subject] = kept
    return replace(session, subjects=subjects)


def _own_trials(session: Session, subject: Subject) -> list[SessionTrial]:
    return [trial for trial in session.trials if trial.subject == subject.name]


def _of_hand(inputs: Mapping[str, str]) -> dict[str, str]:
    """Return those inputs of a trial that decide what a hand is calibrated to, as `hand_inputs` does."""
    return {name: value for name, value in inputs.items() if name.startswith(HAND_INPUTS)}
