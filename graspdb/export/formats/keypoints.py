"""``keypoints``: 21 key points of the hand with the poses of wrist and object, and a robot's joints."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from graspdb.export.hand_poses import hand_poses
from graspdb.export.items import Episode, Floats
from graspdb.export.names import path_of, with_ending
from graspdb.export.options import ExportOptions
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.vocabulary import KEY_POINTS

if TYPE_CHECKING:
    from graspdb.database import Database
    from graspdb.export.retarget import RobotHand

NO_POSE: Final = "frames without hand or object"
NOTHING: Final = "hands that are known in no frame"

_FEATURES: Final = (
    Feature("key_points", "float32", "(T, 21, 3)", "m", "wrist, then the 20 sites, lab frame"),
    Feature("world_from_wrist", "float32", "(T, 4, 4)", "m", "pose of the hand segment"),
    Feature("world_from_object", "float32", "(T, 4, 4)", "m", "pose of the object"),
    Feature("time", "float64", "(T,)", "s", "time of each frame"),
    Feature("valid", "bool", "(T,)", "", "whether hand and object are known; else they are NaN"),
    Feature("rate", "float64", "()", "Hz", "frames per second as recorded; NaN for static grasps"),
    Feature("key_point_names", "string", "(21,)", "", "names of the key points"),
    Feature("trial, side, session, subject, object, task", "string", "()", "", "which hand, doing what"),
)
_ROBOT_FEATURES: Final = (
    Feature("action", "float32", "(T, n)", "rad, m", "joints of the robot hand; NaN where valid is false"),
    Feature("robot_joint_names", "string", "(n,)", "", "their names"),
)


@export_format(
    Format(
        "keypoints",
        "21 key points with wrist and object poses; --retarget adds a robot hand's joints",
        items="episodes",
        options=("missing", "retarget"),
        part=16,
    )
)
class KeyPointsWriter(Writer[Episode]):
    """One NPZ file a hand and trial."""

    def __init__(self, folder: Path, options: ExportOptions, database: "Database") -> None:
        super().__init__(folder, options, database)
        self._robot = None if options.retarget is None else _robot_hand(options.retarget)

    def write(self, part: Part[Episode]) -> Written:
        """Write the hands of a part."""
        counts, left_out = {"episodes": 0, "frames": 0}, {NO_POSE: 0, NOTHING: 0}
        episodes = list(part.items)
        for episode, hands in zip(episodes, hand_poses(self.database, episodes), strict=True):
            frames = _frames(episode, hands)
            valid = frames["valid"]
            if not valid.any():
                left_out[NOTHING] += 1
                continue
            if self.options.missing == "drop":
                frames = {name: values[valid] for name, values in frames.items()}
                left_out[NO_POSE] += int((~valid).sum())
            if self._robot is not None:
                frames["action"] = self._robot.follow(
                    frames["key_points"], frames["world_from_wrist"], episode.side
                )
            path = with_ending(path_of(self.folder, part.split, episode.key), ".npz")
            np.savez(path, allow_pickle=False, **frames, **self._words(episode))
            counts["episodes"] += 1
            counts["frames"] += len(frames["time"])
        return Written(part.split, counts, {reason: n for reason, n in left_out.items() if n})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return _FEATURES if self._robot is None else (*_FEATURES, *_ROBOT_FEATURES)

    def _words(self, episode: Episode) -> dict[str, np.ndarray]:
        """Return what is said once of an episode."""
        names = ("trial", "side", "session", "subject", "object", "task")
        words = {name: np.array(getattr(episode, name)) for name in names}
        words |= {"rate": np.array(episode.rate), "key_point_names": np.array(KEY_POINTS)}
        if self._robot is not None:
            words["robot_joint_names"] = np.array(self._robot.joint_names(episode.side))
        return words


def _robot_hand(config: str) -> "RobotHand":
    from graspdb.export.retarget import RobotHand

    return RobotHand(config)


def _frames(episode: Episode, hands: Floats) -> dict[str, np.ndarray]:
    """Return the arrays with a row a frame, NaN in all frames in which hand or object is not known."""
    objects = np.tile(np.eye(4), (episode.n_frames, 1, 1))
    objects[:, :3, :3] = rotations_from_quaternions(episode.object_quaternion)
    objects[:, :3, 3] = episode.object_position
    key_points = np.concatenate([hands[:, None, :3, 3], episode.sites], axis=1)
    known = [np.isfinite(values).all(axis=(1, 2)) for values in (hands, objects, key_points)]
    valid = np.logical_and.reduce(known)
    poses = {"key_points": key_points, "world_from_wrist": hands, "world_from_object": objects}
    masked = {name: np.where(valid[:, None, None], values, np.nan) for name, values in poses.items()}
    return {
        **{name: values.astype(np.float32) for name, values in masked.items()},
        "time": episode.time,
        "valid": valid,
    }
