"""Made-up trials in which hand and object move: what exports are made of, every value another."""

from pathlib import Path
from typing import Any

import numpy as np
from handmade import rows, session_tables

from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables

RATE = 100.0
N_FRAMES = 31
LOST = {"s/cal_jug_1": slice(10, 13), "s/eve_mug_2": slice(25, 31)}
"""Trial -> frames in which the object's pose is not known."""


def turning(n: int, rate: float, axis: int, speed: float) -> np.ndarray:
    """Return quaternions (w, x, y, z) of a turn about an axis at a constant speed [rad/s], shape (n, 4)."""
    half = speed * np.arange(n) / rate / 2
    quaternions = np.zeros((n, 4))
    quaternions[:, 0] = np.cos(half)
    quaternions[:, 1 + axis] = np.sin(half)
    return quaternions


def frame_rows(
    trial: str, seed: int, side: str = "right", n: int = N_FRAMES, n_q: int = 30
) -> list[dict[str, Any]]:
    """Return the frames of one hand: all numbers swing, hand and object turn evenly."""
    rng = np.random.default_rng([seed, side == "left"])
    time = np.arange(n) / RATE

    def swing(width: int) -> np.ndarray:
        return np.sin(rng.uniform(0, 6, width) + rng.uniform(1, 5, width) * time[:, None])

    q = swing(n_q)
    q[:, 3:7] = turning(n, RATE, 0, 2.0)
    sites, position, touching = swing(60).reshape(n, 20, 3), swing(3), swing(20) > 0
    quaternion = turning(n, RATE, 2, 3.0)
    lost = range(n)[LOST.get(trial, slice(0, 0))]
    return [
        {
            "trial": trial,
            "side": side,
            "frame": i,
            "time": time[i],
            "q": q[i].tolist(),
            "sites": sites[i].tolist(),
            "object_position": None if i in lost else position[i].tolist(),
            "object_quaternion": None if i in lost else quaternion[i].tolist(),
            "touching": [None] * 20 if i in lost else touching[i].tolist(),
        }
        for i in range(n)
    ]


def moving_trial(
    number: int,
    subject: str = "anna",
    object_: str = "mug",
    sides: tuple[str, ...] = ("right",),
    n: int = N_FRAMES,
    n_q: int = 30,
    angles: bool = True,
    **trial: Any,
) -> TrialTables:
    """Return the rows of a trial with one grasp of each hand, or two of a left one."""
    key = f"s/{subject}_{object_}_{number}"
    common = {"session": "s", "trial": key, "subject": subject, "object": object_, "task": "lift"}
    described = {**common, "rate": RATE if n > 1 else None, "n_frames": n, "input_key": key, "status": "ok"}
    frames = [row for side in sides for row in frame_rows(key, number, side, n, n_q)]
    if not angles:
        frames = [{**row, "q": None} for row in frames]
    grasps = [
        {
            **common,
            "grasp": f"{key}/{side}/{i}",
            "side": side,
            "snapshot_frame": min(10 * (i + 1), n - 1),
            "grasp_type": "medium wrap" if object_ == "mug" else None,
        }
        for side in sides
        for i in range(2 if side == "left" else 1)
    ]
    return TrialTables(
        {
            "trials": rows("trials", {**described, "n_grasps": len(grasps), **trial}),
            "frames": rows("frames", *frames),
            "grasps": rows("grasps", *grasps),
        }
    )


def build(folder: Path) -> Path:
    """Write six trials of five people with two objects: seven hands, eight grasps, two trials with gaps."""
    store = Store.create_or_open(folder)
    people = ("anna", "ben", "cal", "dan", "eve")
    store.commit_session(session_tables(subjects=people, objects=("mug", "jug")))
    store.commit_trials(
        [
            moving_trial(0, "anna", sides=("right", "left")),
            moving_trial(3, "anna", "jug", data_set="Hands", data_set_version="2", licence="CC BY-NC 4.0"),
            moving_trial(4, "ben", "jug"),
            moving_trial(1, "cal", "jug"),
            moving_trial(5, "dan"),
            moving_trial(2, "eve"),
        ]
    )
    return folder
