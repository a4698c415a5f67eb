"""``trc``, ``c3d`` and ``mot``: trials for motion-capture software and OpenSim."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from graspdb.export.c3d import write_c3d
from graspdb.export.items import Episode, Floats
from graspdb.export.names import path_of, with_ending
from graspdb.export.opensim import (
    free_body_columns,
    free_body_coordinates,
    hand_columns,
    hand_coordinates,
    write_mot,
    write_trc,
)
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format
from graspdb.export.trial_points import trial_events, trial_points

_PART: Final = 16
"""Hands of trials that are in memory together."""

NO_RATE: Final = "hands without a frame rate (static grasps)"
NO_ANGLES: Final = "hands without joint angles"
NO_HAND: Final = "frames without joint angles"

_POINTS: Final = (
    Feature("<marker>", "{kind}", "(T, 3)", "mm", "a recorded marker, under its own label"),
    Feature("site_<side>_<site>", "{kind}", "(T, 3)", "mm", "virtual marker at the centre of a sphere (20)"),
    Feature("object_origin", "{kind}", "(T, 3)", "mm", "virtual marker at the origin of the object frame"),
    Feature("object_x, object_y, object_z", "{kind}", "(T, 3)", "mm", "100 mm from it along each axis"),
)


class _PointsWriter(Writer[Episode]):
    """One file a hand and trial, of points in the lab frame; missing ones are marked as the format does."""

    kind = "text"

    def write(self, part: Part[Episode]) -> Written:
        """Write the hands of a part; without a rate there is no motion to write."""
        episodes = list(part.items)
        moving = [episode for episode in episodes if np.isfinite(episode.rate) and episode.n_frames]
        if moving:
            self.write_moving(part.split, moving)
        frames = sum(episode.n_frames for episode in moving)
        return Written(
            part.split,
            {"episodes": len(moving), "frames": frames},
            {NO_RATE: len(episodes) - len(moving)} if len(moving) < len(episodes) else {},
        )

    def write_moving(self, split: str, episodes: Sequence[Episode]) -> None:
        """Write one file for each."""
        raise NotImplementedError

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return [Feature(f.name, self.kind, f.shape, f.unit, f.doc) for f in _POINTS]


@export_format(Format("trc", "TRC for OpenSim: markers and virtual markers", items="episodes", part=_PART))
class TrcWriter(_PointsWriter):
    """Blank cells where a point is missing."""

    def write_moving(self, split: str, episodes: Sequence[Episode]) -> None:
        """Write one file for each."""
        for episode, points in zip(episodes, trial_points(self.database, episodes), strict=True):
            path = with_ending(path_of(self.folder, split, episode.key), ".trc")
            write_trc(path, points.labels, points.positions, episode.time, episode.rate)


@export_format(Format("c3d", "C3D: markers, virtual markers and events", items="episodes", part=_PART))
class C3dWriter(_PointsWriter):
    """A residual of -1 where a point is missing; events say when contact, lift and release are."""

    kind = "float32"

    def write_moving(self, split: str, episodes: Sequence[Episode]) -> None:
        """Write one file for each."""
        points = trial_points(self.database, episodes)
        events = trial_events(self.database, episodes)
        for episode, shown, happens in zip(episodes, points, events, strict=True):
            path = with_ending(path_of(self.folder, split, episode.key), ".c3d")
            write_c3d(
                path,
                shown.labels,
                shown.descriptions,
                shown.positions,
                episode.time,
                episode.rate,
                happens,
            )


@export_format(Format("mot", "MOT for OpenSim: coordinates of hand and object", items="episodes", part=_PART))
class MotWriter(Writer[Episode]):
    """One file for the hand, one for the object; OpenSim reads no gaps, so frames with one are left out."""

    def write(self, part: Part[Episode]) -> Written:
        """Write the hands of a part, and the objects they hold."""
        counts = {"episodes": 0, "frames": 0}
        left_out = {NO_ANGLES: 0, NO_HAND: 0}
        for episode in part.items:
            angles = episode.q.shape[1] > 0 and np.isfinite(episode.q).all(axis=1)
            if not np.any(angles):
                left_out[NO_ANGLES] += 1
                continue
            stem = path_of(self.folder, part.split, episode.key)
            columns = hand_columns(episode.q.shape[1] - 7, "")
            name = f"{episode.key} hand"
            counts["episodes"] += 1
            counts["frames"] += self._write(
                with_ending(stem, "_hand.mot"), name, columns, hand_coordinates(episode.q), episode.time
            )
            left_out[NO_HAND] += int(np.sum(~np.asarray(angles)))
            self._write(
                with_ending(stem, "_object.mot"),
                f"{episode.key} object",
                free_body_columns("object"),
                free_body_coordinates(episode.object_position, episode.object_quaternion),
                episode.time,
            )
        return Written(part.split, counts, {reason: n for reason, n in left_out.items() if n})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return (
            Feature("*_hand.mot: forearm_rx, _ry, _rz", "text", "(T, 3)", "rad",
                    "forearm: rotations about its own x, then y, then z"),
            Feature("*_hand.mot: forearm_tx, _ty, _tz", "text", "(T, 3)", "m", "forearm: position, lab"),
            Feature("*_hand.mot: <joint>", "text", "(T, 23)", "rad", "hinges; flexion, abduction above 0"),
            Feature("*_object.mot: object_rx ... object_tz", "text", "(T, 6)", "rad, m",
                    "object: the same six coordinates"),
        )  # fmt: skip

    def _write(self, path: Path, name: str, columns: Sequence[str], values: Floats, times: Floats) -> int:
        """Write the frames in which all coordinates are known, if any; return how many these are."""
        known = np.isfinite(values).all(axis=1) & np.isfinite(times)
        if known.any():
            write_mot(path, name, columns, values[known], times[known])
        return int(known.sum())
