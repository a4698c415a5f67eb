"""What is done once for a session, before its trials: clouds of objects, calibrated hands."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from graspdb_ingest.feature_shape import surface_neighbours
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.hand.posture import PosturePrior, default_prior
from graspdb_ingest.hand.subject import subject_hand
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.curvature import principal_curvatures
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.fpfh import fpfh
from graspdb_ingest.objects.mechanics import Mechanics, object_mechanics
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.objects.solid import Solid
from graspdb_ingest.parameters import IngestParameters, TrackingParameters
from graspdb_ingest.readers import read_recording
from graspdb_ingest.tracking.calibration import Calibration, calibrate_hand
from graspdb_ingest.tracking.motion import MotionNoise
from graspdb_ingest.tracking.noise import WINDOWS, estimate_noise
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
    marker_labels : tuple of str
        Its markers.
    marker_positions : ndarray, shape (n_markers, 3)
        Their places in the object frame [m].
    mechanics : Mechanics
        Friction, center of mass and radius.
    curvatures : ndarray, shape (n_points, 2)
        Principal curvatures of the cloud's points [1/m].
    neighbours : ndarray of int, shape (m, 2)
        Pairs of the cloud's points that are neighbours on the surface.
    solid : Solid
        The body that its mesh bounds, if it is closed.
    """

    name: str
    surface: Surface
    cloud: ObjectCloud
    distance: ObjectDistance
    histograms: NDArray[np.float32]
    marker_labels: tuple[str, ...]
    marker_positions: Floats
    mechanics: Mechanics
    curvatures: Floats
    neighbours: NDArray[np.int64]
    solid: Solid


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
    noise : MotionNoise
        Scales of its movement and of its markers' noise.
    notes : tuple of str
        What to know of the hand's model.
    """

    subject: str
    hand: HandModel
    prior: PosturePrior
    calibrated_markers: tuple[str, ...]
    calibration: Calibration
    noise: MotionNoise
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
        histograms=fpfh(cloud, parameters.cloud.fpfh_radius),
        marker_labels=tuple(described.markers),
        marker_positions=np.array(list(described.markers.values()), dtype=float).reshape(-1, 3),
        mechanics=object_mechanics(surface, cloud, friction, described.friction, described.center_of_mass),
        curvatures=principal_curvatures(cloud.points, cloud.normals, cloud.spacing),
        neighbours=surface_neighbours(cloud.points, cloud.normals, cloud.spacing),
        solid=Solid(surface),
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
        some = _some_recordings(session, subject, side)
        noise = estimate_noise(calibration.hand, some, prior, parameters)
    return PreparedHand(
        subject=subject.name,
        hand=calibration.hand,
        prior=prior,
        calibrated_markers=tuple(m for m, place in file.placements.items() if place.calibrated),
        calibration=calibration,
        noise=noise,
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
        recording = _hand_recording(session, subject, side, file)
        if recording is not None:
            found = True
            yield recording[0]
    if not found:
        raise TrackingError(
            f"no recording of subject {subject.name} shows the {side} hand",
            "Check the trials' files and marker_names in session.yaml.",
        )


def _hand_recording(
    session: Session, subject: Subject, side: Side, file: Path
) -> tuple[Floats, float] | None:
    """Return a hand's markers [m] and their rate [Hz]; None where the file does not show the hand."""
    trial = SessionTrial(name=file.stem, file=file, source_file=file.name, subject=subject.name)
    own = next((t for t in session.trials if t.file == file), trial)
    try:
        recording = read_recording(file, session.file_scale)
        markers = select_markers(recording, session, own).hands.get(side)
    except GraspDBError:
        return None
    if markers is None or not np.isfinite(markers).any():
        return None
    return markers, recording.rate


def _some_recordings(session: Session, subject: Subject, side: Side) -> list[tuple[Floats, float]]:
    """Return as many of the hand's recordings as the estimate of its noise looks at."""
    files = calibration_files(session, subject)
    chosen = [files[i] for i in np.unique(np.linspace(0, len(files) - 1, WINDOWS).astype(int))]
    found = (_hand_recording(session, subject, side, file) for file in chosen)
    return [recording for recording in found if recording is not None]
