"""Small sessions made by hand: few rows, every table, values that can be told apart."""

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.vocabulary import SITES

N_FRAMES = 4
N_POINTS = 5


def rows(name: str, *dicts: Mapping[str, Any]) -> pa.Table:
    """Return rows of a table; columns that are left out are null."""
    schema = rows_schema(name)
    whole = [{column: row.get(column) for column in schema.names} for row in dicts]
    return pa.Table.from_pylist(whole, schema)


def session_tables(
    session: str = "s",
    subjects: Sequence[str] = ("anna", "ben"),
    objects: Sequence[str] = ("mug",),
    size: float = 1.0,
) -> TrialTables:
    """Return the rows of a session; `size` scales the objects' points."""
    return TrialTables(
        {
            "sessions": rows("sessions", {"session": session, "up": [0, 0, 1], "manifest": "{}"}),
            "subjects": rows(
                "subjects",
                *(
                    {
                        "session": session,
                        "subject": subject,
                        "hand": "right",
                        "hand_length": 0.19,
                        "joint_thickness": [("index_pip", 0.0175)],
                    }
                    for subject in subjects
                ),
            ),
            "hands": rows(
                "hands",
                *(
                    {"session": session, "subject": subject, "side": "right", "radii": [0.01] * 20}
                    for subject in subjects
                ),
            ),
            "objects": rows(
                "objects",
                *(
                    {"session": session, "object": name, "n_points": N_POINTS, "mesh_sha256": f"{name}{size}"}
                    for name in objects
                ),
            ),
            "object_points": rows(
                "object_points",
                *(
                    {
                        "session": session,
                        "object": name,
                        "point": point,
                        "position": [size * point, 0.0, 0.0],
                        "normal": [0.0, 0.0, 1.0],
                        "area": 4e-6,
                        "fpfh": [float(point)] * 33,
                    }
                    for name in objects
                    for point in range(N_POINTS)
                ),
            ),
        }
    )


def trial_tables(
    number: int = 0,
    session: str = "s",
    subject: str = "anna",
    object_: str | None = "mug",
    input_key: str | None = None,
    sites: Sequence[str] = ("thumb_tip", "index_tip", "index_pip"),
    **trial: Any,
) -> TrialTables:
    """Return the rows of one trial with one grasp, in which `sites` touch."""
    key = f"{session}/{subject}_{object_}_{number}"
    grasp = f"{key}/right/0"
    common = {"session": session, "trial": key, "subject": subject, "object": object_, "task": "lift"}
    described = {
        **common,
        "repetition": number,
        "rate": 100.0,
        "n_frames": N_FRAMES,
        "duration": 0.03,
        "source_file": f"trials/{number}.c3d",
        "input_key": input_key or f"key {key}",
        "status": "ok",
        "missing_fraction": 0.125,
        "residual_rms": 0.002,
        "residual_rms_by_group": [("hand", 0.001), ("thumb", 0.003)],
        "n_grasps": 1,
        **trial,
    }
    frames = [
        {"trial": key, "side": "right", "frame": i, "time": i / 100, "q": [float(number + i)] * 30}
        for i in range(N_FRAMES)
    ]
    markers = [
        {"trial": key, "frame": i, "time": i / 100, "labels": ["a", "b"], "positions": [[i, 0, 0], None]}
        for i in range(N_FRAMES)
    ]
    tables = {
        "trials": rows("trials", described),
        "markers": rows("markers", *markers),
        "frames": rows("frames", *frames),
    }
    if object_ is not None:
        tables |= _grasp_tables(common, grasp, sites)
    return TrialTables(tables)


def _grasp_tables(common: Mapping[str, Any], grasp: str, sites: Sequence[str]) -> dict[str, pa.Table]:
    digits = list(dict.fromkeys(site.partition("_")[0] for site in sites))
    described = {
        **common,
        "grasp": grasp,
        "side": "right",
        "snapshot_kind": "lift_onset",
        "snapshot_time": 0.02,
        "digits": digits,
        "contact_sites": list(sites),
        "n_contacts": len(sites),
        "q": [0.0] * 30,
        "sites_object": [[0.01 * i, 0.0, 0.0] for i in range(len(SITES))],
        "object_from_hand": [[float(i == j) for j in range(4)] for i in range(4)],
        "gap": [0.001 * i for i in range(len(SITES))],
        "hull_volume": 1e-5,
        "quality": [("epsilon", 0.1)],
    }
    contacts = [
        {
            "grasp": grasp,
            "trial": common["trial"],
            "site": site,
            "digit": site.partition("_")[0],
            "point": i % N_POINTS,
            "position": [float(i), 0.0, 0.0],
            "normal": [0.0, 0.0, 1.0],
            "gap": 0.001,
        }
        for i, site in enumerate(sites)
    ]
    feature = {
        **{column: common[column] for column in ("trial", "session", "object")},
        "grasp": grasp,
        "points": [1, 3],
        "hull_vertices": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "hull_faces": [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        "centroid": [0.25, 0.25, 0.25],
        "descriptor": [0.5] * 428,
        "descriptor_kind": "1",
    }
    return {
        "grasps": rows("grasps", described),
        "contacts": rows("contacts", *contacts),
        "features": rows("features", feature),
        "reference_contacts": rows("reference_contacts", *_pressed(common["trial"], digits)),
    }


def _pressed(trial: str, digits: Sequence[str]) -> list[dict[str, Any]]:
    return [{"trial": trial, "time": 0.02, "digit": digit, "position": [0.0, 0.3, 0.4]} for digit in digits]
