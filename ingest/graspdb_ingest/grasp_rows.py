"""Rows of the tables that have one row a grasp or a contact: grasps, contacts, features."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from graspdb_ingest.bounding import box_volume, ellipsoid_volume, sphere_volume
from graspdb_ingest.contact import Contacts
from graspdb_ingest.enclosure import EnclosingSpace, enclosing_space
from graspdb_ingest.events import Hold
from graspdb_ingest.feature import GraspableFeature, graspable_feature
from graspdb_ingest.feature_shape import FeatureShape, feature_shape
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.live_surface import LiveSurface
from graspdb_ingest.objects.solid import Inside
from graspdb_ingest.opposition import Opposition, find_opposition
from graspdb_ingest.parameters import ContactParameters, IngestParameters
from graspdb_ingest.prepared_object import PreparedObject, prepare_live_cloud
from graspdb_ingest.quality import GraspQuality, grasp_quality
from graspdb_ingest.rigid import inverse_transform_points
from graspdb_ingest.surface.touch import PosedHand, touching
from graspdb_ingest.taxonomy import TypedGrasp, grasp_type
from graspdb_ingest.trial import TrackedHand, TrackedObject, TrackedTrial
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.manifest import Session, SessionObject, SessionTrial
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
    prepared : PreparedObject
        What it holds, as it was at the snapshot.
    contacts : Contacts
        What touched where.
    space : EnclosingSpace
        The hand enclosing space, object frame.
    feature : GraspableFeature
        The object's points in it.
    shape : FeatureShape
        The feature's pieces, how it bends and which side of the hand it faces.
    inside : Inside or None
        Volume and surface of the object in the enclosing space; None where its mesh bounds no body.
    opposition : Opposition
        Which parts of the hand oppose each other.
    typed : TypedGrasp
        Its type in the GRASP taxonomy.
    quality : GraspQuality
        How well the contacts can hold the object.
    """

    key: str
    side: Side
    hold: Hold
    prepared: PreparedObject
    contacts: Contacts
    space: EnclosingSpace
    feature: GraspableFeature
    shape: FeatureShape
    inside: Inside | None
    opposition: Opposition
    typed: TypedGrasp
    quality: GraspQuality


def find_grasps(
    trial: str, described: SessionObject | None, tracked: TrackedTrial, parameters: IngestParameters
) -> list[Grasp]:
    """Return the grasps of a trial: contacts, enclosing space and feature at each hold's snapshot."""
    if tracked.object is None or described is None:
        return []
    holds = [
        (f"{trial}/{side}/{number}", hold, hand)
        for side, hand in tracked.hands.items()
        for number, hold in enumerate(hand.holds)
    ]
    snapshots = [hold.snapshot for _, hold, _ in holds]
    things = held_objects(described, tracked.object, snapshots, parameters)
    return [
        _grasp(key, hold, hand, tracked.object, things[hold.snapshot], parameters)
        for key, hold, hand in holds
    ]


def held_objects(
    described: SessionObject, followed: TrackedObject, frames: Sequence[int], parameters: IngestParameters
) -> dict[int, PreparedObject]:
    """Return a trial's object in some frames: its model, or the live clouds that show it then.

    The points of several live clouds stand in the database one cloud after the other.
    """
    if not isinstance(followed.model, LiveSurface):
        return dict.fromkeys(frames, followed.model)
    things: dict[int, PreparedObject] = {}
    first = 0
    for number in sorted({int(followed.model.of_frame[frame]) for frame in frames}):
        live = followed.model.clouds[number]
        things[number] = prepare_live_cloud(described, live, first, parameters)
        first += len(live.cloud.points)
    return {frame: things[int(followed.model.of_frame[frame])] for frame in frames}


def _grasp(
    key: str,
    hold: Hold,
    hand: TrackedHand,
    followed: TrackedObject,
    prepared: PreparedObject,
    parameters: IngestParameters,
) -> Grasp:
    posed = hand.posed.frame(hold.snapshot)
    rotation = _object_from_hand(hand, followed, hold.snapshot)[:3, :3]
    return enclose(key, hold, posed, rotation, prepared, parameters)


def enclose(
    key: str,
    hold: Hold,
    posed: PosedHand,
    rotation: Floats,
    prepared: PreparedObject,
    parameters: IngestParameters,
) -> Grasp:
    """Return the grasp of a hand at one instant: contacts, enclosing space and graspable feature.

    Whatever surface of the hand touches, it is the spheres of the touching sites that enclose.

    Parameters
    ----------
    key, hold
        What the grasp is called, and when.
    posed : PosedHand
        The hand at that instant, and its gaps.
    rotation : ndarray, shape (3, 3)
        object_from_hand rotation of the hand segment.
    prepared : PreparedObject
        The object.
    parameters : IngestParameters
        Contact, enclosing space and quality.
    """
    side = posed.points.side
    contacts = touching(posed, parameters.contact.threshold, prepared.distance)
    centres, radii = posed.points.sites[contacts.sites], posed.points.radii[contacts.sites]
    space = enclosing_space(centres, radii, parameters.contact.sphere_vertices)
    feature = graspable_feature(prepared.cloud, prepared.features, space)
    shape = feature_shape(
        prepared.cloud, prepared.curvatures, prepared.neighbours, feature.points, rotation, side
    )
    opposed = find_opposition(contacts)
    typed = grasp_type(contacts, opposed, posed.points)
    inside = prepared.solid.inside(space.vertices, space.faces)
    edges = parameters.quality.cone_edges
    quality = grasp_quality(contacts.positions, contacts.normals, prepared.mechanics, edges)
    return Grasp(key, side, hold, prepared, contacts, space, feature, shape, inside, opposed, typed, quality)


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
    key = f"{session.id}/{trial.name}"
    common = {
        "session": session.id,
        "trial": key,
        "subject": trial.subject,
        "object": trial.object,
        "task": trial.task,
        "repetition": trial.repetition,
    }
    rows = [common | _grasp_row(g, tracked.hands[g.side], followed, times, parameters) for g in grasps]
    contacts = [row for grasp in grasps for row in contact_rows(key, grasp)]
    features = [feature_row(session.id, key, grasp) for grasp in grasps]
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
    held = held_columns(grasp, hand.posed.frame(frame), parameters)
    return held | {
        "snapshot_time": float(times[frame]),
        "onset_time": float(times[hold.first]),
        "lift_time": None if lift is None else float(times[lift]),
        "release_time": float(times[hold.last]) if hold.released else None,
        "q": hand.track.q[frame].tolist(),
        "object_from_hand": _object_from_hand(hand, followed, frame).tolist(),
    }


