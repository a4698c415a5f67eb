"""What decides a trial's rows, as one key: unchanged key, unchanged rows."""

import hashlib
import json
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from graspdb_ingest.hand.subject import model_files
from graspdb_ingest.objects.files import CLOUD_FORMATS
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import calibration_files
from graspdb_schemas.manifest import Session, SessionTrial


def software_version() -> str:
    """Return the version of graspdb."""
    return version("graspdb")


def file_sha256(path: Path) -> str | None:
    """Return the sha256 of a file's content as hexadecimal digits, None where it cannot be read."""
    try:
        status = path.stat()
        return _digest(path, status.st_mtime_ns, status.st_size)
    except OSError:
        return None


def input_key(session: Session, trial: SessionTrial, parameters: IngestParameters) -> str:
    """Return the sha256 of everything that decides a trial's rows.

    That is: the recording, the glove's, the object's mesh, the hand's model, the recordings that the
    hand is calibrated from, the manifest's entries for them, the parameters and the software's
    version. A changed mesh changes the keys of its object's trials alone.
    """
    raw = session.raw
    common = ("graspdb_session", "id", "units", "up", "marker_set", "marker_names", "glove")
    subject = session.subjects[trial.subject]
    files = [trial.file, *calibration_files(session, subject), *model_files(subject)]
    if trial.clouds is not None:
        beside = sorted(trial.clouds.parent.iterdir())
        files += [trial.clouds, *(file for file in beside if file.suffix.lower() in CLOUD_FORMATS)]
    if trial.reference_contacts is not None:
        files.append(trial.reference_contacts)
    mesh = None if trial.object is None else session.objects[trial.object].mesh
    if mesh is not None:
        files.append(mesh)
    if trial.glove is not None:
        files.append(trial.glove)
    part = [trial.source_file, trial.task, trial.repetition, trial.start, trial.end]
    entries: dict[str, Any] = {
        "session": {key: raw.get(key) for key in common},
        "subject": raw["subjects"][trial.subject],
        "object": raw["objects"][trial.object] if trial.object is not None else None,
        "trial": [*part, trial.glove is not None],
        "attributes": trial.attributes,
        "parameters": parameters.to_json(),
        "software": software_version(),
        "files": [file_sha256(file) for file in files],
    }
    text = json.dumps(entries, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@lru_cache(maxsize=4096)
def _digest(path: Path, _modified: int, _size: int) -> str:
    """Hash a file once as long as its time and size stay."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
