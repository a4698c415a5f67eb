"""Hand and object at the instants of a grasp that are worth having as a posture: before, onset, hold."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspdb.export.held import pose_matrix
from graspdb.export.items import Grasp
from graspdb.export.mjcf import Keyframe

if TYPE_CHECKING:
    from graspdb.database import Database

REACH: Final = 0.3
"""How long before the first contact the hand is still open [s]."""

NAMES: Final = ("reach", "contact", "hold")

_INSTANTS: Final = """
    WITH held AS (
        SELECT grasp, trial, side, snapshot_time, onset_time,
               coalesce(release_time, (SELECT max(time) FROM frames f WHERE f.trial = g.trial)) AS until
        FROM grasps g
        WHERE grasp IN (SELECT unnest($grasps)) AND onset_time IS NOT NULL
    ), known AS (
        SELECT trial, side, time,
               {'q': q, 'position': object_position, 'quaternion': object_quaternion} AS posture
        FROM frames
        WHERE trial IN (SELECT trial FROM held) AND q IS NOT NULL AND object_position IS NOT NULL
    )
    SELECT held.grasp,
           arg_min(posture, abs(time - (onset_time - $reach))) AS reach,
           arg_min(posture, abs(time - onset_time)) AS contact,
           arg_min(posture, abs(time - (snapshot_time + until) / 2)) AS hold
    FROM held JOIN known USING (trial, side)
    GROUP BY held.grasp
"""


def other_keyframes(database: "Database", grasps: Sequence[Grasp]) -> Mapping[str, tuple[Keyframe, ...]]:
    """Return, by grasp, hand and object shortly before the first contact, at it, and in mid-hold.

    Grasps without frames with joint angles have none.
    """
    rows = database.sql(_INSTANTS, grasps=[grasp.id for grasp in grasps], reach=REACH).table.to_pylist()
    return {row["grasp"]: tuple(_keyframes(row)) for row in rows}


def _keyframes(row: Mapping[str, Any]) -> list[Keyframe]:
    found = []
    for name in NAMES:
        at = row[name]
        pose = None if at is None else pose_matrix(at["position"], at["quaternion"])
        if pose is not None:
            found.append(Keyframe(name, np.array(at["q"], dtype=float), pose))
    return found
