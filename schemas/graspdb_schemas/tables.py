"""The tables of a grasp database: columns, types, units and one line of documentation for each.

A schema is a `pyarrow.Schema`; a field's metadata holds ``unit`` and ``doc``. Delta Lake keeps no
fixed-size lists, so arrays are plain lists whose length is given in ``doc``.
"""

from typing import Final

import pyarrow as pa

SCHEMA_VERSION: Final = 2
"""Raised whenever a stored table changes in a way that old readers or writers would not survive.

Tables only grow: a database of an older format is read with nulls in the columns that it lacks.
"""

VECTOR: Final = pa.list_(pa.float64())
VECTOR32: Final = pa.list_(pa.float32())
MATRIX: Final = pa.list_(VECTOR)
MATRIX32: Final = pa.list_(VECTOR32)
INDICES: Final = pa.list_(pa.int32())
TEXTS: Final = pa.list_(pa.string())


def _column(name: str, kind: pa.DataType, doc: str, unit: str = "", nullable: bool = True) -> pa.Field:
    return pa.field(name, kind, nullable=nullable, metadata={"unit": unit, "doc": doc})


def _key(name: str, doc: str) -> pa.Field:
    return _column(name, pa.string(), doc, nullable=False)


_INGEST_ID = _key("ingest_id", "the ingest that wrote this row; it counts if trials names it")
_SESSION = _key("session", "identifier of the session")
_TRIAL = _key("trial", "<session>/<name of the trial's file without its ending>")
_GRASP = _key("grasp", "<trial>/<side>/<number of the grasp in the trial>")
_SIDE = _key("side", "right or left")
_SUBJECT = _key("subject", "name of the subject in its session")
_OBJECT = _key("object", "name of the object in its session")

SESSIONS: Final = pa.schema(
    [
        _SESSION,
        _column("up", VECTOR, "vertical of the lab frame, unit vector (3)"),
        _column("marker_set", pa.string(), "name of the marker set, or its table as JSON"),
        _column("manifest", pa.string(), "the manifest as JSON"),
        _INGEST_ID,
    ]
)

SUBJECTS: Final = pa.schema(
    [
        _SESSION,
        _SUBJECT,
        _column("hand", pa.string(), "right, left or both"),
        _column("hand_length", pa.float64(), "wrist crease to tip of the middle finger", "m"),
        _column("hand_breadth", pa.float64(), "breadth over the finger knuckles", "m"),
        _column("joint_thickness", pa.map_(pa.string(), pa.float64()), "caliper, by site", "m"),
        _INGEST_ID,
    ]
)

OBJECTS: Final = pa.schema(
    [
        _SESSION,
        _OBJECT,
        _column("category", pa.string(), "category that the manifest gives"),
        _column("mass", pa.float64(), "mass that the manifest gives", "kg"),
        _column("mesh_sha256", pa.string(), "sha256 of the mesh or cloud file"),
        _column("area", pa.float64(), "area of the surface", "m2"),
        _column("volume", pa.float64(), "enclosed volume; null where the mesh is not watertight", "m3"),
        _column("extents", VECTOR, "size along the mesh's axes (3)", "m"),
        _column("watertight", pa.bool_(), "whether the mesh is closed"),
        _column("cloud_spacing", pa.float64(), "spacing asked of the cloud", "m"),
        _column("n_points", pa.int32(), "number of points of the cloud"),
        _column("warnings", TEXTS, "what was found wrong with the mesh and put up with"),
        _column("friction", pa.float64(), "coefficient of friction that grasp quality is computed with"),
        _column("friction_source", pa.string(), "manifest, or default: the ingest's parameter"),
        _column("center_of_mass", VECTOR, "in the object frame (3)", "m"),
        _column(
            "center_of_mass_source",
            pa.string(),
            "manifest; volume: centroid of the closed mesh; area: centroid of the surface",
        ),
        _column("radius", pa.float64(), "largest distance of the surface from the center of mass", "m"),
        _INGEST_ID,
    ]
)

