"""Rows of the tables that have one row a grasp or a contact: grasps, contacts, features."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from graspdb_ingest.contact import Contacts
from graspdb_ingest.enclosure import (
    EnclosingSpace,
    box_volume,
    ellipsoid_volume,
    enclosing_space,
    sphere_volume,
)
from graspdb_ingest.events import Hold
from graspdb_ingest.feature import GraspableFeature, graspable_feature
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import ContactParameters
from graspdb_ingest.rigid import inverse_transform_points
from graspdb_ingest.surface.touch import touching
from graspdb_ingest.trial import TrackedHand, TrackedObject, TrackedTrial
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, SITES, Side

THUMB_TIP, INDEX_TIP = SITES.index("thumb_tip"), SITES.index("index_tip")


@dataclass(frozen=True)
class Grasp:
    """One hold at its snapshot.

    Attributes
    ----------
    key : str
        ``<trial>/<side>/<number>``.
    side : Side
        Right or left.
    hold : Hold
        When.
    contacts : Contacts
        What touched where.
    space : EnclosingSpace
        The hand enclosing space, object frame.
    feature : GraspableFeature
        The object's points in it.
    """

    key: str
    side: Side
    hold: Hold
    contacts: Contacts
    space: EnclosingSpace
    feature: GraspableFeature


def find_grasps(trial: str, tracked: TrackedTrial, parameters: ContactParameters) -> list[Grasp]:
    """Return the grasps of a trial: contacts, enclosing space and feature at each hold's snapshot."""
    if tracked.object is None:
        return []
    return [
        _grasp(f"{trial}/{side}/{number}", side, hold, hand, tracked.object, parameters)
        for side, hand in tracked.hands.items()
        for number, hold in enumerate(hand.holds)
    ]


def _grasp(
    key: str,
    side: Side,
    hold: Hold,
    hand: TrackedHand,
    followed: TrackedObject,
    parameters: ContactParameters,
) -> Grasp:
    prepared, frame = followed.prepared, hold.snapshot
    contacts = touching(
        hand.points.frame(frame),
        hand.surface.frame(frame),
        hand.gaps.frame(frame),
        parameters.threshold,
        prepared.distance,
    )
    centres = hand.sites_object[frame, contacts.sites]
    radii = hand.prepared.hand.radii[contacts.sites]
    space = enclosing_space(centres, radii, parameters.sphere_vertices)
    feature = graspable_feature(prepared.cloud, prepared.histograms, space)
    return Grasp(key, side, hold, contacts, space, feature)


def grasp_rows(
    session: Session,
    trial: SessionTrial,
    tracked: TrackedTrial,
    grasps: list[Grasp],
    parameters: ContactParameters,
) -> dict[str, pa.Table]:
    """Return the rows of `grasps`, `contacts` and `features`."""
    if tracked.object is None or not grasps:
        return {}
    followed, times = tracked.object, tracked.markers.times
    key, name = f"{session.id}/{trial.name}", followed.prepared.name
    common = {
        "session": session.id,
        "trial": key,
        "subject": trial.subject,
        "object": name,
        "task": trial.task,
        "repetition": trial.repetition,
    }
    rows = [common | _grasp_row(g, tracked.hands[g.side], followed, times, parameters) for g in grasps]
    contacts = [row for grasp in grasps for row in _contact_rows(key, grasp)]
    features = [_feature_row(session.id, key, name, grasp) for grasp in grasps]
    return {
        "grasps": pa.Table.from_pylist(rows, schema=rows_schema("grasps")),
        "contacts": pa.Table.from_pylist(contacts, schema=rows_schema("contacts")),
        "features": pa.Table.from_pylist(features, schema=rows_schema("features")),
    }


def _grasp_row(
    grasp: Grasp,
    hand: TrackedHand,
    followed: TrackedObject,
    times: Floats,
    parameters: ContactParameters,
) -> dict[str, object]:
    hold, frame, lift = grasp.hold, grasp.hold.snapshot, grasp.hold.lift_onset
    sites, space = hand.sites_object[frame], grasp.space
    return {
        "grasp": grasp.key,
        "side": str(grasp.side),
        "snapshot_kind": hold.snapshot_kind,
        "snapshot_frame": frame,
        "snapshot_time": float(times[frame]),
        "onset_time": float(times[hold.first]),
        "lift_time": None if lift is None else float(times[lift]),
        "release_time": float(times[hold.last]) if hold.released else None,
        "digits": list(grasp.contacts.digits),
        "contact_sites": list(grasp.contacts.site_names),
        "n_contacts": len(grasp.contacts.sites),
        "contact_threshold": parameters.threshold,
        "q": hand.track.q[frame].tolist(),
        "sites_object": sites.tolist(),
        "object_from_hand": _object_from_hand(hand, followed, frame).tolist(),
        "gap": hand.gaps.gap[frame].tolist(),
        "grip_aperture": float(np.linalg.norm(sites[THUMB_TIP] - sites[INDEX_TIP])),
        "hull_volume": space.volume,
        "box_volume": box_volume(space),
        "ellipsoid_volume": ellipsoid_volume(space),
        "sphere_volume": sphere_volume(space),
        "feature_points": len(grasp.feature.points),
        "feature_area": grasp.feature.area,
        "quality": [],
    }


def _object_from_hand(hand: TrackedHand, followed: TrackedObject, frame: int) -> Floats:
    """Return the pose of the hand segment in the object frame, shape (4, 4)."""
    model, pose = hand.prepared.hand, followed.track
    posture = model.forward(hand.track.q[frame])
    segment = model.segments.index("hand")
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotations[frame].T @ posture.rotations[segment]
    matrix[:3, 3] = inverse_transform_points(
        pose.rotations[frame], pose.positions[frame], posture.positions[segment][None]
    )[0]
    return matrix


def _contact_rows(trial: str, grasp: Grasp) -> list[dict[str, object]]:
    found = grasp.contacts
    return [
        {
            "grasp": grasp.key,
            "trial": trial,
            "site": SITES[site],
            "digit": DIGIT_OF_SITE[site],
            "point": int(found.points[i]),
            "position": found.positions[i].tolist(),
            "normal": found.normals[i].tolist(),
            "gap": float(found.gap[i]),
            "segment": found.segments[i],
            "pad": found.pads[i],
        }
        for i, site in enumerate(found.sites)
    ]


def _feature_row(session: str, trial: str, name: str, grasp: Grasp) -> dict[str, object]:
    feature, space = grasp.feature, grasp.space
    empty = not len(feature.points)
    return {
        "grasp": grasp.key,
        "trial": trial,
        "session": session,
        "object": name,
        "points": feature.points.tolist(),
        "hull_vertices": space.vertices.tolist(),
        "hull_faces": space.faces.tolist(),
        "centroid": None if empty else feature.centroid.tolist(),
        "extents": feature.extents.tolist(),
        "area": feature.area,
        "descriptor": None if empty else feature.descriptor.tolist(),
    }
