"""A trial of a session, from the files it names to the rows it brings."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import pyarrow as pa

from graspdb_ingest.contact_rows import contact_rows
from graspdb_ingest.file_hash import file_sha256
from graspdb_ingest.frame_rows import frame_rows, marker_rows
from graspdb_ingest.glove_angles import GloveAngles, select_glove
from graspdb_ingest.grasp_rows import find_grasps, grasp_rows
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.input_key import input_key, software_version
from graspdb_ingest.objects.live import CloudTrack, follow_clouds, read_cloud_times
from graspdb_ingest.objects.live_surface import LiveSurface, follow_surface
from graspdb_ingest.one_thread import one_thread
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.readers import read_recording
from graspdb_ingest.readers.glove import read_glove
from graspdb_ingest.recording import Recording
from graspdb_ingest.reference_contacts import read_reference_contacts, reference_rows
from graspdb_ingest.session_rows import live_object_rows
from graspdb_ingest.tracking.faults import describe
from graspdb_ingest.trial import TrackedHand, TrackedTrial, track_trial
from graspdb_ingest.trial_markers import TrialMarkers, select_markers
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import DIGITS, SEGMENTS_OF_DIGIT, Side


@dataclass(frozen=True)
class Context:
    """What a trial stands on, or why it cannot be had.

    Attributes
    ----------
    hands : mapping of Side to PreparedHand
        The subject's calibrated hands.
    object : PreparedObject or None
        The object, where the trial has one that there is a model of.
    problems : tuple of str
        Why a hand or the object could not be prepared; such a trial is rejected.
    inputs : mapping of str to str
        Everything that decides its rows, as `session_inputs` returns it.
    """

    hands: Mapping[Side, PreparedHand]
    object: PreparedObject | None
    problems: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)


def process_trial(
    session: Session, trial: SessionTrial, context: Context, parameters: IngestParameters
) -> TrialTables:
    """Turn one trial into rows; whatever a user can cause rejects the trial, with its reasons.

    Parameters
    ----------
    session : Session
        The session.
    trial : SessionTrial
        Which trial of it.
    context : Context
        Its hands and object.
    parameters : IngestParameters
        All thresholds.

    Returns
    -------
    TrialTables
        The trial's rows; those of the session that it stands on are `session_rows`, but for an object that
        live clouds alone show: its rows come with the trial. A rejected
        trial brings its row in `trials`, and its markers where they could be read.
    """
    key = f"{session.id}/{trial.name}"
    rows: dict[str, pa.Table] = {}
    markers: TrialMarkers | None = None
    tracked: TrackedTrial | None = None
    reasons = list(context.problems)
    notes: list[str] = []
    n_grasps = 0
    try:
        recording = read_recording(trial.file, session.file_scale)
        markers = select_markers(recording, session, trial)
        rows["markers"] = marker_rows(key, markers)
        if not reasons:
            gloves = _gloves(session, trial, recording, markers, context, notes)
            clouds = _clouds(session, trial, markers, context, parameters, notes)
            with one_thread():
                tracked = track_trial(
                    markers, context.hands, context.object, np.array(session.up), parameters, gloves, clouds
                )
    except GraspDBError as error:
        reasons.append(str(error))
    if trial.reference_contacts is not None:
        try:
            reference = read_reference_contacts(trial.reference_contacts, session.file_scale)
            rows["reference_contacts"] = reference_rows(key, reference)
        except GraspDBError as error:
            notes.append(f"reference_contacts not used: {error}")
    if tracked is not None:
        described = None if trial.object is None else session.objects[trial.object]
        grasps = find_grasps(key, described, tracked, parameters)
        n_grasps = len(grasps)
        rows["frames"] = frame_rows(key, tracked)
        rows |= grasp_rows(session, trial, tracked, grasps, parameters.contact)
        rows |= contact_rows(session, trial, tracked, grasps, parameters.contact)
        if described is not None and described.mesh is None:
            rows |= live_object_rows(session.id, described, tracked, grasps, parameters)
    row = _trial_row(session, trial, context.inputs, parameters, markers, tracked, reasons, notes)
    rows["trials"] = pa.Table.from_pylist([row | {"n_grasps": n_grasps}], schema=rows_schema("trials"))
    return TrialTables(rows)


def _clouds(
    session: Session,
    trial: SessionTrial,
    markers: TrialMarkers,
    context: Context,
    parameters: IngestParameters,
    notes: list[str],
) -> CloudTrack | LiveSurface | None:
    """Return the object as followed in the trial's live clouds, or as they alone show it, if it has any."""
    if trial.clouds is None or trial.object is None:
        return None
    files, scale, times = read_cloud_times(trial.clouds), session.file_scale, markers.times
    found: CloudTrack | LiveSurface
    if context.object is None:
        found = follow_surface(files, scale, times, parameters.cloud, parameters.registration)
    else:
        found = follow_clouds(files, scale, context.object.cloud, times, parameters.registration)
    notes.extend(found.notes)
    return found


