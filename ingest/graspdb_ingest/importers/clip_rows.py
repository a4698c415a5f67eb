"""Rows of an imported clip: the same tables, filled the same way, as for own recordings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyarrow as pa
from scipy.spatial import cKDTree

from graspdb_ingest.columns import list_column
from graspdb_ingest.contact_events import FREE, TOUCHES, UNKNOWN
from graspdb_ingest.contact_rows import event_rows, map_row
from graspdb_ingest.grasp_rows import Grasp, contact_rows, enclose, feature_row, held_columns
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.base import MeasuredContact
from graspdb_ingest.importers.followed import FollowedClip, FollowedHand
from graspdb_ingest.keypoints import object_from_hand
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_schemas.conform import rows_schema

_STATES: Final = {TOUCHES: True, FREE: False, UNKNOWN: None}


@dataclass(frozen=True)
class ClipKeys:
    """What the rows of a clip are called by.

    Attributes
    ----------
    session, trial, subject : str
        Keys; that of the trial has the session in front.
    task : str or None
        What was to be done.
    """

    session: str
    trial: str
    subject: str
    task: str | None

    def common(self, prepared: PreparedObject | None) -> dict[str, object]:
        """Return the columns that trials and grasps share."""
        return {
            "session": self.session,
            "trial": self.trial,
            "subject": self.subject,
            "object": None if prepared is None else prepared.name,
            "task": self.task,
            "repetition": None,
        }


def clip_rows(keys: ClipKeys, followed: FollowedClip, parameters: IngestParameters) -> dict[str, pa.Table]:
    """Return the rows of a clip in every table but `trials`."""
    rows = {"frames": pa.concat_tables([_frames(keys.trial, followed, hand) for hand in followed.hands])}
    prepared = followed.object
    if prepared is None:
        return rows
    lists: dict[str, list[dict[str, Any]]] = {}
    for hand in followed.hands:
        grasps = _grasps(keys.trial, hand, prepared, parameters)
        for grasp in grasps:
            for table, found in _grasp_rows(keys, followed, hand, grasp, parameters):
                lists.setdefault(table, []).extend(found)
        events = event_rows(hand.events, hand.posed, grasps, followed.times)
        mine = {"trial": keys.trial, "side": str(hand.side)}
        lists.setdefault("contact_events", []).extend(mine | event for event in events)
    if followed.clip.measured is not None:
        frames = sorted({hold.snapshot for hand in followed.hands for hold in hand.holds})
        lists["measured_maps"] = list(_measured_rows(keys, followed.clip.measured, frames, prepared))
    return rows | {name: pa.Table.from_pylist(found, rows_schema(name)) for name, found in lists.items()}


def _grasps(
    trial: str, hand: FollowedHand, prepared: PreparedObject, parameters: IngestParameters
) -> list[Grasp]:
    """Return the grasps of a hand: contacts, enclosing space and feature at each hold's snapshot."""
    return [
        enclose(
            f"{trial}/{hand.side}/{number}",
            hold,
            hand.posed.frame(hold.snapshot),
            _palm(hand, hold.snapshot)[:3, :3],
            prepared,
            parameters,
        )
        for number, hold in enumerate(hand.holds)
    ]


def _grasp_rows(
    keys: ClipKeys, followed: FollowedClip, hand: FollowedHand, grasp: Grasp, parameters: IngestParameters
) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    prepared, hold = followed.object, grasp.hold
    if prepared is None:
        return
    posed, times = hand.posed.frame(hold.snapshot), followed.times
    moving = followed.clip.rate is not None
    when = {
        "snapshot_time": float(times[hold.snapshot]),
        "onset_time": float(times[hold.first]) if moving else None,
        "lift_time": None if hold.lift_onset is None else float(times[hold.lift_onset]),
        "release_time": float(times[hold.last]) if hold.released else None,
        "q": None if hand.fit is None else hand.fit.q[hold.snapshot].tolist(),
        "object_from_hand": _palm(hand, hold.snapshot).tolist(),
    }
    yield "grasps", [keys.common(prepared) | held_columns(grasp, posed, parameters.contact) | when]
    yield "contacts", contact_rows(keys.trial, grasp)
    yield "features", [feature_row(keys.session, keys.trial, grasp)]
    yield (
        "contact_maps",
        [map_row(keys.session, keys.trial, prepared, posed, grasp.key, parameters.contact)],
    )


def _palm(hand: FollowedHand, frame: int) -> Floats:
    """Return the pose of the hand segment in the object frame, shape (4, 4)."""
    return object_from_hand(hand.posed.points.key_points[frame], hand.dimensions, hand.side)


def _frames(trial: str, followed: FollowedClip, hand: FollowedHand) -> pa.Table:
    n, pose = followed.clip.n_frames, followed.track
    columns: Mapping[str, Any] = {
        "trial": pa.repeat(trial, n),
        "side": pa.repeat(str(hand.side), n),
        "frame": np.arange(n),
        "time": followed.times,
        "sites": list_column(hand.key_points[:, 1:]),
        "gap": list_column(hand.posed.gaps.gap),
        "touching": [[_STATES[state] for state in frame] for frame in hand.states.tolist()],
        "flags": _flags(hand),
    }
    if followed.object is not None:
        columns = {
            **columns,
            "object_position": list_column(pose.positions),
            "object_quaternion": list_column(pose.quaternions),
        }
    if hand.fit is not None:
        columns = {**columns, **hand.fit.columns()}
    schema = rows_schema("frames")
    return pa.Table.from_pydict(
        {name: columns.get(name, pa.nulls(n, schema.field(name).type)) for name in schema.names}, schema
    )


def _flags(hand: FollowedHand) -> list[list[str]]:
    extrapolated = [f"extrapolated:{name}" for name in hand.extrapolated]
    known = np.asarray(np.isfinite(hand.key_points).all(axis=(1, 2)))
    seen = known if hand.fit is None else np.asarray(hand.fit.used.any(axis=1))
    flags = {(True, True): extrapolated, (True, False): ["no_markers"]}
    return [flags.get(frame, ["not_tracked"]) for frame in zip(known.tolist(), seen.tolist(), strict=True)]


def _measured_rows(
    keys: ClipKeys, measured: MeasuredContact, frames: Sequence[int], prepared: PreparedObject
) -> Iterator[dict[str, Any]]:
    """Yield measured contact on the object's cloud: that of the clip, or that of each snapshot's frame."""
    nearest = cKDTree(measured.positions).query(prepared.cloud.points)[1]
    whole = measured.contact.ndim == 1
    for frame in [None] if whole else frames:
        contact = (measured.contact if frame is None else measured.contact[frame])[nearest]
        touched = np.flatnonzero(contact > 0)
        yield {
            "trial": keys.trial,
            "session": keys.session,
            "object": prepared.name,
            "frame": frame,
            "kind": measured.kind,
            "points": touched.tolist(),
            "contact": contact[touched].astype(np.float64).tolist(),
        }