HANDS: Final = pa.schema(
    [
        _SESSION,
        _SUBJECT,
        _SIDE,
        _column("mjcf", pa.string(), "calibrated hand model, as MuJoCo's XML"),
        _column("segment_lengths", pa.map_(pa.string(), pa.float64()), "by segment", "m"),
        _column("radii", VECTOR, "sphere radii in the order of the sites (20)", "m"),
        _column("calibrated_markers", TEXTS, "markers whose offsets calibration found"),
        _column("residual_before", pa.float64(), "rms distance of marker to model at the start", "m"),
        _column("residual", pa.float64(), "rms distance of marker to model after calibration", "m"),
        _column(
            "segment_length_sd", pa.map_(pa.string(), pa.float64()), "standard deviation by segment", "m"
        ),
        _column("markers", TEXTS, "labels of the hand's markers, in the order of the columns by marker"),
        _column("marker_residuals_before", VECTOR, "rms distance of each marker at the start", "m"),
        _column("marker_residuals", VECTOR, "rms distance of each marker after calibration", "m"),
        _column("marker_sd", VECTOR, "standard deviation of each marker about its place, each axis", "m"),
        _column("n_calibration_frames", pa.int32(), "frames that the hand was calibrated on"),
        _column("prior_mean", VECTOR, "mean of the posture prior, in the order of the hinges (23)", "rad"),
        _column("prior_covariance", MATRIX, "covariance of the posture prior (23 x 23)", "rad2"),
        _column("n_prior_frames", pa.int32(), "frames that the prior was learned from; 0 for any hand's"),
        _column("n_prior_postures", pa.float64(), "independent postures that they are worth"),
        _column("calibration_notes", TEXTS, "what the recordings could not tell, and what stands in for it"),
        _column(
            "calibration_recordings",
            pa.map_(pa.string(), pa.string()),
            "recordings it was calibrated from: file as the manifest names it -> hash of what was used of it",
        ),
        _INGEST_ID,
    ]
)

OBJECT_POINTS: Final = pa.schema(
    [
        _SESSION,
        _OBJECT,
        _column("point", pa.int32(), "index of the point in the object's cloud", nullable=False),
        _column("position", VECTOR32, "position in the object frame (3)", "m"),
        _column("normal", VECTOR32, "outward unit normal in the object frame (3)"),
        _column("area", pa.float32(), "surface area that the point stands for", "m2"),
        _column("fpfh", VECTOR32, "fast point feature histogram, on the smoothed surface (33)"),
        _column(
            "curvatures",
            VECTOR32,
            "principal curvatures, greater magnitude first, convex positive (2)",
            "1/m",
        ),
        _INGEST_ID,
    ]
)