def _trial_row(
    session: Session,
    trial: SessionTrial,
    inputs: Mapping[str, str],
    parameters: IngestParameters,
    markers: TrialMarkers | None,
    tracked: TrackedTrial | None,
    reasons: Sequence[str],
    notes: Sequence[str],
) -> dict[str, object]:
    times = None if markers is None else markers.times
    groups = {} if tracked is None else _residuals_by_group(session, tracked)
    notes = [*notes, *([] if markers is None else _notes(markers))]
    notes += [] if tracked is None else _hand_notes(tracked)
    return {
        "session": session.id,
        "trial": f"{session.id}/{trial.name}",
        "subject": trial.subject,
        "object": trial.object,
        "task": trial.task,
        "repetition": trial.repetition,
        "attributes": json.dumps(trial.attributes or {}, sort_keys=True, default=str),
        "rate": None if markers is None else markers.recording.rate,
        "n_frames": None if times is None else len(times),
        "duration": None if times is None or not len(times) else float(times[-1] - times[0]),
        "source_file": trial.source_file,
        "source_sha256": file_sha256(trial.file),
        "input_key": input_key(inputs),
        "inputs": list(inputs.items()),
        "parameters": parameters.to_json(),
        "software_version": software_version(),
        "status": "rejected" if reasons else "ok",
        "reasons": [*reasons, *notes],
        "missing_fraction": None if markers is None else _missing(markers),
        "residual_rms": None if tracked is None else _overall(tracked),
        "residual_rms_by_group": list(groups.items()),
        "residual_rms_by_marker": [] if tracked is None else list(_residuals_by_marker(tracked)),
        "motion_noise": [] if tracked is None else list(_motion_noise(tracked)),
        "glove_offset": _sensors(tracked, "offset"),
        "glove_sd": _sensors(tracked, "sd"),
    }


def _notes(markers: TrialMarkers) -> list[str]:
    """Return what is worth knowing of a trial that is none the worse for it."""
    notes = [f"markers not in the file: {', '.join(markers.not_found)}"] if markers.not_found else []
    unseen = [label for label in _never_seen(markers) if label in markers.found]
    return notes + ([f"markers never seen: {', '.join(unseen)}"] if unseen else [])


def _never_seen(markers: TrialMarkers) -> Iterator[str]:
    """Yield the labels, behind their side where there are both, that no frame has a position for."""
    for side, positions in markers.hands.items():
        prefix = "" if len(markers.hands) == 1 else f"{side}_"
        for i in np.flatnonzero(np.isnan(positions[..., 0]).all(axis=0)):
            yield prefix + markers.hand_labels[i]
    for i in np.flatnonzero(np.isnan(markers.object_markers[..., 0]).all(axis=0)):
        yield markers.object_labels[i]


def _hand_notes(tracked: TrackedTrial) -> list[str]:
    """Return what is worth knowing of a trial's hand models and gloves."""
    notes: list[str] = []
    for hand in tracked.hands.values():
        notes += [*hand.prepared.notes, *(() if hand.glove is None else hand.glove.notes)]
        notes += _no_grasp(tracked, hand)
        recording, labels = tracked.markers.recording, hand.prepared.hand.markers
        notes += describe(hand.track.faults, labels, recording.rate, float(tracked.markers.times[0]))
    return notes


