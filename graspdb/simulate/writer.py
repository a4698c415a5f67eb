"""A session on disk as graspdb ingests it: session.yaml, objects as STL, trials as C3D."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import ezc3d
import numpy as np
import trimesh
import yaml

from graspdb.simulate.arrays import Floats
from graspdb.simulate.objects import SimulatedObject
from graspdb.simulate.subjects import SimulatedSubject
from graspdb_schemas.vocabulary import FOREARM4_DORSAL20

MILLIMETRES: Final = 1000.0
"""Millimetres in a metre: files are written in millimetres."""


@dataclass(frozen=True)
class TrialEntry:
    """One line of the manifest's trials."""

    name: str
    subject: str
    object: str
    repetition: int
    reference_contacts: bool = False
    glove: bool = False


def write_c3d(path: Path, labels: tuple[str, ...], positions: Floats, rate: float) -> None:
    """Write marker trajectories [m], shape (n_frames, n_markers, 3); NaN gets a residual of -1."""
    n_frames, n_markers, _ = positions.shape
    points = np.ones((4, n_markers, n_frames))
    points[:3] = MILLIMETRES * positions.transpose(2, 1, 0)
    residuals = np.where(np.isnan(points[:1]).any(axis=0), -1.0, 0.0)[None]
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    file.write(str(path))


def write_object(directory: Path, body: SimulatedObject) -> None:
    """Write an object's surface as ``objects/<name>.stl`` in millimetres."""
    folder = directory / "objects"
    folder.mkdir(exist_ok=True)
    mesh = trimesh.Trimesh(MILLIMETRES * body.mesh.vertices, body.mesh.faces, process=False)
    mesh.export(folder / f"{body.name}.stl")


def write_manifest(
    directory: Path,
    session_id: str,
    subjects: Sequence[SimulatedSubject],
    objects: Sequence[SimulatedObject],
    trials: Sequence[TrialEntry],
) -> None:
    """Write ``session.yaml`` in millimetres, with the keys that the session format has and no others."""
    manifest = {
        "graspdb_session": 1,
        "id": session_id,
        "units": "mm",
        "up": [0, 0, 1],
        "marker_set": FOREARM4_DORSAL20,
        "subjects": {subject.name: _subject(subject) for subject in subjects},
        "objects": {body.name: _object(body) for body in objects},
        "trials": [_trial(trial) for trial in trials],
    }
    text = yaml.safe_dump(manifest, sort_keys=False, default_flow_style=None, width=110)
    (directory / "session.yaml").write_text(text, encoding="utf-8")


def _subject(subject: SimulatedSubject) -> dict[str, Any]:
    dimensions = subject.dimensions
    return {
        "hand": str(subject.side),
        "hand_length": _mm(dimensions.hand_length),
        "hand_breadth": _mm(dimensions.hand_breadth),
        "joint_thickness": {site: _mm(t) for site, t in dimensions.joint_thickness.items()},
    }


def _object(body: SimulatedObject) -> dict[str, Any]:
    places = zip(body.marker_labels, body.markers.tolist(), strict=True)
    return {
        "mesh": f"objects/{body.name}.stl",
        "mesh_units": "mm",
        "markers": {label: [_mm(x) for x in place] for label, place in places},
        "mass": round(body.mass, 4),
        "category": body.name,
    }


def _trial(trial: TrialEntry) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "file": f"trials/{trial.name}.c3d",
        "subject": trial.subject,
        "object": trial.object,
        "task": "lift",
        "repetition": trial.repetition,
    }
    if trial.reference_contacts:
        entry["reference_contacts"] = f"reference/{trial.name}.csv"
    if trial.glove:
        entry["glove"] = f"gloves/{trial.name}.csv"
    return entry


def _mm(metres: float) -> float:
    return round(MILLIMETRES * metres, 4)