TRIALS: Final = pa.schema(
    [
        _SESSION,
        _TRIAL,
        _column("subject", pa.string(), "name of the subject in its session"),
        _column("object", pa.string(), "name of the object in its session; null without one"),
        _column("task", pa.string(), "task that the manifest gives"),
        _column("repetition", pa.int32(), "repetition that the manifest gives"),
        _column("attributes", pa.string(), "further keys of the trial in the manifest, as JSON"),
        _column("rate", pa.float64(), "frames per second", "Hz"),
        _column("n_frames", pa.int32(), "number of frames"),
        _column("duration", pa.float64(), "from the first frame to the last", "s"),
        _column("source_file", pa.string(), "file of the recording, as the manifest names it"),
        _column("source_sha256", pa.string(), "sha256 of that file"),
        _column("input_key", pa.string(), "sha256 of everything that decides this trial's rows"),
        _column(
            "inputs",
            pa.map_(pa.string(), pa.string()),
            "the same part by part: file, key of the manifest, group of parameters -> hash",
        ),
        _column("parameters", pa.string(), "parameters of the ingest, as JSON"),
        _column("software_version", pa.string(), "version of graspdb that wrote the rows"),
        _column("status", pa.string(), "ok or rejected"),
        _column("reasons", TEXTS, "why it was rejected, or what to know of it"),
        _column("missing_fraction", pa.float64(), "share of hand-marker positions not seen"),
        _column("residual_rms", pa.float64(), "rms distance of hand markers to the tracked hand", "m"),
        _column(
            "residual_rms_by_group",
            pa.map_(pa.string(), pa.float64()),
            "the same by marker group: forearm, hand, thumb ... little, object",
            "m",
        ),
        _column(
            "residual_rms_by_marker",
            pa.map_(pa.string(), pa.float64()),
            "the same by hand marker, behind its side if there are two hands",
            "m",
        ),
        _column(
            "motion_noise",
            pa.map_(pa.string(), pa.float64()),
            "scales of movement and marker noise that were estimated, behind the side if there are two hands",
            "m/s^1.5, rad/s^1.5, s, m",
        ),
        _column("n_grasps", pa.int32(), "number of grasps found"),
        _column("data_set", pa.string(), "data set it was imported from; null for own recordings"),
        _column("data_set_version", pa.string(), "version of that data set"),
        _column("original_id", pa.string(), "what the data set calls it"),
        _column("licence", pa.string(), "licence note of the data; null for own recordings"),
        _column(
            "glove_offset", pa.map_(pa.string(), pa.float64()), "constant offset of each glove sensor", "rad"
        ),
        _column(
            "glove_sd",
            pa.map_(pa.string(), pa.float64()),
            "standard deviation of each glove sensor about the hand",
            "rad",
        ),
        _column("context", TEXTS, "ingest_ids of the session, subject, hand and object rows it stands on"),
        _column(
            "table_rows", pa.map_(pa.string(), pa.int32()), "number of rows it has in other tables, by table"
        ),
        _column(
            "table_hashes",
            pa.map_(pa.string(), pa.string()),
            "hash of its rows in this table, less what the store adds, and in the others, by table",
        ),
        _INGEST_ID,
    ]
)

MARKERS: Final = pa.schema(
    [
        _TRIAL,
        _column("frame", pa.int32(), "frame of the trial, from 0", nullable=False),
        _column("time", pa.float64(), "time of the frame", "s"),
        _column("labels", TEXTS, "labels of the markers, in the order of positions"),
        _column("positions", MATRIX32, "as recorded, lab frame; null where not seen (n, 3)", "m"),
        _INGEST_ID,
    ]
)

FRAMES: Final = pa.schema(
    [
        _TRIAL,
        _SIDE,
        _column("frame", pa.int32(), "frame of the trial, from 0", nullable=False),
        _column("time", pa.float64(), "time of the frame", "s"),
        _column(
            "q",
            VECTOR,
            "configuration of the hand (30): position, quaternion w x y z, 23 angles",
            "m, 1, rad",
        ),
        _column("q_sd", VECTOR32, "standard deviation of each degree of freedom (29)", "m, rad"),
        _column("sites", MATRIX, "centres of the 20 spheres in the lab frame (20, 3)", "m"),
        _column(
            "sites_sd",
            VECTOR32,
            "standard deviation of each site in space, root of the trace of its covariance (20)",
            "m",
        ),
        _column("object_position", VECTOR, "origin of the object frame in the lab frame (3)", "m"),
        _column("object_quaternion", VECTOR, "world_from_object rotation, w x y z (4)"),
        _column(
            "object_residual", pa.float32(), "rms distance of object markers to their fitted places", "m"
        ),
        _column(
            "object_fitness",
            pa.float32(),
            "share of a live cloud's points near the object that lie on it; null where markers told the pose",
        ),
        _column(
            "gap",
            VECTOR,
            "signed distance of each site's part of the hand's surface to the object's mesh, or to its "
            "cloud where there is no mesh (20)",
            "m",
        ),
        _column(
            "touching",
            pa.list_(pa.bool_()),
            "whether each site touches, with hysteresis; null where that is unknown (20)",
        ),
        _column("residual", pa.float32(), "rms distance of the seen hand markers to the hand", "m"),
        _column("n_markers", pa.int16(), "hand markers used in this frame"),
        _column(
            "flags",
            TEXTS,
            "what is special: not_tracked, no_markers, at_limit, filled:<digit> (no marker of it used); "
            "markers left out: rejected:, jumping:, frozen: or drifting:<marker>; "
            "swapped:<marker>+<marker>, put right",
        ),
        _INGEST_ID,
    ]
)

