"""What decides the rows of an imported clip, part by part: unchanged inputs, unchanged rows."""

import hashlib
import json
from dataclasses import asdict

from graspdb_ingest.file_hash import file_sha256, value_hash
from graspdb_ingest.importers.base import ClipSource, Format, ImportOptions, ObjectSource
from graspdb_ingest.input_key import software_version
from graspdb_ingest.parameters import IngestParameters


def import_inputs(
    source: ClipSource, form: Format, options: ImportOptions, parameters: IngestParameters, fit: bool
) -> dict[str, str]:
    """Return everything that decides a clip's rows, but the other clips of its subject: hashes by name.

    That is: its files, the object's mesh, where it is found in them, the options, the parameters and the
    software's version.
    """
    said = asdict(options)
    models = sorted(options.mano.iterdir()) if options.mano and options.mano.is_dir() else [options.mano]
    parts = {
        "data_set": [form.name, form.version, form.licence],
        "clip": [source.name, source.subject, dict(source.part)],
        "file.clip": [file_sha256(file) for file in source.files],
        "file.object": None if source.object is None else object_key(source.object, parameters),
        "file.mano": [file_sha256(file) for file in models if file is not None],
        "fit": fit,
        "software": software_version(),
    }
    parts |= {
        f"options.{key}": value for key, value in said.items() if key not in ("objects", "mano", "session")
    }
    parts |= {f"parameters.{group}": values for group, values in asdict(parameters).items()}
    return {name: value_hash(part) for name, part in sorted(parts.items()) if part is not None}


def object_key(source: ObjectSource, parameters: IngestParameters) -> str:
    """Return the sha256 of everything that decides what an object is prepared to."""
    digest = hashlib.sha256()
    for array in (source.vertices, source.faces):
        digest.update(b"" if array is None else array.tobytes())
    about = [source.scale, source.mirrored, source.category, source.mass, parameters.to_json()]
    entries = [source.name, file_sha256(source.file), *about]
    digest.update(json.dumps(entries).encode())
    return digest.hexdigest()
