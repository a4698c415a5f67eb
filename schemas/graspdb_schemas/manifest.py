"""A session as its manifest describes it, in SI units and absolute paths."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from graspdb_schemas.vocabulary import Side

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class MarkerPlacement:
    """Where a hand marker sits: over a site, at a known offset, or where calibration finds it.

    Attributes
    ----------
    segment : str
        The segment that carries it.
    at : str or None
        The site over whose dorsal side it lies, one joint radius above the joint centre.
    offset : tuple of float or None
        Known position in the segment's frame [m].

    With neither `at` nor `offset`, calibration finds the position.
    """

    segment: str
    at: str | None = None
    offset: Vector | None = None

    @property
    def calibrated(self) -> bool:
        """Whether calibration has to find the position."""
        return self.at is None and self.offset is None


@dataclass(frozen=True)
class Subject:
    """A person, and what was measured of the hand; lengths in metres.

    Attributes
    ----------
    name : str
        Key in the manifest.
    sides : tuple of Side
        The recorded hands.
    hand_length, hand_breadth : float or None
        Wrist crease to tip of the middle finger; breadth over the knuckles [m]. None only beside models.
    joint_thickness : mapping of str to float
        Caliper thickness by site [m], any subset.
    calibration : tuple of Path
        Recordings to calibrate from; empty for the session's own trials.
    models : mapping of Side to Path
        MJCF files of another kind of hand, by the hand that they show; empty for a human hand.
    """

    name: str
    sides: tuple[Side, ...]
    hand_length: float | None
    hand_breadth: float | None
    joint_thickness: Mapping[str, float]
    calibration: tuple[Path, ...] = ()
    models: Mapping[Side, Path] = field(default_factory=dict)


@dataclass(frozen=True)
class SessionObject:
    """An object: its surface, and its markers in the mesh's frame; metres and kilograms.

    Attributes
    ----------
    name : str
        Key in the manifest.
    mesh : Path or None
        File of the mesh or cloud; None where the live clouds of its trials are all that is known of it.
    mesh_scale : float
        Factor from the mesh's numbers to metres.
    markers : mapping of str to tuple of float
        Marker positions in the mesh's frame [m].
    mass : float or None
        Mass [kg].
    friction : float or None
        Coefficient of friction between skin and object.
    center_of_mass : tuple of float or None
        Center of mass in the mesh's frame [m].
    category : str or None
        Kind of object.
    """

    name: str
    mesh: Path | None
    mesh_scale: float
    markers: Mapping[str, Vector]
    mass: float | None = None
    category: str | None = None
    friction: float | None = None
    center_of_mass: Vector | None = None


@dataclass(frozen=True)
class SessionTrial:
    """One recording of one subject, with or without an object.

    Attributes
    ----------
    name : str
        The file's name without its ending; its key is ``<session>/<name>``.
    file : Path
        The recording.
    source_file : str
        The same, as the manifest names it.
    subject : str
        Name of the subject.
    object : str or None
        Name of the object.
    task : str or None
        What was to be done.
    repetition : int or None
        Which time.
    start, end : float or None
        Part of the recording to use, in the recording's own time [s].
    glove, reference_contacts : Path or None
        Joint angles of a data glove; measured centres of pressure.
    clouds : Path or None
        List of the object's live clouds, by time.
    attributes : mapping
        Further keys of the trial.
    sides : tuple of Side
        The hands in this recording, where they are not all that the subject has recorded; else empty.
    """

    name: str
    file: Path
    source_file: str
    subject: str
    object: str | None = None
    task: str | None = None
    repetition: int | None = None
    start: float | None = None
    end: float | None = None
    glove: Path | None = None
    clouds: Path | None = None
    reference_contacts: Path | None = None
    attributes: Mapping[str, Any] | None = None
    sides: tuple[Side, ...] = ()


@dataclass(frozen=True)
class Glove:
    """The data glove of a session.

    Attributes
    ----------
    units : str or None
        ``deg`` or ``rad``, for files whose titles do not say it.
    rate : float or None
        Samples per second, for files without a column of times [Hz].
    names : mapping of str to str
        Column in the files -> joint of the hand, where they differ.
    """

    units: str | None = None
    rate: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Session:
    """A session: who grasped what, recorded where.

    Attributes
    ----------
    path : Path
        The manifest's file.
    id : str
        Identifier, first part of every key.
    up : tuple of float
        Vertical of the lab frame, a unit vector.
    file_scale : float
        Factor from lengths in files that do not say their unit to metres.
    marker_set : str
        Name of the built-in marker set, or ``custom``.
    markers : mapping of str to MarkerPlacement
        Hand markers by label in the marker set.
    marker_names : mapping of str to str
        Label in the files -> label in the marker set (or of an object's marker), where they differ.
        Where a trial has both hands, the marker set's labels stand behind ``right_`` or ``left_``.
    subjects, objects : mappings by name
        Who, and what.
    trials : tuple of SessionTrial
        The recordings.
    raw : mapping
        The manifest as it was read.
    glove : Glove
        What files of data gloves do not say.
    """

    path: Path
    id: str
    up: Vector
    file_scale: float
    marker_set: str
    markers: Mapping[str, MarkerPlacement]
    marker_names: Mapping[str, str]
    subjects: Mapping[str, Subject]
    objects: Mapping[str, SessionObject]
    trials: tuple[SessionTrial, ...]
    raw: Mapping[str, Any]
    glove: Glove = field(default_factory=Glove)

    def sides_of(self, trial: SessionTrial) -> tuple[Side, ...]:
        """Return the hands in a trial's recording: what the trial says, else what its subject does."""
        return trial.sides or self.subjects[trial.subject].sides