GRASPS: Final = pa.schema(
    [
        _SESSION,
        _TRIAL,
        _GRASP,
        _SIDE,
        _column("subject", pa.string(), "name of the subject in its session"),
        _OBJECT,
        _column("task", pa.string(), "task that the manifest gives"),
        _column("repetition", pa.int32(), "repetition that the manifest gives"),
        _column(
            "snapshot_kind",
            pa.string(),
            "lift_onset, steadiest where there is no lift, or static where there is one instant alone",
        ),
        _column("snapshot_frame", pa.int32(), "frame of the snapshot"),
        _column("snapshot_time", pa.float64(), "time of the snapshot", "s"),
        _column("onset_time", pa.float64(), "first contact of this hold", "s"),
        _column("lift_time", pa.float64(), "onset of lift; null where the object is not lifted", "s"),
        _column("release_time", pa.float64(), "last contact; null where the trial ends first", "s"),
        _column("digits", TEXTS, "digits in contact at the snapshot, thumb first"),
        _column("contact_sites", TEXTS, "sites in contact at the snapshot"),
        _column("n_contacts", pa.int16(), "number of sites in contact"),
        _column("contact_threshold", pa.float64(), "h of equation 3", "m"),
        _column("q", VECTOR, "configuration of the hand at the snapshot (30)", "m, 1, rad"),
        _column("sites_object", MATRIX, "centres of the 20 spheres in the object frame (20, 3)", "m"),
        _column("object_from_hand", MATRIX, "pose of the hand segment in the object frame (4, 4)"),
        _column("gap", VECTOR, "signed distance of each site's part of the hand to the object (20)", "m"),
        _column("grip_aperture", pa.float64(), "distance of thumb tip to index tip", "m"),
        _column("hull_volume", pa.float64(), "volume of the hand enclosing space", "m3"),
        _column("box_volume", pa.float64(), "volume of the least bounding box of the same spheres", "m3"),
        _column("ellipsoid_volume", pa.float64(), "volume of their least ellipsoid", "m3"),
        _column("sphere_volume", pa.float64(), "volume of their least sphere", "m3"),
        _column("feature_points", pa.int32(), "number of object points in the enclosing space"),
        _column("feature_area", pa.float64(), "surface area of the graspable feature", "m2"),
        _column(
            "quality",
            pa.map_(pa.string(), pa.float64()),
            "grasp quality indices: epsilon, wrench_volume, isotropy, least_singular_value",
        ),
        _column("opposition", pa.string(), "pad, palm or side opposition; null where nothing opposes"),
        _column(
            "virtual_fingers",
            pa.list_(TEXTS),
            "thumb or palm; the digits that oppose it; those that touch and only help (3 lists)",
        ),
        _column(
            "opposition_shares",
            pa.map_(pa.string(), pa.float64()),
            "share of the fingers' opposition that is pad, palm and side opposition",
        ),
        _column("grasp_type", pa.string(), "type of the GRASP taxonomy; null where no type is likely"),
        _column(
            "grasp_type_confidence", pa.float64(), "share of the evidence that this type has, 0.5 or more"
        ),
        _column(
            "object_volume_in_hull",
            pa.float64(),
            "volume of the object in the enclosing space; null where its mesh is not closed",
            "m3",
        ),
        _column(
            "object_area_in_hull",
            pa.float64(),
            "area of the object's mesh in the enclosing space, exactly; null where it is not closed",
            "m2",
        ),
        _column("force_closure", pa.bool_(), "whether the contacts resist every force and torque"),
        _INGEST_ID,
    ]
)