def held_columns(grasp: Grasp, posed: PosedHand, parameters: ContactParameters) -> dict[str, object]:
    """Return the columns of `grasps` that follow from the hand at the snapshot alone.

    Parameters
    ----------
    grasp : Grasp
        The grasp.
    posed : PosedHand
        The hand at the snapshot, object frame.
    parameters : ContactParameters
        The threshold that the contacts were found with.
    """
    space, sites = grasp.space, posed.points.sites
    return {
        "grasp": grasp.key,
        "side": str(grasp.side),
        "snapshot_kind": grasp.hold.snapshot_kind,
        "snapshot_frame": grasp.hold.snapshot,
        "digits": list(grasp.contacts.digits),
        "contact_sites": list(grasp.contacts.site_names),
        "n_contacts": len(grasp.contacts.sites),
        "contact_threshold": parameters.threshold,
        "sites_object": sites.tolist(),
        "gap": posed.gaps.gap.tolist(),
        "grip_aperture": float(np.linalg.norm(sites[THUMB_TIP] - sites[INDEX_TIP])),
        "hull_volume": space.volume,
        "box_volume": box_volume(space),
        "ellipsoid_volume": ellipsoid_volume(space),
        "sphere_volume": sphere_volume(space),
        "feature_points": len(grasp.feature.points),
        "feature_area": grasp.feature.area,
        "opposition": grasp.opposition.kind,
        "virtual_fingers": [list(group) for group in grasp.opposition.virtual_fingers],
        "opposition_shares": list(grasp.opposition.shares.items()),
        "grasp_type": grasp.typed.name,
        "grasp_type_confidence": grasp.typed.confidence,
        "object_volume_in_hull": None if grasp.inside is None else grasp.inside.volume,
        "object_area_in_hull": None if grasp.inside is None else grasp.inside.area,
        "quality": list(grasp.quality.indices().items()),
        "force_closure": grasp.quality.force_closure,
    }


def _object_from_hand(hand: TrackedHand, followed: TrackedObject, frame: int) -> Floats:
    """Return the pose of the palm in the object frame, shape (4, 4)."""
    pose = followed.track
    position, rotation = hand.prepared.hand.palm(hand.track.q[frame])
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotations[frame].T @ rotation
    matrix[:3, 3] = inverse_transform_points(
        pose.rotations[frame], pose.positions[frame], np.asarray(position[None], dtype=np.float64)
    )[0]
    return matrix


def contact_rows(trial: str, grasp: Grasp) -> list[dict[str, object]]:
    """Return a row of `contacts` for each touching site."""
    found = grasp.contacts
    return [
        {
            "grasp": grasp.key,
            "trial": trial,
            "site": SITES[site],
            "digit": DIGIT_OF_SITE[site],
            "point": int(found.points[i]) + grasp.prepared.first_point,
            "position": found.positions[i].tolist(),
            "normal": found.normals[i].tolist(),
            "gap": float(found.gap[i]),
            "segment": found.segments[i],
            "pad": found.pads[i],
        }
        for i, site in enumerate(found.sites)
    ]


def feature_row(session: str, trial: str, grasp: Grasp) -> dict[str, object]:
    """Return the row of `features`."""
    feature, shape, space, prepared = grasp.feature, grasp.shape, grasp.space, grasp.prepared
    empty = not len(feature.points)
    return {
        "grasp": grasp.key,
        "trial": trial,
        "session": session,
        "object": prepared.name,
        "points": (feature.points + prepared.first_point).tolist(),
        "hull_vertices": space.vertices.tolist(),
        "hull_faces": space.faces.tolist(),
        "centroid": None if empty else feature.centroid.tolist(),
        "extents": feature.extents.tolist(),
        "area": feature.area,
        "patches": shape.patches.tolist(),
        "patch_areas": shape.patch_areas.tolist(),
        "curvature_class": shape.curvature_class,
        "curvature_shares": list(shape.curvature_shares.items()),
        "hand_side": shape.hand_side,
        "hand_sides": list(shape.hand_sides.items()),
        "descriptor": None if empty else feature.descriptor.tolist(),
        "descriptor_kind": None if empty else prepared.descriptor_kind,
    }
