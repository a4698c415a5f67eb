"""Read a whole session, write nothing, and say what is in it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.check_objects import ObjectReport, check_objects
from graspdb_ingest.glove_angles import select_glove
from graspdb_ingest.hand.subject import subject_hand
from graspdb_ingest.objects.live import read_cloud_times
from graspdb_ingest.readers import read_recording
from graspdb_ingest.readers.glove import read_glove
from graspdb_ingest.recording import Recording
from graspdb_ingest.reference_contacts import read_reference_contacts
from graspdb_ingest.rigidity import DistanceReport, measure_distances, rigidity_warnings
from graspdb_ingest.trial_markers import TrialMarkers, select_markers
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.manifest_reader import parse_manifest

_HAND_SPAN: Final = (0.03, 0.7)
"""Largest distance between two markers of one hand and forearm that a person can have [m]."""


@dataclass(frozen=True)
class MarkerReport:
    """How well a marker was seen.

    Attributes
    ----------
    label : str
        The marker.
    missing : float
        Share of the frames in which it was not seen.
    longest_gap : float
        Longest time without it [s].
    """

    label: str
    missing: float
    longest_gap: float


@dataclass(frozen=True)
class TrialReport:
    """What one recording holds.

    Attributes
    ----------
    name, file, subject : str
        The trial's name, its file as the manifest names it, and its subject.
    object : str or None
        Its object.
    problem : str or None
        Why it cannot be read; then nothing of what follows is known.
    n_frames : int
        Number of frames.
    rate, duration : float
        Frames per second [Hz]; time from the first frame to the last [s].
    markers : tuple of MarkerReport
        The wanted markers that the file has.
    not_found, unused : tuple of str
        Wanted markers that it has not; labels of the file that nothing is wanted of.
    distances : tuple of DistanceReport
        Rigidity of the object's markers.
    warnings : tuple of str
        What looks wrong.
    """

    name: str
    file: str
    subject: str
    object: str | None
    problem: str | None = None
    n_frames: int = 0
    rate: float = np.nan
    duration: float = np.nan
    markers: tuple[MarkerReport, ...] = ()
    not_found: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    distances: tuple[DistanceReport, ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class SessionReport:
    """What a session holds.

    Attributes
    ----------
    path : Path
        The manifest.
    id : str
        The session's identifier.
    trials : tuple of TrialReport
        Its trials.
    calibrations : tuple of TrialReport
        The recordings that its subjects are calibrated from.
    hands : tuple of str
        What is wrong with its subjects' own hand models.
    objects : tuple of ObjectReport
        Its objects that have a mesh or cloud.
    """

    path: Path
    id: str
    trials: tuple[TrialReport, ...]
    calibrations: tuple[TrialReport, ...]
    hands: tuple[str, ...] = ()
    objects: tuple[ObjectReport, ...] = ()

    @property
    def readable(self) -> bool:
        """Whether every recording, every object and every hand model can be used."""
        problems = [report.problem for report in (*self.trials, *self.calibrations)]
        problems += [report.problem for report in self.objects]
        return not self.hands and not any(problems)


def check_session(path: Path, data_root: Path | None = None) -> SessionReport:
    """Read every recording and object of a session and report what is in it.

    Parameters
    ----------
    path : Path
        The manifest or its folder.
    data_root : Path, optional
        Folder of recordings that are kept elsewhere.

    Returns
    -------
    SessionReport
        A report for each recording; one that cannot be read says why and stops no other.

    Raises
    ------
    ManifestError
        If the manifest itself has problems.
    ParameterError
        If `data_root` is not a folder.
    """
    session = parse_manifest(path, data_root)
    calibrations = [
        SessionTrial(name=file.stem, file=file, source_file=str(file), subject=subject.name)
        for subject in session.subjects.values()
        for file in subject.calibration
    ]
    return SessionReport(
        path=session.path,
        id=session.id,
        trials=tuple(check_trial(session, trial) for trial in session.trials),
        calibrations=tuple(check_trial(session, trial) for trial in calibrations),
        hands=tuple(_hand_problems(session)),
        objects=tuple(check_objects(session)),
    )


def _hand_problems(session: Session) -> Iterator[str]:
    """Yield what is wrong with hand models that the subjects bring."""
    for subject in session.subjects.values():
        for side in subject.sides if subject.models else ():
            try:
                subject_hand(session, subject, side)
            except GraspDBError as error:
                yield f"subject {subject.name}, {side} hand: {error}"


def check_trial(session: Session, trial: SessionTrial) -> TrialReport:
    """Read one recording and report what is in it."""
    try:
        whole = read_recording(trial.file, session.file_scale)
        markers = select_markers(whole, session, trial)
    except GraspDBError as error:
        return TrialReport(trial.name, trial.source_file, trial.subject, trial.object, problem=str(error))
    recording = markers.recording
    model = session.objects[trial.object].markers if trial.object is not None else {}
    distances = measure_distances(model, markers.object_markers)
    return TrialReport(
        name=trial.name,
        file=trial.source_file,
        subject=trial.subject,
        object=trial.object,
        n_frames=recording.n_frames,
        rate=recording.rate,
        duration=(recording.n_frames - 1) / recording.rate,
        markers=_marker_reports(markers),
        not_found=markers.not_found,
        unused=markers.unused,
        distances=distances,
        warnings=_hand_warnings(markers)
        + rigidity_warnings(model, markers.object_markers, distances)
        + _reference_warnings(session, trial)
        + _cloud_warnings(trial)
        + _glove_warnings(session, trial, whole, markers),
    )


def _reference_warnings(session: Session, trial: SessionTrial) -> tuple[str, ...]:
    """Return what keeps a trial's measured centres of pressure from being used."""
    if trial.reference_contacts is None:
        return ()
    try:
        read_reference_contacts(trial.reference_contacts, session.file_scale)
    except GraspDBError as error:
        return (f"reference_contacts: {error}",)
    return ()


