"""What decides a trial's rows, part by part and as one key: unchanged key, unchanged rows."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Final

from graspdb_ingest.calibration_set import HAND_INPUTS, calibration_recordings
from graspdb_ingest.file_hash import HASH_LENGTH, file_sha256, value_hash
from graspdb_ingest.hand.subject import model_files
from graspdb_ingest.objects.files import CLOUD_FORMATS
from graspdb_ingest.parameters import IngestParameters
from graspdb_schemas.manifest import Session, SessionTrial

SESSION_KEYS: Final = ("graspdb_session", "id", "units", "up", "marker_set", "marker_names", "glove")
"""Keys of a manifest that every trial depends on."""


def software_version() -> str:
    """Return the version of graspdb."""
    return version("graspdb")


def session_inputs(session: Session, parameters: IngestParameters) -> dict[str, dict[str, str]]:
    """Return everything that decides the rows of each trial, by the trial's name.

    That is, by a name for each part: the files (``file.recording``, ``file.object`` ...), the manifest's keys
    (``subjects.s1.hand_length``), the recordings that the hand is calibrated from (``calibration``), the
    groups of parameters and the software's version; the values are hashes. A changed mesh changes the inputs
    of its object's trials alone.
    """
    shared = _shared(session, parameters)
    calibration = {
        name: value_hash(list(calibration_recordings(session, subject).items()))
        for name, subject in session.subjects.items()
    }
    inputs = {}
    for trial, entry in zip(session.trials, session.raw["trials"], strict=True):
        own = {f"trial.{key}": value_hash(value) for key, value in entry.items()}
        own |= {**dict(_object(session, trial)), **dict(_files(trial))}
        own |= {**_subject(session, trial.subject), "calibration": calibration[trial.subject]}
        inputs[trial.name] = dict(sorted({**shared, **own}.items()))
    return inputs


def hand_inputs(session: Session, parameters: IngestParameters) -> dict[str, dict[str, str]]:
    """Return what decides a subject's hand beside the recordings it is calibrated from, by subject."""
    shared = _shared(session, parameters)
    found = {}
    for name in session.subjects:
        every = {**shared, **_subject(session, name)}
        found[name] = {key: value for key, value in every.items() if key.startswith(HAND_INPUTS)}
    return found


def input_key(inputs: Mapping[str, str]) -> str:
    """Return one key for all the inputs of a trial, a sha256."""
    return hashlib.sha256(json.dumps(dict(inputs), sort_keys=True).encode()).hexdigest()


def _shared(session: Session, parameters: IngestParameters) -> dict[str, str]:
    """Return the inputs that all trials of a session have in common."""
    common = {f"session.{key}": session.raw[key] for key in SESSION_KEYS if key in session.raw}
    common |= {f"parameters.{group}": values for group, values in asdict(parameters).items()}
    return {name: value_hash(value) for name, value in {**common, "software": software_version()}.items()}


def _subject(session: Session, name: str) -> dict[str, str]:
    """Return the inputs that all trials of a subject have in common, but for the hand's calibration."""
    said = session.raw["subjects"][name]
    found = {f"subjects.{name}.{key}": value_hash(said[key]) for key in said if key != "calibration"}
    models = model_files(session.subjects[name])
    if models:
        found["file.hand_model"] = value_hash([file_sha256(file) for file in models])
    return found


def _object(session: Session, trial: SessionTrial) -> Iterator[tuple[str, str]]:
    """Yield the inputs that all trials with an object have in common."""
    if trial.object is not None:
        for key, value in session.raw["objects"][trial.object].items():
            yield f"objects.{trial.object}.{key}", value_hash(value)
        mesh = session.objects[trial.object].mesh
        if mesh is not None:
            yield "file.object", _hash(mesh)


def _files(trial: SessionTrial) -> Iterator[tuple[str, str]]:
    """Yield the hashes of the files that belong to one trial."""
    single = {
        "recording": trial.file,
        "glove": trial.glove,
        "reference_contacts": trial.reference_contacts,
    }
    for name, file in single.items():
        if file is not None:
            yield f"file.{name}", _hash(file)
    if trial.clouds is not None:
        beside = [f for f in sorted(trial.clouds.parent.iterdir()) if f.suffix.lower() in CLOUD_FORMATS]
        yield "file.clouds", value_hash([file_sha256(file) for file in (trial.clouds, *beside)])


def _hash(file: Path) -> str:
    return (file_sha256(file) or "not readable")[:HASH_LENGTH]
