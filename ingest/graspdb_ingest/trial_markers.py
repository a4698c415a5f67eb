"""From a recording's labels to the markers of a hand and an object, in the manifest's order."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import MarkersNotFoundError, RecordingError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class TrialMarkers:
    """The markers of one trial, in metres, NaN where not seen.

    Attributes
    ----------
    recording : Recording
        All markers of the part of the recording that the trial uses.
    hand_labels : tuple of str
        Labels of the marker set, in its order.
    hands : mapping of Side to ndarray, shape (n_frames, len(hand_labels), 3)
        Hand markers of each recorded side [m]; a marker that is not in the file is NaN throughout.
    object_labels : tuple of str
        Labels of the object's markers, in the manifest's order; empty without an object.
    object_markers : ndarray, shape (n_frames, len(object_labels), 3)
        The object's markers [m].
    found, not_found : tuple of str
        Wanted labels that the file has, and those that it has not; hand markers stand behind
        ``right_`` or ``left_`` where the trial has both hands.
    unused : tuple of str
        The file's labels that nothing was wanted of.
    """

    recording: Recording
    hand_labels: tuple[str, ...]
    hands: Mapping[Side, NDArray[np.float64]]
    object_labels: tuple[str, ...]
    object_markers: NDArray[np.float64]
    found: tuple[str, ...]
    not_found: tuple[str, ...]
    unused: tuple[str, ...]

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each frame [s], shape (n_frames,)."""
        return self.recording.times


def select_markers(recording: Recording, session: Session, trial: SessionTrial) -> TrialMarkers:
    """Pick a trial's markers out of its recording.

    Parameters
    ----------
    recording : Recording
        What was read from the trial's file.
    session : Session
        Names the markers.
    trial : SessionTrial
        Names subject, object and the part of the recording to use.

    Returns
    -------
    TrialMarkers
        Hand and object markers.

    Raises
    ------
    MarkersNotFoundError
        If the recording has none of the wanted markers.
    RecordingError
        If two of its labels stand for one marker, or no frame lies between start and end.
    """
    recording = _cut(recording, trial)
    places = _places(recording, session.marker_names)
    sides = session.sides_of(trial)
    labels = tuple(session.markers)
    entry = session.objects[trial.object] if trial.object is not None else None
    object_labels = tuple(entry.markers) if entry is not None else ()
    wanted: dict[str, int | None] = {}
    hands = {}
    for side in sides:
        _refuse_twice(recording, places, side, labels, single=len(sides) == 1)
        columns = [_hand_column(places, side, label, single=len(sides) == 1) for label in labels]
        hands[side] = _columns(recording, columns)
        prefix = "" if len(sides) == 1 else f"{side}_"
        wanted |= {prefix + label: column for label, column in zip(labels, columns, strict=True)}
    object_columns = [places.get(label) for label in object_labels]
    wanted |= dict(zip(object_labels, object_columns, strict=True))
    used = {column for column in wanted.values() if column is not None}
    if not used:
        raise MarkersNotFoundError(recording.path, list(wanted), recording.labels)
    return TrialMarkers(
        recording=recording,
        hand_labels=labels,
        hands=hands,
        object_labels=object_labels,
        object_markers=_columns(recording, object_columns),
        found=tuple(label for label, column in wanted.items() if column is not None),
        not_found=tuple(label for label, column in wanted.items() if column is None),
        unused=tuple(label for i, label in enumerate(recording.labels) if i not in used),
    )


def _cut(recording: Recording, trial: SessionTrial) -> Recording:
    """Return the frames from the trial's start to its end, both included."""
    if trial.start is None and trial.end is None:
        return recording
    times = recording.times
    slack = 0.001 / recording.rate  # times are sums, so a frame at the very start may lie just before it
    kept = np.ones(times.size, dtype=np.bool_)
    if trial.start is not None:
        kept &= times >= trial.start - slack
    if trial.end is not None:
        kept &= times <= trial.end + slack
    if not kept.any():
        raise RecordingError(
            recording.path,
            f"it covers {times[0]:g} to {times[-1]:g} s, and no frame of it lies between "
            f"start {trial.start} and end {trial.end}",
            "Set start and end of this trial in session.yaml to times of the recording.",
        )
    first = int(np.flatnonzero(kept)[0])
    return replace(recording, positions=recording.positions[kept], start_time=float(times[first]))


def _places(recording: Recording, names: Mapping[str, str]) -> dict[str, int]:
    """Return the column of each label, renamed as the manifest says."""
    short = dict(_without_sets(names))
    places: dict[str, int] = {}
    for column, label in enumerate(recording.labels):
        target = names.get(label, short.get(label, label))
        if target in places:
            other = recording.labels[places[target]]
            raise RecordingError(
                recording.path,
                f"its labels {other!r} and {label!r} both stand for {target!r}",
                "Map one of them to another marker in marker_names, or leave it out of the export.",
            )
        places[target] = column
    return places


def _without_sets(names: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield names without the marker set before a colon, which readers leave out where they can."""
    for label, target in names.items():
        brief = label.rpartition(":")[2]
        if brief != label and brief not in names:
            yield brief, target


def _refuse_twice(
    recording: Recording, places: Mapping[str, int], side: Side, labels: Sequence[str], *, single: bool
) -> None:
    """Refuse a recording of one hand in which a marker stands with its side and without."""
    for label in labels if single else ():
        if label in places and f"{side}_{label}" in places:
            plain, sided = (recording.labels[places[name]] for name in (label, f"{side}_{label}"))
            raise RecordingError(
                recording.path,
                f"its labels {plain!r} and {sided!r} both stand for {label!r} of the {side} hand",
                "Leave one of them out of the export, or map it to another marker in marker_names.",
            )


def _hand_column(places: Mapping[str, int], side: Side, label: str, *, single: bool) -> int | None:
    """Return the column of a hand marker: under its side, or, where only one hand is there, without."""
    sided = places.get(f"{side}_{label}")
    return places.get(label) if sided is None and single else sided


def _columns(recording: Recording, columns: Sequence[int | None]) -> NDArray[np.float64]:
    """Return markers by column, shape (n_frames, len(columns), 3), NaN for None."""
    picked = np.full((recording.n_frames, len(columns), 3), np.nan)
    for i, column in enumerate(columns):
        if column is not None:
            picked[:, i] = recording.positions[:, column]
    return picked