def _cloud_warnings(trial: SessionTrial) -> tuple[str, ...]:
    """Return what keeps a trial's live clouds from being used."""
    if trial.clouds is None:
        return ()
    try:
        read_cloud_times(trial.clouds)
    except GraspDBError as error:
        return (f"clouds: {error}",)
    return ()


def _glove_warnings(
    session: Session, trial: SessionTrial, whole: Recording, markers: TrialMarkers
) -> tuple[str, ...]:
    """Return what keeps a trial's data glove from being used, and what to know of it."""
    if trial.glove is None:
        return ()
    subject = session.subjects[trial.subject]
    try:
        hands = {side: subject_hand(session, subject, side).hand for side in markers.hands}
        glove = read_glove(trial.glove, session.glove)
        return select_glove(glove, whole, markers.times, hands)[1]
    except GraspDBError as error:
        return (f"glove: {error}",)


def longest_gap(seen: NDArray[np.bool_]) -> int:
    """Return the greatest number of frames in a row in which a marker, shape (n_frames,), was not seen."""
    edges = np.flatnonzero(np.concatenate(([True], seen, [True])))
    return int(np.diff(edges).max()) - 1


def _marker_reports(markers: TrialMarkers) -> tuple[MarkerReport, ...]:
    columns: dict[str, NDArray[np.float64]] = {}
    for side, hand in markers.hands.items():
        prefix = "" if len(markers.hands) == 1 else f"{side}_"
        columns |= {prefix + label: hand[:, i] for i, label in enumerate(markers.hand_labels)}
    columns |= {label: markers.object_markers[:, i] for i, label in enumerate(markers.object_labels)}
    reports = []
    for label in markers.found:
        seen = np.asarray(np.isfinite(columns[label]).all(axis=1))
        gap = longest_gap(seen) / markers.recording.rate
        reports.append(MarkerReport(label, float(1 - seen.mean()), gap))
    return tuple(reports)


def _hand_warnings(markers: TrialMarkers) -> tuple[str, ...]:
    """Return warnings about hands without markers, and of a size that no hand has."""
    low, high = _HAND_SPAN
    warnings = []
    for side, hand in markers.hands.items():
        seen = np.isfinite(hand).all(axis=2)
        frames = np.flatnonzero(seen.sum(axis=1) >= 3)
        if not seen.any():
            warnings.append(f"no marker of the {side} hand is ever seen")
        if frames.size == 0:
            continue
        some = hand[frames[:: max(1, frames.size // 100)]]
        apart = np.linalg.norm(some[:, :, None] - some[:, None], axis=3)
        span = float(np.median(np.nanmax(apart, axis=(1, 2))))
        if not low <= span <= high:
            warnings.append(
                f"the markers of the {side} hand are up to {span:.3g} m apart, and a hand's are "
                f"{low:g} to {high:g} m: check the units of the recording"
            )
    return tuple(warnings)
