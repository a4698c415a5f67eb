"""One clip of a data set, from its files to its rows."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from graspdb_ingest.file_hash import file_sha256
from graspdb_ingest.frame_rows import position_rows
from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.importers.base import Clip, ClipHand, ClipSource, Importer, ImportOptions
from graspdb_ingest.importers.clip_rows import ClipKeys, clip_rows
from graspdb_ingest.importers.followed import FollowedClip, follow_clip
from graspdb_ingest.importers.import_key import import_inputs
from graspdb_ingest.importers.plausible import check_clip
from graspdb_ingest.importers.survey import SurveyedSubject
from graspdb_ingest.input_key import input_key, software_version
from graspdb_ingest.keypoints import dimensions_of
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.errors import GraspDBError, TrackingError
from graspdb_schemas.vocabulary import KEY_POINTS


@dataclass(frozen=True)
class ImportJob:
    """What all clips of one import have in common.

    Attributes
    ----------
    importer : Importer
        How they are read.
    options : ImportOptions
        What the user says of them.
    parameters : IngestParameters
        Thresholds.
    fit : bool
        Whether the hand model is fitted to the key points.
    """

    importer: Importer
    options: ImportOptions
    parameters: IngestParameters
    fit: bool = False

    @property
    def session(self) -> str:
        """Identifier of the session that the clips become trials of."""
        return self.options.session or self.importer.format.name

    def inputs(self, source: ClipSource) -> dict[str, str]:
        """Return everything that decides a clip's rows, as hashes by name."""
        return import_inputs(source, self.importer.format, self.options, self.parameters, self.fit)


def process_clip(
    job: ImportJob, source: ClipSource, subject: SurveyedSubject, thing: PreparedObject | str | None
) -> TrialTables:
    """Turn one clip into rows; whatever a user can cause rejects the clip, with its reasons.

    Parameters
    ----------
    job : ImportJob
        The import.
    source : ClipSource
        The clip.
    subject : SurveyedSubject
        Whose hands.
    thing : PreparedObject, str or None
        The object, or why it cannot be had.

    Returns
    -------
    TrialTables
        The clip's rows; a rejected one brings its row in `trials` alone.
    """
    reasons = [thing] if isinstance(thing, str) else []
    notes: list[str] = []
    clip: Clip | None = None
    followed: FollowedClip | None = None
    rows: dict[str, pa.Table] = {}
    trial = f"{job.session}/{source.name}"
    try:
        clip = job.importer.read(source, job.options)
        checked = check_clip(clip, source.files[0], job.options.units)
        clip, notes = checked.clip, list(checked.notes)
        if not isinstance(thing, str):
            followed = _follow(job, clip, subject, thing)
            keys = ClipKeys(job.session, trial, source.subject, clip.task)
            rows = clip_rows(keys, followed, job.parameters)
            if job.fit:
                rows["markers"] = _key_points(trial, followed, clip)
    except GraspDBError as error:
        reasons.append(str(error))
        rows, followed = {}, None
    described = _trial_row(job, source, clip, followed, reasons, notes)
    rows["trials"] = pa.Table.from_pylist([described], rows_schema("trials"))
    return TrialTables(rows)


def _follow(
    job: ImportJob, clip: Clip, subject: SurveyedSubject, prepared: PreparedObject | None
) -> FollowedClip:
    models = None
    if job.fit:
        missing = [hand.side for hand in clip.hands if hand.side not in subject.models]
        if missing:
            reason = "; ".join(subject.problems) or f"no model of the {missing[0]} hand of {subject.name}"
            raise TrackingError(reason, "Import without --fit.")
        models = subject.models
    dimensions = {hand.side: subject.dimensions or _own_dimensions(hand) for hand in clip.hands}
    return follow_clip(clip, dimensions, prepared, job.parameters, models)


def _own_dimensions(hand: ClipHand) -> HandDimensions:
    """Return the size that a clip shows, of a subject none of whose surveyed clips could be used."""
    return hand.dimensions or dimensions_of(hand.key_points[np.isfinite(hand.key_points).all(axis=(1, 2))])


def _key_points(trial: str, followed: FollowedClip, clip: Clip) -> pa.Table:
    """Return the rows of `markers`: the key points as they were read, which the hand was fitted to."""
    several = len(clip.hands) > 1
    labels = [f"{hand.side}_{name}" if several else name for hand in clip.hands for name in KEY_POINTS]
    positions = np.concatenate([hand.key_points for hand in clip.hands], axis=1)
    return position_rows(trial, followed.times, labels, positions)


def _trial_row(
    job: ImportJob,
    source: ClipSource,
    clip: Clip | None,
    followed: FollowedClip | None,
    reasons: Sequence[str],
    notes: Sequence[str],
) -> Mapping[str, object]:
    form, inputs = job.importer.format, job.inputs(source)
    row: dict[str, object] = {
        "session": job.session,
        "trial": f"{job.session}/{source.name}",
        "subject": source.subject,
        "object": None if source.object is None else source.object.name,
        "source_file": source.files[0].name,
        "source_sha256": file_sha256(source.files[0]),
        "input_key": input_key(inputs),
        "inputs": list(inputs.items()),
        "parameters": job.parameters.to_json(),
        "software_version": software_version(),
        "status": "rejected" if reasons else "ok",
        "reasons": [*reasons, *notes],
        "n_grasps": 0,
        # A general format is no data set: there the session is what the user calls it.
        "data_set": form.title if form.licence else job.session,
        "data_set_version": form.version,
        "licence": job.options.licence or form.licence or "not stated",
        "attributes": "{}",
    }
    if clip is not None:
        unseen = [~np.isfinite(hand.key_points).all(axis=(1, 2)) for hand in clip.hands]
        row |= {
            "task": clip.task,
            "attributes": json.dumps(dict(clip.attributes), sort_keys=True, default=str),
            "rate": clip.rate,
            "n_frames": clip.n_frames,
            "duration": 0.0 if clip.rate is None else (clip.n_frames - 1) / clip.rate,
            "original_id": clip.identifier,
            "missing_fraction": float(np.concatenate(unseen).mean()),
        }
    if followed is not None:
        row["n_grasps"] = sum(len(hand.holds) for hand in followed.hands)
        row["reasons"] = [*reasons, *notes, *_extrapolated(followed)]
        squared = [hand.fit.residuals[hand.fit.used] ** 2 for hand in followed.hands if hand.fit is not None]
        if squared:
            row["residual_rms"] = float(np.sqrt(np.concatenate(squared).mean()))
    return row


def _extrapolated(followed: FollowedClip) -> list[str]:
    names = sorted({name for hand in followed.hands for name in hand.extrapolated})
    return [f"key points that the data set does not have, extrapolated: {', '.join(names)}"] if names else []
