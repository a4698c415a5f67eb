"""Retarget a database's hands to the Allegro hand with dex-retargeting, and see where its fingertips come.

Usage: python check_retarget.py DB SCRATCH; needs graspdb[retarget] and example-robot-data (the hand).
Prints joints, frames a second, and distances of the robot's fingertips to the person's.
"""

import importlib.metadata
import shutil
import sys
import time
from pathlib import Path

import numpy as np

import graspdb
from graspdb.export.retarget import RobotHand

HERE = Path(__file__).parent
TIPS = {"link_15.0_tip": 4, "link_3.0_tip": 8, "link_7.0_tip": 12, "link_11.0_tip": 16}
"""Fingertips of the robot, and the key points that they follow."""


def robot_folder() -> Path:
    """Return the folder of the hand's URDF in the package that has it."""
    files = importlib.metadata.files("example-robot-data") or []
    return next(Path(str(file.locate())).parent for file in files if file.name == "allegro_right_hand.urdf")


def distances(robot: RobotHand, file: np.lib.npyio.NpzFile) -> np.ndarray:
    """Return how far each fingertip is from the person's, shape (n, 4) [m]."""
    model = robot._retargeting(str(file["side"])).optimizer.robot
    found = []
    for joints, points in zip(file["action"], file["key_points"], strict=True):
        model.compute_forward_kinematics(joints)
        tips = np.array([model.get_link_pose(model.get_link_index(name))[:3, 3] for name in TIPS])
        found.append(np.linalg.norm(tips - points[list(TIPS.values())], axis=1))
    return np.array(found)


def main() -> None:
    """Export, and look at every file."""
    database, scratch = sys.argv[1], Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    for file in [*robot_folder().glob("allegro_*_hand.urdf"), *HERE.glob("allegro_*.yml")]:
        shutil.copy(file, scratch)
    config = str(scratch / "allegro_{side}.yml")
    began = time.perf_counter()
    with graspdb.open(database) as db:
        grasps = db.sql("SELECT grasp FROM grasps ORDER BY hash(grasp) LIMIT 6").table["grasp"].to_pylist()
        where = "grasp IN (" + ", ".join(f"'{grasp}'" for grasp in grasps) + ")"
        report = db.export("keypoints", scratch / "out", where=where, retarget=config)
    seconds, robot = time.perf_counter() - began, RobotHand(config)
    apart = np.concatenate(
        [distances(robot, np.load(path)) for path in sorted((scratch / "out").rglob("*.npz"))]
    )
    assert np.isfinite(apart).all()
    assert np.median(apart) < 0.02, np.median(apart)
    version = importlib.metadata.version("dex-retargeting")
    median, most = 1000 * np.median(apart), 1000 * np.percentile(apart, 95)
    print(
        f"dex-retargeting {version}: {report.counts['frames']:,} frames at {len(apart) / seconds:.0f}/s, "
        f"fingertips {median:.1f} mm off (median), {most:.1f} mm (95th percentile)"
    )


if __name__ == "__main__":
    main()
