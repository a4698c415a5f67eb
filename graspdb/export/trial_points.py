"""The points of a trial that motion-capture software shows: recorded markers, and virtual ones."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pyarrow as pa

from graspdb.export.c3d import Event
from graspdb.export.items import Episode, Floats
from graspdb.export.reading import vectors
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.vocabulary import SITES

if TYPE_CHECKING:
    from graspdb.database import Database

_MARKERS: Final = """
    SELECT f.trial, f.side, m.labels, m.positions
    FROM frames f LEFT JOIN markers m ON m.trial = f.trial AND m.frame = f.frame
    WHERE f.trial IN (SELECT unnest($trials))
    ORDER BY f.trial, f.side, f.frame
"""

_EVENTS: Final = """
    SELECT grasp, onset_time, lift_time, release_time FROM grasps WHERE grasp IN (SELECT unnest($grasps))
"""

AXIS: Final = 0.1
"""Distance from the object's origin of the points that show its axes [m]."""

OBJECT_POINTS: Final = ("object_origin", "object_x", "object_y", "object_z")


@dataclass(frozen=True, eq=False)
class TrialPoints:
    """Trajectories with names.

    Attributes
    ----------
    labels, descriptions : tuple of str
        Name of each point, and what it is.
    positions : ndarray, shape (n_frames, n_points, 3)
        Where they are in the lab frame [m]; NaN where that is not known.
    """

    labels: tuple[str, ...]
    descriptions: tuple[str, ...]
    positions: Floats


def trial_points(database: "Database", episodes: Sequence[Episode]) -> Iterator[TrialPoints]:
    """Yield the points of each episode: recorded markers, the 20 sites, and the object's frame.

    Parameters
    ----------
    database : Database
        The database, for the markers.
    episodes : sequence of Episode
        Hands of trials.
    """
    trials = [episode.trial for episode in episodes]
    rows = database.sql(_MARKERS, trials=trials).table.combine_chunks()
    keys = list(zip(rows["trial"].to_pylist(), rows["side"].to_pylist(), strict=True))
    for episode in episodes:
        first = keys.index((episode.trial, episode.side)) if episode.n_frames else 0
        labels, markers = _markers(rows.slice(first, episode.n_frames))
        sites = tuple(f"site_{episode.side}_{site}" for site in SITES)
        descriptions = (
            *("recorded marker" for _ in labels),
            *(f"centre of the sphere {site} of the tracked {episode.side} hand" for site in SITES),
            "origin of the object frame",
            *(f"point {AXIS} m along its {axis} axis" for axis in "xyz"),
        )
        positions = np.concatenate([markers, episode.sites, _object_points(episode)], axis=1)
        yield TrialPoints((*labels, *sites, *OBJECT_POINTS), descriptions, positions)


def trial_events(database: "Database", episodes: Sequence[Episode]) -> Iterator[tuple[Event, ...]]:
    """Yield what happens in each episode, in order of time: contact, lift and release of its grasps."""
    wanted = [grasp for episode in episodes for grasp in episode.grasps]
    rows = {row["grasp"]: row for row in database.sql(_EVENTS, grasps=wanted).table.to_pylist()}
    for episode in episodes:
        found = [
            Event(label, episode.side.capitalize(), rows[grasp][column])
            for grasp in episode.grasps
            for label, column in (
                ("contact", "onset_time"),
                ("lift", "lift_time"),
                ("release", "release_time"),
            )
            if rows[grasp][column] is not None
        ]
        yield tuple(sorted(found, key=lambda event: event.time))


def _markers(rows: pa.Table) -> tuple[tuple[str, ...], Floats]:
    """Return the labels and positions of recorded markers, of which imported trials have none."""
    labels: list[str] = next((names for names in rows["labels"].to_pylist() if names), [])
    if not labels:
        return (), np.empty((rows.num_rows, 0, 3))
    return tuple(labels), vectors(rows["positions"], len(labels), 3)


def _object_points(episode: Episode) -> Floats:
    """Return the origin of the object frame, and a point on each of its axes, shape (n_frames, 4, 3)."""
    origin = episode.object_position[:, None]
    rotations = rotations_from_quaternions(episode.object_quaternion)
    return np.concatenate([origin, origin + AXIS * rotations.transpose(0, 2, 1)], axis=1)