def _no_grasp(tracked: TrackedTrial, hand: TrackedHand) -> list[str]:
    """Return why a hand that is beside an object holds nothing."""
    if tracked.object is None or hand.holds:
        return []
    side, gap = hand.prepared.hand.side, hand.posed.gaps.gap
    if not tracked.object.track.known.any():
        return [f"no grasp by the {side} hand: where the object is, is never known"]
    if not np.isfinite(gap).any():
        return [f"no grasp by the {side} hand: hand and object are never known at once"]
    return [
        f"no grasp by the {side} hand: it comes no nearer to the object than {1e3 * np.nanmin(gap):.1f} mm"
    ]


def _gloves(
    session: Session,
    trial: SessionTrial,
    recording: Recording,
    markers: TrialMarkers,
    context: Context,
    notes: list[str],
) -> Mapping[Side, GloveAngles]:
    """Return the joint angles of a trial's glove by hand; a glove that cannot be used is noted."""
    if trial.glove is None:
        return {}
    hands = {side: hand.hand for side, hand in context.hands.items()}
    try:
        glove = read_glove(trial.glove, session.glove)
        picked, about = select_glove(glove, recording, markers.times, hands)
    except GraspDBError as error:
        notes.append(f"glove not used: {error}")
        return {}
    notes += about
    return picked


def _sensors(tracked: TrackedTrial | None, what: str) -> list[tuple[str, float]]:
    """Return an attribute of each glove sensor that was used, by joint, behind its side if there are two."""
    hands = {} if tracked is None else tracked.hands
    return [
        (joint if len(hands) == 1 else f"{side}_{joint}", float(value))
        for side, hand in hands.items()
        if hand.glove is not None
        for joint, value in zip(hand.glove.joints, getattr(hand.glove, what), strict=True)
    ]


def _missing(markers: TrialMarkers) -> float | None:
    unseen = [np.isnan(positions[..., 0]).ravel() for positions in markers.hands.values()]
    return float(np.concatenate(unseen).mean()) if unseen else None


def _overall(tracked: TrackedTrial) -> float | None:
    squared = [np.sum(h.track.residuals**2, axis=2)[h.track.used] for h in tracked.hands.values()]
    together = np.concatenate(squared)
    return float(np.sqrt(together.mean())) if len(together) else None


def _residuals_by_group(session: Session, tracked: TrackedTrial) -> dict[str, float]:
    """Return the rms residual of the used markers of each digit, the hand, the forearm and the object."""
    squared: dict[str, list[Floats]] = {}
    for hand in tracked.hands.values():
        distances = np.sum(hand.track.residuals**2, axis=2)
        for i, label in enumerate(hand.prepared.hand.markers):
            group = _group(session.markers[label].segment)
            squared.setdefault(group, []).append(distances[hand.track.used[:, i], i])
    if tracked.object is not None:
        residuals = tracked.object.track.residuals
        squared["object"] = [residuals[np.isfinite(residuals)] ** 2]
    together = {group: np.concatenate(values) for group, values in squared.items()}
    return {group: float(np.sqrt(values.mean())) for group, values in together.items() if len(values)}


def _residuals_by_marker(tracked: TrackedTrial) -> Iterator[tuple[str, float]]:
    """Yield the rms residual of each hand marker over the frames in which it was used."""
    for side, hand in tracked.hands.items():
        squared, used = np.sum(hand.track.residuals**2, axis=2), hand.track.used
        for i, label in enumerate(hand.prepared.hand.markers):
            if used[:, i].any():
                yield _name(tracked, side, label), float(np.sqrt(squared[used[:, i], i].mean()))


def _motion_noise(tracked: TrackedTrial) -> Iterator[tuple[str, float]]:
    """Yield the scales that each hand was tracked with."""
    for side, hand in tracked.hands.items():
        for scale, value in asdict(hand.prepared.noise).items():
            yield _name(tracked, side, scale), value


def _name(tracked: TrackedTrial, side: Side, name: str) -> str:
    return name if len(tracked.hands) == 1 else f"{side}_{name}"


def _group(segment: str) -> str:
    for digit in DIGITS:
        if segment in SEGMENTS_OF_DIGIT[digit]:
            return digit
    return segment
