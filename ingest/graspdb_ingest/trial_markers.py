"""The markers of one trial: a recording seen through the manifest's names and times."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import MarkersNotFoundError, RecordingError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class TrialMarkers:
    """What was recorded in a trial, by hand and object, with nothing filled in.

    Attributes
    ----------
    times : ndarray, shape (n_frames,)
        Times of the frames [s].
    rate : float
        Frames per second [Hz].
    hands : mapping of Side to ndarray, shape (n_frames, n_markers, 3)
        Hand markers in the order of the marker set [m], NaN where not seen or not in the file.
    object : ndarray, shape (n_frames, n_object_markers, 3)
        The object's markers in the manifest's order [m]; no columns without an object.
    labels : tuple of str
        Every marker of the manifest that the file has, under the marker set's label.
    positions : ndarray, shape (n_frames, len(labels), 3)
        Their positions [m].
    not_found : tuple of str
        Markers of the manifest that the file does not have.
    """

    times: Floats
    rate: float
    hands: Mapping[Side, Floats]
    object: Floats
    labels: tuple[str, ...]
    positions: Floats
    not_found: tuple[str, ...]


def hand_label(session: Session, subject: str, side: Side, marker: str) -> str:
    """Return the label of a hand marker: with the side in front where both hands were recorded."""
    both = len(session.subjects[subject].sides) > 1
    return f"{side}_{marker}" if both else marker


def select_markers(recording: Recording, session: Session, trial: SessionTrial) -> TrialMarkers:
    """Pick the markers that the manifest names, and the part of the recording that it asks for.

    Parameters
    ----------
    recording : Recording
        The file's trajectories.
    session : Session
        Marker set, marker names, subjects and objects.
    trial : SessionTrial
        Whose hands, which object, from when to when.

    Raises
    ------
    MarkersNotFoundError
        If the file has none of the manifest's markers.
    RecordingError
        If no frame lies between start and end.
    """
    column = {session.marker_names.get(label, label): i for i, label in enumerate(recording.labels)}
    sides = session.subjects[trial.subject].sides
    wanted = {
        side: [hand_label(session, trial.subject, side, marker) for marker in session.markers]
        for side in sides
    }
    of_object = [] if trial.object is None else list(session.objects[trial.object].markers)
    named = [label for labels in wanted.values() for label in labels] + of_object
    found = [label for label in named if label in column]
    if not found:
        raise MarkersNotFoundError(recording.path, named, recording.labels)
    kept = _between(recording, trial)
    positions = recording.positions[kept]
    return TrialMarkers(
        times=recording.times[kept],
        rate=recording.rate,
        hands={side: _columns(positions, column, labels) for side, labels in wanted.items()},
        object=_columns(positions, column, of_object),
        labels=tuple(found),
        positions=_columns(positions, column, found),
        not_found=tuple(label for label in named if label not in column),
    )


def _between(recording: Recording, trial: SessionTrial) -> Bools:
    times, half = recording.times, 0.5 / recording.rate
    start = -np.inf if trial.start is None else trial.start
    end = np.inf if trial.end is None else trial.end
    kept = np.asarray((times >= start - half) & (times <= end + half))
    if not kept.any():
        raise RecordingError(
            recording.path,
            f"no frame lies between start {trial.start} s and end {trial.end} s; "
            f"it runs from {times[0]:g} to {times[-1]:g} s",
            "Mend start and end of the trial in session.yaml.",
        )
    return kept


def _columns(positions: Floats, column: Mapping[str, int], labels: list[str]) -> Floats:
    picked = np.full((len(positions), len(labels), 3), np.nan)
    for i, label in enumerate(labels):
        if label in column:
            picked[:, i] = positions[:, column[label]]
    return picked
