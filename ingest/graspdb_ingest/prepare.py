"""What is done once for a session, before its trials: clouds of objects, calibrated hands."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from graspdb_ingest.descriptor import descriptor_kind
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.hand.posture import PosturePrior, default_prior
from graspdb_ingest.hand.subject import subject_hand
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.curvature import principal_curvatures
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.objects.mechanics import Mechanics, object_mechanics
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.parameters import IngestParameters, TrackingParameters
from graspdb_ingest.readers import read_recording
from graspdb_ingest.tracking.calibration import Calibration, calibrate_hand
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.errors import GraspDBError, TrackingError
from graspdb_schemas.manifest import Session, SessionObject, SessionTrial, Subject
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class PreparedObject:
    """An object ready for contact: its surface, its cloud and the cloud's histograms.

    Attributes
    ----------
    name : str
        Key in the manifest.
    surface : Surface
        The mesh or cloud as loaded.
    cloud : ObjectCloud
        Evenly spaced points.
    distance : ObjectDistance
        How far it is: exact to the mesh, where there is one.
    histograms : ndarray of float32, shape (n_points, 33)
        FPFH of every point.
    descriptor_kind : str
        Kind of the descriptors that are made of them.
    marker_labels : tuple of str
        Its markers.
    marker_positions : ndarray, shape (n_markers, 3)
        Their places in the object frame [m].
    mechanics : Mechanics
        Friction, center of mass and radius.
    curvatures : ndarray, shape (n_points, 2)
        Principal curvatures of the cloud's points [1/m].
    """

    name: str
    surface: Surface
    cloud: ObjectCloud
    distance: ObjectDistance
    histograms: NDArray[np.float32]
    descriptor_kind: str
    marker_labels: tuple[str, ...]
    marker_positions: Floats
    mechanics: Mechanics
    curvatures: Floats


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
    notes : tuple of str
        What to know of the hand's model.
    """

    subject: str
    hand: HandModel
    prior: PosturePrior
    calibrated_markers: tuple[str, ...]
    calibration: Calibration
    notes: tuple[str, ...] = ()


def prepare_object(described: SessionObject, parameters: IngestParameters) -> PreparedObject:
    """Load an object's surface, sample its cloud and describe its points and its mechanics."""
    surface = load_surface(described.mesh, described.mesh_scale)
    cloud = sample_cloud(surface, parameters.cloud)
    friction = parameters.quality.friction
    return PreparedObject(
        name=described.name,
        surface=surface,
        cloud=cloud,
        distance=ObjectDistance(surface, cloud),
        histograms=point_histograms(cloud, parameters.cloud),
        descriptor_kind=descriptor_kind(parameters.cloud),
        marker_labels=tuple(described.markers),
        marker_positions=np.array(list(described.markers.values()), dtype=float).reshape(-1, 3),
        mechanics=object_mechanics(surface, cloud, friction, described.friction, described.center_of_mass),
        curvatures=principal_curvatures(cloud.points, cloud.normals, cloud.spacing),
    )


def calibration_files(session: Session, subject: Subject) -> tuple[Path, ...]:
    """Return the recordings a subject's hand is calibrated from: those named, else the own trials."""
    own = tuple(trial.file for trial in session.trials if trial.subject == subject.name)
    return subject.calibration or own


def prepare_hand(
    session: Session, subject: Subject, side: Side, parameters: TrackingParameters
) -> PreparedHand:
    """Build a subject's hand and calibrate it from the recordings that the manifest names for it.

    A recording that cannot be read is left to its own trial to report.

    Raises
    ------
    TrackingError
        If no recording shows enough of the hand.
    """
    file = subject_hand(session, subject, side)
    hand = file.hand
    prior = default_prior(hand)
    recordings = hand_recordings(session, subject, side)
    with threadpool_limits(1):
        calibration = calibrate_hand(hand, file.placements, recordings, prior, parameters.marker_sd)
    return PreparedHand(
        subject=subject.name,
        hand=calibration.hand,
        prior=prior,
        calibrated_markers=tuple(m for m, place in file.placements.items() if place.calibrated),
        calibration=calibration,
        notes=file.notes,
    )


def hand_recordings(session: Session, subject: Subject, side: Side) -> Iterator[Floats]:
    """Read the recordings of a subject's hand one after the other, as they are asked for.

    Yields
    ------
    ndarray, shape (n_frames, n_markers, 3)
        The hand's markers [m].

    Raises
    ------
    TrackingError
        If none of them shows the hand.
    """
    found = False
    for file in calibration_files(session, subject):
        trial = SessionTrial(name=file.stem, file=file, source_file=file.name, subject=subject.name)
        own = next((t for t in session.trials if t.file == file), trial)
        try:
            recording = read_recording(file, session.file_scale)
            markers = select_markers(recording, session, own).hands.get(side)
        except GraspDBError:
            continue
        if markers is not None and np.isfinite(markers).any():
            found = True
            yield markers
    if not found:
        raise TrackingError(
            f"no recording of subject {subject.name} shows the {side} hand",
            "Check the trials' files and marker_names in session.yaml.",
        )