CONTACTS: Final = pa.schema(
    [
        _GRASP,
        _TRIAL,
        _column("site", pa.string(), "site whose part of the hand's surface touches", nullable=False),
        _column("digit", pa.string(), "digit of that site"),
        _column("point", pa.int32(), "index of the point of the object's cloud nearest to the contact point"),
        _column("position", VECTOR, "contact point on the mesh, or of a bare cloud, object frame (3)", "m"),
        _column("normal", VECTOR, "outward surface normal there, object frame (3)"),
        _column("gap", pa.float64(), "signed distance of the site's part of the hand to the object", "m"),
        _column("segment", pa.string(), "segment of the hand that touches"),
        _column("pad", pa.string(), "side of it that touches: palmar, dorsal, radial, ulnar or tip"),
        _INGEST_ID,
    ]
)

FEATURES: Final = pa.schema(
    [
        _GRASP,
        _TRIAL,
        _SESSION,
        _OBJECT,
        _column("points", INDICES, "indices of the object's points in the enclosing space"),
        _column("hull_vertices", MATRIX, "vertices of the enclosing space, object frame (n, 3)", "m"),
        _column("hull_faces", pa.list_(INDICES), "its triangles, outward, as vertex indices (m, 3)"),
        _column("centroid", VECTOR, "area-weighted centre of the feature, object frame (3)", "m"),
        _column("extents", VECTOR, "size along the feature's principal axes, largest first (3)", "m"),
        _column("area", pa.float64(), "surface area of the feature", "m2"),
        _column(
            "descriptor",
            VECTOR32,
            "mean Fourier features of the points' FPFH (128), then root shares of point pairs (300)",
        ),
        _column("descriptor_kind", pa.string(), "what decides it; only those of one kind compare"),
        _column("patches", INDICES, "connected piece of each of the points, from 0, the largest"),
        _column("patch_areas", VECTOR, "area of each connected piece, largest first", "m2"),
        _column("curvature_class", pa.string(), "handle, edge, flat or rounded; null for an empty feature"),
        _column(
            "curvature_shares",
            pa.map_(pa.string(), pa.float64()),
            "share of the area bent like a bar, sharply, hardly: bar, sharp, flat",
        ),
        _column("hand_side", pa.string(), "side of the hand that most of the area faces"),
        _column(
            "hand_sides",
            pa.map_(pa.string(), pa.float64()),
            "share of the area that faces each side: palmar, dorsal, radial, ulnar, distal, proximal",
        ),
        _INGEST_ID,
    ]
)

CONTACT_EVENTS: Final = pa.schema(
    [
        _TRIAL,
        _SIDE,
        _column("grasp", pa.string(), "grasp during which the site touches; null outside of one"),
        _column("site", pa.string(), "site whose part of the hand's surface touches", nullable=False),
        _column("digit", pa.string(), "digit of that site"),
        _column("rank", pa.int16(), "place among the grasp's onsets, 1 for the first; null if not known"),
        _column("onset_time", pa.float64(), "begin of contact; null where it was not seen", "s"),
        _column("release_time", pa.float64(), "end of contact; null where it was not seen", "s"),
        _column("first_time", pa.float64(), "first frame in which it touches", "s"),
        _column("last_time", pa.float64(), "last frame in which it touches", "s"),
        _column("before", pa.string(), "what was before: free, unknown, or trial where the trial begins"),
        _column("after", pa.string(), "what came after: free, unknown, or trial where the trial ends"),
        _column("least_gap", pa.float64(), "least gap of the site during the contact", "m"),
        _INGEST_ID,
    ]
)

CONTACT_MAPS: Final = pa.schema(
    [
        _GRASP,
        _TRIAL,
        _SESSION,
        _OBJECT,
        _column("surface", pa.string(), "surface of the hand: spheres, capsules or skin"),
        _column("points", INDICES, "indices of the object's points near the hand's surface"),
        _column("gaps", VECTOR32, "signed distance of each to the hand's surface at the snapshot", "m"),
        _column("facing", VECTOR32, "cosine between its outward normal and the direction to the hand's bone"),
        _INGEST_ID,
    ]
)

