"""Rows of static grasps: what they bring to the database, each with a trial of its own."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pyarrow as pa

from graspdb_ingest.contact_rows import map_row
from graspdb_ingest.grasp_rows import Grasp, contact_rows, feature_row, held_columns
from graspdb_ingest.input_key import software_version
from graspdb_ingest.keypoints import KeyPointGrasp, object_from_hand, static_grasp
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.session_rows import object_point_rows, object_row
from graspdb_ingest.surface.touch import PosedHand
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema


def keypoint_session_rows(
    grasps: Sequence[KeyPointGrasp],
    objects: Sequence[PreparedObject],
    categories: Mapping[str, str] | None = None,
    masses: Mapping[str, float] | None = None,
) -> TrialTables:
    """Return the rows that static grasps of one session stand on.

    Parameters
    ----------
    grasps : sequence of KeyPointGrasp
        All grasps of the session, at least one.
    objects : sequence of PreparedObject
        Their objects.
    categories, masses : mapping, optional
        Category, and mass [kg], of an object by its name.
    """
    session = grasps[0].session
    categories, masses = categories or {}, masses or {}
    rows = {
        "sessions": pa.Table.from_pylist(
            [{"session": session, "up": None, "marker_set": None, "manifest": None}],
            schema=rows_schema("sessions"),
        ),
        "subjects": _subjects(grasps),
        "hands": _hands(grasps),
        "objects": pa.concat_tables(
            [object_row(session, o, categories.get(o.name), masses.get(o.name)) for o in objects]
        ),
        "object_points": pa.concat_tables([object_point_rows(session, o) for o in objects]),
    }
    return TrialTables(rows)


def keypoint_rows(
    described: KeyPointGrasp, prepared: PreparedObject, parameters: IngestParameters
) -> TrialTables:
    """Return the rows of one static grasp: a trial of one frame, with one grasp.

    The lab frame of such a trial is the object's.
    """
    grasp, posed = static_grasp(described, prepared, parameters)
    trial, name = described.trial, prepared.name
    common = {
        "session": described.session,
        "trial": trial,
        "subject": described.subject,
        "object": name,
        "task": described.task,
        "repetition": None,
    }
    rows = {
        "trials": [common | _trial_columns(described, prepared, parameters)],
        "frames": [_frame(described, posed)],
        "grasps": [common | _grasp_columns(described, grasp, posed, parameters)],
        "contacts": contact_rows(trial, grasp),
        "features": [feature_row(described.session, trial, grasp)],
        "contact_maps": [map_row(described.session, trial, prepared, posed, grasp.key, parameters.contact)],
    }
    return TrialTables(
        {
            table: pa.Table.from_pylist(_whole(table, found), rows_schema(table))
            for table, found in rows.items()
        }
    )


def _whole(table: str, rows: Iterable[Mapping[str, object]]) -> list[dict[str, object]]:
    """Return rows with null for every column that they leave out."""
    names = rows_schema(table).names
    return [{name: row.get(name) for name in names} for row in rows]


def _trial_columns(
    described: KeyPointGrasp, prepared: PreparedObject, parameters: IngestParameters
) -> dict[str, object]:
    return {
        "attributes": json.dumps(dict(described.attributes), sort_keys=True, default=str),
        "n_frames": 1,
        "duration": 0.0,
        "source_file": described.source_file,
        "source_sha256": described.source_sha256,
        "input_key": _input_key(described, prepared, parameters),
        "parameters": parameters.to_json(),
        "software_version": software_version(),
        "status": "ok",
        "reasons": [],
        "n_grasps": 1,
    }


def _input_key(described: KeyPointGrasp, prepared: PreparedObject, parameters: IngestParameters) -> str:
    """Return the sha256 of everything that decides the rows."""
    digest = hashlib.sha256(np.ascontiguousarray(described.key_points, dtype=np.float64).tobytes())
    digest.update(np.ascontiguousarray(described.dimensions.radii).tobytes())
    digest.update(np.ascontiguousarray(prepared.cloud.points).tobytes())
    rest = {
        "named": [described.subject, described.side, described.task, described.source_file, prepared.name],
        "attributes": dict(described.attributes),
        "parameters": parameters.to_json(),
        "software": software_version(),
    }
    digest.update(json.dumps(rest, sort_keys=True, default=str).encode())
    return digest.hexdigest()


def _frame(described: KeyPointGrasp, posed: PosedHand) -> dict[str, object]:
    return {
        "trial": described.trial,
        "side": str(described.side),
        "frame": 0,
        "time": 0.0,
        "sites": described.sites.tolist(),
        "object_position": [0.0, 0.0, 0.0],
        "object_quaternion": [1.0, 0.0, 0.0, 0.0],
        "gap": posed.gaps.gap.tolist(),
        "flags": [],
    }


def _grasp_columns(
    described: KeyPointGrasp, grasp: Grasp, posed: PosedHand, parameters: IngestParameters
) -> dict[str, object]:
    pose = object_from_hand(described.key_points, described.dimensions, described.side)
    return {
        **held_columns(grasp, posed, parameters.contact),
        "snapshot_time": 0.0,
        "object_from_hand": pose.tolist(),
    }


def _subjects(grasps: Sequence[KeyPointGrasp]) -> pa.Table:
    """Return a row a subject; one whose grasps are of both hands has both."""
    sides: dict[str, set[str]] = {}
    for grasp in grasps:
        sides.setdefault(grasp.subject, set()).add(str(grasp.side))
    first = {grasp.subject: grasp for grasp in reversed(grasps)}
    found = [
        {
            "session": first[subject].session,
            "subject": subject,
            "hand": "both" if len(used) == 2 else min(used),
            "hand_length": first[subject].dimensions.hand_length,
            "hand_breadth": first[subject].dimensions.hand_breadth,
            "joint_thickness": list(first[subject].dimensions.joint_thickness.items()),
        }
        for subject, used in sides.items()
    ]
    return pa.Table.from_pylist(found, rows_schema("subjects"))


def _hands(grasps: Sequence[KeyPointGrasp]) -> pa.Table:
    """Return a row a subject and side: radii alone, for nobody calibrated a model."""
    found = {
        (grasp.subject, grasp.side): {
            "session": grasp.session,
            "subject": grasp.subject,
            "side": str(grasp.side),
            "radii": grasp.dimensions.radii.tolist(),
        }
        for grasp in grasps
    }
    return pa.Table.from_pylist(_whole("hands", found.values()), rows_schema("hands"))
