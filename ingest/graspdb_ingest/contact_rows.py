"""Rows of contact over time and over the object: contact_events and contact_maps."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from graspdb_ingest.contact_events import ContactEvent, ranks
from graspdb_ingest.contact_map import contact_map
from graspdb_ingest.grasp_rows import Grasp
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import ContactParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.surface.touch import PosedHand
from graspdb_ingest.trial import TrackedTrial
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, SITES


def contact_rows(
    session: Session,
    trial: SessionTrial,
    tracked: TrackedTrial,
    grasps: Sequence[Grasp],
    parameters: ContactParameters,
) -> dict[str, pa.Table]:
    """Return the rows of `contact_events` and `contact_maps`."""
    key = f"{session.id}/{trial.name}"
    events = [
        {"trial": key, "side": str(side)} | row
        for side, hand in tracked.hands.items()
        for row in event_rows(
            hand.events, hand.posed, [g for g in grasps if g.side is side], tracked.markers.times
        )
    ]
    maps = [
        map_row(session.id, key, grasp.prepared, _at_snapshot(tracked, grasp), grasp.key, parameters)
        for grasp in grasps
    ]
    return {
        "contact_events": pa.Table.from_pylist(events, schema=rows_schema("contact_events")),
        "contact_maps": pa.Table.from_pylist(maps, schema=rows_schema("contact_maps")),
    }


def event_rows(
    events: Sequence[ContactEvent], posed: PosedHand, grasps: Sequence[Grasp], times: Floats
) -> list[dict[str, object]]:
    """Return the contacts of a hand in order of time, each with its place among those of its grasp.

    Parameters
    ----------
    events : sequence of ContactEvent
        The contacts.
    posed : PosedHand
        The hand in all frames.
    grasps : sequence of Grasp
        The grasps of that hand.
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    """
    owners = [_owner(event, grasps) for event in events]
    places: dict[ContactEvent, int | None] = {}
    for key in {owner for owner in owners if owner is not None}:
        own = tuple(event for event, owner in zip(events, owners, strict=True) if owner == key)
        places |= dict(zip(own, ranks(own), strict=True))
    return [
        _event_row(posed, event, times) | {"grasp": owner, "rank": places.get(event)}
        for event, owner in zip(events, owners, strict=True)
    ]


def _owner(event: ContactEvent, grasps: Sequence[Grasp]) -> str | None:
    """Return the key of the first grasp that a contact is part of."""
    return next((g.key for g in grasps if event.first <= g.hold.last and event.last >= g.hold.first), None)


def _event_row(posed: PosedHand, event: ContactEvent, times: Floats) -> dict[str, object]:
    first, last = float(times[event.first]), float(times[event.last])
    return {
        "site": SITES[event.site],
        "digit": DIGIT_OF_SITE[event.site],
        "onset_time": first if event.before == "free" else None,
        "release_time": last if event.after == "free" else None,
        "first_time": first,
        "last_time": last,
        "before": event.before,
        "after": event.after,
        "least_gap": float(np.nanmin(posed.gaps.gap[event.first : event.last + 1, event.site])),
    }


def map_row(
    session: str,
    trial: str,
    prepared: PreparedObject,
    posed: PosedHand,
    grasp: str,
    parameters: ContactParameters,
) -> dict[str, object]:
    """Return the row of `contact_maps` of a grasp, from the hand at its snapshot."""
    cloud = prepared.cloud
    found = contact_map(cloud.points, cloud.normals, posed.surface, parameters.map_reach)
    return {
        "grasp": grasp,
        "trial": trial,
        "session": session,
        "object": prepared.name,
        "surface": parameters.surface,
        "points": (found.points + prepared.first_point).tolist(),
        "gaps": found.gaps.tolist(),
        "facing": found.facing.tolist(),
    }


def _at_snapshot(tracked: TrackedTrial, grasp: Grasp) -> PosedHand:
    return tracked.hands[grasp.side].posed.frame(grasp.hold.snapshot)