REFERENCE_CONTACTS: Final = pa.schema(
    [
        _TRIAL,
        _column("time", pa.float64(), "time on the recording's clock", "s"),
        _column("digit", pa.string(), "digit that pressed", nullable=False),
        _column("position", VECTOR, "measured centre of pressure, object frame (3)", "m"),
        _INGEST_ID,
    ]
)

MEASURED_MAPS: Final = pa.schema(
    [
        _TRIAL,
        _SESSION,
        _OBJECT,
        _column("frame", pa.int32(), "frame of the trial that it belongs to; null where it is the trial's"),
        _column("kind", pa.string(), "how contact was found: thermal, annotated", nullable=False),
        _column("points", INDICES, "indices of the object's points with any contact"),
        _column("contact", VECTOR32, "contact at each of them, above 0, at most 1"),
        _INGEST_ID,
    ]
)

TABLES: Final[dict[str, pa.Schema]] = {
    "sessions": SESSIONS,
    "subjects": SUBJECTS,
    "objects": OBJECTS,
    "hands": HANDS,
    "object_points": OBJECT_POINTS,
    "trials": TRIALS,
    "markers": MARKERS,
    "frames": FRAMES,
    "grasps": GRASPS,
    "contacts": CONTACTS,
    "features": FEATURES,
    "contact_events": CONTACT_EVENTS,
    "contact_maps": CONTACT_MAPS,
    "reference_contacts": REFERENCE_CONTACTS,
    "measured_maps": MEASURED_MAPS,
}
"""Every table by name."""

SESSION_TABLES: Final = ("sessions", "subjects", "hands", "objects", "object_points")
"""Tables whose rows several trials share; a trial names the rows it stands on in its `context`."""

TRIAL_TABLES: Final = (
    "markers",
    "frames",
    "grasps",
    "contacts",
    "features",
    "contact_events",
    "contact_maps",
    "reference_contacts",
    "measured_maps",
)
"""Tables whose rows belong to one trial and carry its ingest_id."""

STORE_COLUMNS: Final = ("ingest_id", "context", "table_rows", "table_hashes")
"""Columns that the store fills in; whoever makes rows leaves them out."""

ROW_KEYS: Final[dict[str, tuple[str, ...]]] = {
    "object_points": ("point",),
    "markers": ("frame",),
    "frames": ("side", "frame"),
    "grasps": ("grasp",),
    "contacts": ("grasp", "site"),
    "features": ("grasp",),
    "contact_events": ("side", "site", "first_time"),
    "contact_maps": ("grasp", "surface"),
    "reference_contacts": ("time", "digit"),
    "measured_maps": ("kind", "frame"),
}
"""Columns that order a table's rows of one trial or one object, so that they compare in any order."""

TABLE_DOCS: Final[dict[str, str]] = {
    "sessions": "one row a session",
    "subjects": "one row a subject of a session",
    "objects": "one row an object of a session",
    "hands": "one row a subject and side: the calibrated hand model",
    "object_points": "one row a point of an object's cloud",
    "trials": "one row a trial, rejected ones included; writing it commits the trial",
    "markers": "one row a frame: marker positions as recorded",
    "frames": "one row a frame and side: tracked hand, object pose, gaps",
    "grasps": "one row a grasp: one hold of one object by one hand",
    "contacts": "one row a touching site of a grasp",
    "features": "one row a grasp: enclosing space and graspable feature",
    "contact_events": "one row a contact of one site, from onset to release",
    "contact_maps": "one row a grasp: the object's points near the hand, and how near",
    "reference_contacts": "one row a measured centre of pressure of a digit",
    "measured_maps": "one row a map of contact that was measured, or annotated, on the object's surface",
}
"""What one row of each table stands for."""


def unit_of(field: pa.Field) -> str:
    """Return the unit of a column, empty where it has none."""
    return str((field.metadata or {}).get(b"unit", b""), "utf-8")


def doc_of(field: pa.Field) -> str:
    """Return the line of documentation of a column."""
    return str((field.metadata or {}).get(b"doc", b""), "utf-8")
