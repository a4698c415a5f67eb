"""Rows that describe a session: itself, its subjects, objects, calibrated hands and clouds."""

import json
from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from graspdb_ingest.columns import list_column
from graspdb_ingest.grasp_rows import Grasp, held_objects
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand
from graspdb_ingest.prepared_object import PreparedObject, join_live_clouds
from graspdb_ingest.trial import TrackedTrial
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.manifest import Session, SessionObject


def session_rows(
    session: Session, hands: Sequence[PreparedHand], objects: Sequence[PreparedObject]
) -> TrialTables:
    """Return the rows that trials stand on: the session, its subjects, calibrated hands and objects."""
    rows = {
        "sessions": _session(session),
        "subjects": _subjects(session),
        "hands": hand_rows(session.id, hands),
    }
    if objects:
        described = session.objects
        rows["objects"] = pa.concat_tables(
            [object_row(session.id, o, described[o.name].category, described[o.name].mass) for o in objects]
        )
        rows["object_points"] = pa.concat_tables([object_point_rows(session.id, o) for o in objects])
    return TrialTables(rows)


def _session(session: Session) -> pa.Table:
    marker_set = session.raw.get("marker_set")
    return pa.Table.from_pydict(
        {
            "session": [session.id],
            "up": [list(session.up)],
            "marker_set": [marker_set if isinstance(marker_set, str) else json.dumps(marker_set)],
            "manifest": [json.dumps(session.raw, default=str, sort_keys=True)],
        },
        schema=rows_schema("sessions"),
    )


def _subjects(session: Session) -> pa.Table:
    subjects = list(session.subjects.values())
    return pa.Table.from_pydict(
        {
            "session": [session.id] * len(subjects),
            "subject": [s.name for s in subjects],
            "hand": ["both" if len(s.sides) == 2 else str(s.sides[0]) for s in subjects],
            "hand_length": [s.hand_length for s in subjects],
            "hand_breadth": [s.hand_breadth for s in subjects],
            "joint_thickness": [list(s.joint_thickness.items()) for s in subjects],
        },
        schema=rows_schema("subjects"),
    )


def object_row(session: str, prepared: PreparedObject, category: str | None, mass: float | None) -> pa.Table:
    """Return the row of `objects`; mass in kilograms."""
    surface, mechanics = prepared.surface, prepared.mechanics
    return pa.Table.from_pydict(
        {
            "session": [session],
            "object": [prepared.name],
            "category": [category],
            "mass": [mass],
            "mesh_sha256": [surface.sha256],
            "area": [float(prepared.cloud.areas.sum())],
            "volume": [surface.volume],
            "extents": [surface.extents.tolist()],
            "watertight": [surface.watertight],
            "cloud_spacing": [prepared.cloud.spacing],
            "n_points": [len(prepared.cloud.points)],
            "warnings": [[*surface.warnings, *mechanics.warnings]],
            "friction": [mechanics.friction],
            "friction_source": ["manifest" if mechanics.friction_given else "default"],
            "center_of_mass": [mechanics.center_of_mass.tolist()],
            "center_of_mass_source": [mechanics.center_source],
            "radius": [mechanics.radius],
        },
        schema=rows_schema("objects"),
    )


def hand_rows(session: str, hands: Sequence[PreparedHand]) -> pa.Table:
    """Return the rows of `hands`: calibrated hand models."""
    return pa.Table.from_pydict(
        {
            "session": [session] * len(hands),
            "subject": [hand.subject for hand in hands],
            "side": [str(hand.hand.side) for hand in hands],
            "mjcf": [hand.hand.mjcf for hand in hands],
            "segment_lengths": [list(hand.hand.segment_lengths.items()) for hand in hands],
            "radii": [hand.hand.radii.tolist() for hand in hands],
            "calibrated_markers": [list(hand.calibrated_markers) for hand in hands],
            "residual_before": [_rms(hand.calibration.before) for hand in hands],
            "residual": [_rms(hand.calibration.after) for hand in hands],
            "segment_length_sd": [list(hand.calibration.length_sd.items()) for hand in hands],
            "markers": [list(hand.hand.markers) for hand in hands],
            "marker_residuals_before": [_known(hand.calibration.before) for hand in hands],
            "marker_residuals": [_known(hand.calibration.after) for hand in hands],
            "marker_sd": [hand.calibration.marker_sd.tolist() for hand in hands],
            "n_calibration_frames": [hand.calibration.n_frames for hand in hands],
            "prior_mean": [hand.prior.mean.tolist() for hand in hands],
            "prior_covariance": [hand.prior.covariance.tolist() for hand in hands],
            "n_prior_frames": [hand.learned.n_frames for hand in hands],
            "n_prior_postures": [hand.learned.n_independent for hand in hands],
            "calibration_notes": [list(hand.calibration.notes) for hand in hands],
            "calibration_recordings": [list(hand.recordings.items()) for hand in hands],
        },
        schema=rows_schema("hands"),
    )


def object_point_rows(session: str, prepared: PreparedObject) -> pa.Table:
    """Return the rows of `object_points`: the object's cloud."""
    cloud, n = prepared.cloud, len(prepared.cloud.points)
    return pa.Table.from_pydict(
        {
            "session": pa.repeat(session, n),
            "object": pa.repeat(prepared.name, n),
            "point": np.arange(n),
            "position": list_column(cloud.points),
            "normal": list_column(cloud.normals),
            "area": cloud.areas,
            "fpfh": list_column(prepared.histograms),
            "curvatures": list_column(prepared.curvatures),
        },
        schema=rows_schema("object_points"),
    )


def live_object_rows(
    session: str,
    described: SessionObject,
    tracked: TrackedTrial,
    grasps: Sequence[Grasp],
    parameters: IngestParameters,
) -> dict[str, pa.Table]:
    """Return the rows of an object that a trial's live clouds alone show: of the clouds of its grasps.

    A trial without a grasp has those of its first cloud; one without a cloud that can be used, none.
    """
    if tracked.object is None or not tracked.object.track.known.any():
        return {}
    parts = {grasp.prepared.first_point: grasp.prepared for grasp in grasps}
    if not parts:
        first = int(tracked.object.track.known.argmax())
        parts = {0: held_objects(described, tracked.object, [first], parameters)[first]}
    thing = join_live_clouds(described, [parts[i] for i in sorted(parts)], parameters)
    return {
        "objects": object_row(session, thing, described.category, described.mass),
        "object_points": object_point_rows(session, thing),
    }


def _known(by_marker: Floats) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in by_marker]


def _rms(by_marker: Floats) -> float | None:
    return float(np.sqrt(np.nanmean(by_marker**2))) if np.isfinite(by_marker).any() else None
