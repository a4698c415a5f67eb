"""From ``session.yaml`` to a `Session`, or to every problem that it has at once."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from graspdb_schemas.errors import ManifestError, ParameterError, Problem
from graspdb_schemas.manifest import (
    Glove,
    MarkerPlacement,
    Session,
    SessionObject,
    SessionTrial,
    Subject,
    Vector,
)
from graspdb_schemas.manifest_checks import value_problems
from graspdb_schemas.manifest_files import SessionFolders
from graspdb_schemas.manifest_schema import schema_problems, session_schema
from graspdb_schemas.manifest_yaml import load_yaml, table
from graspdb_schemas.units import METRES_PER
from graspdb_schemas.vocabulary import FOREARM4_DORSAL20, FOREARM_MARKERS, SEGMENT_OF_SITE, Side

MANIFEST_FILE: Final = "session.yaml"

_SIDES: Final[dict[str, tuple[Side, ...]]] = {
    "right": (Side.RIGHT,),
    "left": (Side.LEFT,),
    "both": (Side.RIGHT, Side.LEFT),
}

BUILT_IN_MARKERS: Final[Mapping[str, MarkerPlacement]] = {
    **{label: MarkerPlacement("forearm") for label in FOREARM_MARKERS},
    **{site: MarkerPlacement(segment, at=site) for site, segment in SEGMENT_OF_SITE.items()},
}
"""The set ``forearm4-dorsal20``: four on the forearm where calibration finds them, twenty over the sites."""


def parse_manifest(path: Path, data_root: Path | None = None) -> Session:
    """Read and check a session's manifest.

    Files that it names are looked for in `data_root`, where it is given, and then in the session's
    own folder; a file anywhere else is refused.

    Parameters
    ----------
    path : Path
        The manifest, or the folder that holds it as ``session.yaml``.
    data_root : Path, optional
        Folder of recordings and meshes that are kept elsewhere than the manifest.

    Returns
    -------
    Session
        The session, in SI units and absolute paths.

    Raises
    ------
    ManifestError
        With every problem of the manifest: key, what was found and what is allowed.
    ParameterError
        If `data_root` is not a folder.
    """
    if data_root is not None and not data_root.is_dir():
        raise ParameterError("data_root", str(data_root), "an existing folder")
    file = path / MANIFEST_FILE if path.is_dir() else path
    if not file.is_file():
        raise ManifestError(path, [Problem(file.name, "no such file", f"a folder with {MANIFEST_FILE}")])
    raw, problems = load_yaml(file)
    if raw is not None or not problems:
        problems += schema_problems(raw)
    manifest = table(raw)
    problems += value_problems(manifest)
    folders = [folder for folder in (data_root, file.parent) if folder is not None]
    found = _Files(SessionFolders(tuple(dict.fromkeys(folder.resolve() for folder in folders))))
    found.collect(manifest)
    problems += found.problems + _same_names(manifest)
    if problems:
        raise ManifestError(file, list(dict.fromkeys(problems)))
    return _Builder(manifest, found.paths).session(file.resolve())


class _Files:
    """Every file that a manifest names, by key."""

    def __init__(self, folders: SessionFolders) -> None:
        self.paths: dict[str, Path] = {}
        self.problems: list[Problem] = []
        self._folders = folders

    def collect(self, manifest: Mapping[str, Any]) -> None:
        """Look for every file of the manifest."""
        for name, entry in table(manifest.get("subjects")).items():
            files = table(entry).get("calibration")
            for index, file in enumerate(files if isinstance(files, list) else []):
                self._add(f"subjects.{name}.calibration[{index}]", file)
            model = table(entry).get("model")
            self._add(f"subjects.{name}.model", model)
            for side in Side:
                self._add(f"subjects.{name}.model.{side}", table(model).get(side))
        for name, entry in table(manifest.get("objects")).items():
            self._add(f"objects.{name}.mesh", table(entry).get("mesh"))
        trials = manifest.get("trials")
        for index, entry in enumerate(trials if isinstance(trials, list) else []):
            for key in ("file", "glove", "clouds", "reference_contacts"):
                self._add(f"trials[{index}].{key}", table(entry).get(key))

    def _add(self, key: str, name: object) -> None:
        if isinstance(name, str) and name:
            found = self._folders.locate(key, name)
            if isinstance(found, Path):
                self.paths[key] = found
            else:
                self.problems.append(found)


def _trial_name(file: str) -> str:
    return Path(file).stem


def _same_names(manifest: Mapping[str, Any]) -> list[Problem]:
    """Return a problem for each trial whose name an earlier trial has."""
    first: dict[str, str] = {}
    problems = []
    trials = manifest.get("trials")
    for index, entry in enumerate(trials if isinstance(trials, list) else []):
        file = table(entry).get("file")
        if not isinstance(file, str):
            continue
        name, key = _trial_name(file), f"trials[{index}].file"
        if name in first:
            allowed = "file names that differ without their endings, since they name the trials"
            problems.append(Problem(key, f"{file!r}, named {name!r} like {first[name]}", allowed))
        first.setdefault(name, key)
    return problems


class _Builder:
    """Makes dataclasses of a manifest that has no problems."""

    def __init__(self, manifest: Mapping[str, Any], paths: Mapping[str, Path]) -> None:
        self._raw = manifest
        self._paths = paths
        self._metres = METRES_PER[manifest["units"]]
        self._trial_keys = frozenset(session_schema()["$defs"]["trial"]["properties"])

    def session(self, path: Path) -> Session:
        raw = self._raw
        custom = isinstance(raw.get("marker_set"), dict)
        x, y, z = (float(part) for part in raw["up"])
        norm = math.hypot(x, y, z)
        return Session(
            path=path,
            id=raw["id"],
            up=(x / norm, y / norm, z / norm),
            file_scale=self._metres,
            marker_set="custom" if custom else FOREARM4_DORSAL20,
            markers=self._placements(raw["marker_set"]) if custom else BUILT_IN_MARKERS,
            marker_names=raw.get("marker_names", {}),
            subjects={name: self._subject(name, entry) for name, entry in raw["subjects"].items()},
            objects={name: self._object(name, entry) for name, entry in raw.get("objects", {}).items()},
            trials=tuple(self._trial(i, entry) for i, entry in enumerate(raw["trials"])),
            raw=raw,
            glove=Glove(**raw.get("glove", {})),
        )

    def _vector(self, value: list[float]) -> Vector:
        x, y, z = (float(part) * self._metres for part in value)
        return x, y, z

    def _placements(self, entries: Mapping[str, Any]) -> dict[str, MarkerPlacement]:
        return {
            label: MarkerPlacement(
                segment=entry["segment"],
                at=entry.get("at"),
                offset=self._vector(entry["offset"]) if isinstance(entry.get("offset"), list) else None,
            )
            for label, entry in entries.items()
        }

    def _subject(self, name: str, entry: Mapping[str, Any]) -> Subject:
        thickness = entry.get("joint_thickness", {})
        calibration = entry.get("calibration", [])
        return Subject(
            name=name,
            sides=_SIDES[entry["hand"]],
            hand_length=self._length(entry.get("hand_length")),
            hand_breadth=self._length(entry.get("hand_breadth")),
            joint_thickness={site: value * self._metres for site, value in thickness.items()},
            calibration=tuple(
                self._paths[f"subjects.{name}.calibration[{i}]"] for i in range(len(calibration))
            ),
            models=self._models(name, entry),
        )

    def _length(self, value: float | None) -> float | None:
        return None if value is None else value * self._metres

    def _models(self, name: str, entry: Mapping[str, Any]) -> dict[Side, Path]:
        key = f"subjects.{name}.model"
        if key in self._paths:  # of the subject's one hand
            return {_SIDES[entry["hand"]][0]: self._paths[key]}
        return {side: self._paths[f"{key}.{side}"] for side in Side if f"{key}.{side}" in self._paths}

    def _object(self, name: str, entry: Mapping[str, Any]) -> SessionObject:
        mesh = self._paths.get(f"objects.{name}.mesh")
        says_metres = mesh is not None and mesh.suffix.lower() in (".glb", ".gltf")  # glTF has no other unit
        units = entry.get("mesh_units", "m" if says_metres else self._raw["units"])
        return SessionObject(
            name=name,
            mesh=mesh,
            mesh_scale=METRES_PER[units],
            markers={label: self._vector(place) for label, place in entry.get("markers", {}).items()},
            mass=entry.get("mass"),
            category=entry.get("category"),
            friction=entry.get("friction"),
            center_of_mass=self._vector(entry["center_of_mass"]) if "center_of_mass" in entry else None,
        )

    def _trial(self, index: int, entry: Mapping[str, Any]) -> SessionTrial:
        key = f"trials[{index}]"
        repetition = entry.get("repetition")
        return SessionTrial(
            name=_trial_name(entry["file"]),
            file=self._paths[f"{key}.file"],
            source_file=entry["file"],
            subject=entry["subject"],
            object=entry.get("object"),
            task=entry.get("task"),
            repetition=None if repetition is None else int(repetition),
            start=entry.get("start"),
            end=entry.get("end"),
            glove=self._paths.get(f"{key}.glove"),
            clouds=self._paths.get(f"{key}.clouds"),
            reference_contacts=self._paths.get(f"{key}.reference_contacts"),
            attributes={name: value for name, value in entry.items() if name not in self._trial_keys},
            sides=_SIDES[entry["hand"]] if "hand" in entry else (),
        )
