"""What an ingest would do with each trial, and why; nothing is written."""

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from graspdb.ingestion import with_kept_hands
from graspdb.store import Store
from graspdb.store.committed import CommittedTrial
from graspdb_ingest.calibration_set import calibration_recordings
from graspdb_ingest.input_key import input_key, session_inputs, software_version
from graspdb_ingest.parameters import IngestParameters
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.manifest_reader import parse_manifest

_FILES: Final = {
    "file.recording": "recording",
    "file.object": "object's file",
    "file.glove": "glove's file",
    "file.clouds": "live clouds",
    "file.reference_contacts": "reference contacts",
    "file.hand_model": "hand's model",
}
"""What the files among the inputs are."""


class Action(StrEnum):
    """What an ingest would do with a trial."""

    ADD = "add"
    REDO = "redo"
    SKIP = "skip"
    LEAVE = "leave"


@dataclass(frozen=True)
class TrialPlan:
    """What an ingest would do with one trial.

    Attributes
    ----------
    trial : str
        Its key.
    action : Action
        Add it, redo it, or skip it since it is unchanged; leave it, where it is in the database and no
        longer in the manifest.
    reasons : tuple of str
        Why; empty for a trial that is skipped.
    """

    trial: str
    action: Action
    reasons: tuple[str, ...]


def explain_ingest(
    session: str | os.PathLike[str],
    db: str | os.PathLike[str] = "grasps",
    *,
    data_root: str | os.PathLike[str] | None = None,
    force: bool = False,
    parameters: IngestParameters | None = None,
) -> tuple[TrialPlan, ...]:
    """Return what `ingest` would do with each trial of a session, and why.

    Parameters
    ----------
    session : path
        The session's folder, or its manifest.
    db : path
        The database's folder; there may be none yet.
    data_root : path, optional
        Folder that the manifest's files are in; the session's own folder unless given.
    force : bool
        Whether unchanged trials are to be ingested too.
    parameters : IngestParameters, optional
        Thresholds and models; the defaults unless given.

    Returns
    -------
    tuple of TrialPlan
        Every trial of the manifest in its order, then those of this session that the database alone has.

    Raises
    ------
    ManifestError
        If the manifest does not describe a session.
    DatabaseError
        If the folder is no database.
    """
    parameters = parameters or IngestParameters()
    described = parse_manifest(Path(session), None if data_root is None else Path(data_root))
    known: Mapping[str, CommittedTrial] = {}
    if Path(db).exists() and any(Path(db).iterdir()):
        store = Store.open(db)
        known = store.committed_trials(described.id)
        if not force:
            described = with_kept_hands(described, store, parameters)
    inputs = session_inputs(described, parameters)
    plans = []
    for trial in described.trials:
        key = f"{described.id}/{trial.name}"
        plans.append(_plan(key, described, trial, inputs[trial.name], known.get(key), parameters, force))
    gone = sorted(known.keys() - {plan.trial for plan in plans})
    return (*plans, *(TrialPlan(key, Action.LEAVE, ("not in the manifest",)) for key in gone))


def _plan(
    key: str,
    session: Session,
    trial: SessionTrial,
    inputs: Mapping[str, str],
    known: CommittedTrial | None,
    parameters: IngestParameters,
    force: bool,
) -> TrialPlan:
    if known is None:
        return TrialPlan(key, Action.ADD, ("not in the database",))
    if known.input_key == input_key(inputs):
        return TrialPlan(key, Action.REDO, ("forced",)) if force else TrialPlan(key, Action.SKIP, ())
    if known.inputs is None:
        return TrialPlan(key, Action.REDO, ("the database's format did not yet keep what it was made from",))
    return TrialPlan(key, Action.REDO, tuple(_reasons(session, trial, inputs, known, parameters)))


def _reasons(
    session: Session,
    trial: SessionTrial,
    inputs: Mapping[str, str],
    known: CommittedTrial,
    parameters: IngestParameters,
) -> Iterator[str]:
    """Yield each difference between what a trial would be made from now and what it was made from."""
    before = known.inputs or {}
    for name in sorted(inputs.keys() | before.keys()):
        if inputs.get(name) == before.get(name):
            continue
        if name == "calibration":
            now = calibration_recordings(session, session.subjects[trial.subject])
            yield from _calibration(trial.subject, now, known.recordings)
        elif name == "software":
            yield f"software: {known.software_version} before, {software_version()} now"
        elif name.startswith("parameters."):
            yield from _parameters(name.removeprefix("parameters."), parameters, known.parameters)
        else:
            yield f"{_what(name, session, trial)} {_how(name, inputs, before)}"


def _what(name: str, session: Session, trial: SessionTrial) -> str:
    """Return what an input is, as a user knows it."""
    if name not in _FILES:
        return f"session.yaml: {name.removeprefix('session.')}"
    path = {
        "file.recording": trial.file,
        "file.object": session.objects[trial.object].mesh if trial.object is not None else None,
        "file.glove": trial.glove,
        "file.clouds": trial.clouds,
        "file.reference_contacts": trial.reference_contacts,
    }.get(name)
    return _FILES[name] if path is None else f"{_FILES[name]} {path.name}"


def _how(name: str, now: Mapping[str, str], before: Mapping[str, str]) -> str:
    if name not in before:
        return "is new"
    return "has changed" if name in now else "is gone"


def _calibration(subject: str, now: Mapping[str, str], before: Mapping[str, str] | None) -> Iterator[str]:
    """Yield which of the recordings that a hand is calibrated from differ."""
    if before is None:
        yield f"calibration of {subject}'s hand: its recordings have changed"
        return
    differ = [
        name for name in (*before, *(n for n in now if n not in before)) if now.get(name) != before.get(name)
    ]
    if not differ:
        yield f"calibration of {subject}'s hand: the order of its recordings has changed"
    for name in differ:
        yield f"calibration of {subject}'s hand: {name} {_how(name, now, before)}"


def _parameters(group: str, parameters: IngestParameters, before: str) -> Iterator[str]:
    """Yield which parameters of a group differ, with their values."""
    old: Mapping[str, Any] = json.loads(before).get(group, {})
    new: Mapping[str, Any] = json.loads(parameters.to_json())[group]
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            yield f"parameter {group}.{name}: {old.get(name)} before, {new.get(name)} now"
