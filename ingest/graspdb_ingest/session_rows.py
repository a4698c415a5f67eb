"""Rows that describe a session: itself, its subjects, objects, calibrated hands and clouds."""

import json
from collections.abc import Iterable

import numpy as np
import pyarrow as pa

from graspdb_ingest.columns import list_column, table
from graspdb_ingest.prepare import PreparedHand, PreparedObject
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.manifest import Session
from graspdb_schemas.tables import HANDS, OBJECT_POINTS, OBJECTS, SESSIONS, SUBJECTS


def session_rows(
    session: Session, objects: Iterable[PreparedObject], hands: Iterable[PreparedHand]
) -> TrialTables:
    """Return the rows of a session that its trials refer to."""
    objects, hands = list(objects), list(hands)
    clouds = [_object_points(session.id, prepared) for prepared in objects]
    return TrialTables(
        {
            "sessions": _session(session),
            "subjects": _subjects(session),
            "objects": _objects(session, objects),
            "hands": _hands(session.id, hands),
            **({"object_points": pa.concat_tables(clouds)} if clouds else {}),
        }
    )


def _session(session: Session) -> pa.Table:
    marker_set = session.raw.get("marker_set")
    return table(
        SESSIONS,
        {
            "session": [session.id],
            "up": [list(session.up)],
            "marker_set": [marker_set if isinstance(marker_set, str) else json.dumps(marker_set)],
            "manifest": [json.dumps(session.raw, default=str, sort_keys=True)],
        },
    )


def _subjects(session: Session) -> pa.Table:
    subjects = list(session.subjects.values())
    return table(
        SUBJECTS,
        {
            "session": [session.id] * len(subjects),
            "subject": [s.name for s in subjects],
            "hand": ["both" if len(s.sides) == 2 else str(s.sides[0]) for s in subjects],
            "hand_length": [s.hand_length for s in subjects],
            "hand_breadth": [s.hand_breadth for s in subjects],
            "joint_thickness": [list(s.joint_thickness.items()) for s in subjects],
        },
    )


def _objects(session: Session, objects: list[PreparedObject]) -> pa.Table:
    described = [session.objects[prepared.name] for prepared in objects]
    surfaces = [prepared.surface for prepared in objects]
    return table(
        OBJECTS,
        {
            "session": [session.id] * len(objects),
            "object": [prepared.name for prepared in objects],
            "category": [d.category for d in described],
            "mass": [d.mass for d in described],
            "mesh_sha256": [s.sha256 for s in surfaces],
            "area": [float(prepared.cloud.areas.sum()) for prepared in objects],
            "volume": [s.volume for s in surfaces],
            "extents": [s.extents.tolist() for s in surfaces],
            "watertight": [s.watertight for s in surfaces],
            "cloud_spacing": [prepared.cloud.spacing for prepared in objects],
            "n_points": [len(prepared.cloud.points) for prepared in objects],
            "warnings": [list(s.warnings) for s in surfaces],
        },
    )


def _hands(session: str, hands: list[PreparedHand]) -> pa.Table:
    return table(
        HANDS,
        {
            "session": [session] * len(hands),
            "subject": [hand.subject for hand in hands],
            "side": [str(hand.hand.side) for hand in hands],
            "mjcf": [hand.hand.mjcf for hand in hands],
            "segment_lengths": [list(hand.hand.segment_lengths.items()) for hand in hands],
            "radii": [hand.hand.radii.tolist() for hand in hands],
            "calibrated_markers": [list(hand.calibrated_markers) for hand in hands],
            "residual_before": [_rms(hand.before) for hand in hands],
            "residual": [_rms(hand.after) for hand in hands],
        },
    )


def _object_points(session: str, prepared: PreparedObject) -> pa.Table:
    cloud, n = prepared.cloud, len(prepared.cloud.points)
    return table(
        OBJECT_POINTS,
        {
            "session": pa.repeat(session, n),
            "object": pa.repeat(prepared.name, n),
            "point": np.arange(n),
            "position": list_column(cloud.points),
            "normal": list_column(cloud.normals),
            "area": cloud.areas,
            "fpfh": list_column(prepared.histograms),
        },
    )


def _rms(by_marker: np.ndarray) -> float | None:
    return float(np.sqrt(np.nanmean(by_marker**2))) if np.isfinite(by_marker).any() else None
