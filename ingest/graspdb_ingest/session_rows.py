"""Rows that describe a session: itself, its subjects, objects, calibrated hands and clouds."""

import json
from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from graspdb_ingest.columns import list_column, table
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.prepare import PreparedHand, PreparedObject
from graspdb_schemas.manifest import Session, Subject
from graspdb_schemas.tables import HANDS, OBJECT_POINTS, OBJECTS, SESSIONS, SUBJECTS


def session_rows(
    session: Session, subject: Subject, hands: Sequence[PreparedHand], prepared: PreparedObject | None
) -> dict[str, pa.Table]:
    """Return the rows that a trial stands on: its session, subject, calibrated hands and object."""
    rows = {
        "sessions": _session(session),
        "subjects": _subject(session.id, subject),
        "hands": _hands(session.id, hands),
    }
    if prepared is not None:
        rows["objects"] = _object(session, prepared)
        rows["object_points"] = _object_points(session.id, prepared)
    return rows


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


def _subject(session: str, subject: Subject) -> pa.Table:
    return table(
        SUBJECTS,
        {
            "session": [session],
            "subject": [subject.name],
            "hand": ["both" if len(subject.sides) == 2 else str(subject.sides[0])],
            "hand_length": [subject.hand_length],
            "hand_breadth": [subject.hand_breadth],
            "joint_thickness": [list(subject.joint_thickness.items())],
        },
    )


def _object(session: Session, prepared: PreparedObject) -> pa.Table:
    described, surface = session.objects[prepared.name], prepared.surface
    return table(
        OBJECTS,
        {
            "session": [session.id],
            "object": [prepared.name],
            "category": [described.category],
            "mass": [described.mass],
            "mesh_sha256": [surface.sha256],
            "area": [float(prepared.cloud.areas.sum())],
            "volume": [surface.volume],
            "extents": [surface.extents.tolist()],
            "watertight": [surface.watertight],
            "cloud_spacing": [prepared.cloud.spacing],
            "n_points": [len(prepared.cloud.points)],
            "warnings": [list(surface.warnings)],
        },
    )


def _hands(session: str, hands: Sequence[PreparedHand]) -> pa.Table:
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


def _rms(by_marker: Floats) -> float | None:
    return float(np.sqrt(np.nanmean(by_marker**2))) if np.isfinite(by_marker).any() else None
