"""Hand and object over the frames of a trial."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from graspdb.view.scene import ELBOW, FOREARM_DRAWN, NODES, WRIST, Bools, Floats, Motion, Phase
from graspdb_ingest.rigid import continuous_signs, fit_rigid, rotations_from_quaternions, transform_points
from graspdb_schemas.vocabulary import DIGITS, N_Q, N_SITES

MOST_FRAMES: Final = 1800
"""Frames that are kept; of longer trials every second, third ... one."""

PALM: Final = tuple(4 * i for i in range(len(DIGITS)))
"""Sites that the palm carries, as indices of `SITES`."""

AT_THE_TOP: Final = 0.95
"""The lift ends at this share of the height that the object reaches in the hold."""


@dataclass(frozen=True)
class Times:
    """Times of a grasp [s], None where it has none."""

    onset: float | None
    lift: float | None
    release: float | None


def read_motion(
    rows: dict[str, list[Any]], snapshot_frame: int, snapshot_nodes: Floats, up: Floats | None, times: Times
) -> Motion | None:
    """Return the motion in the frames of one hand, or None where there is one frame alone.

    Parameters
    ----------
    rows : mapping of str to list
        Columns of the table `frames`, in the order of time.
    snapshot_frame : int
        The frame of the snapshot.
    snapshot_nodes : ndarray, shape (22, 3)
        The hand at the snapshot, in whatever frame.
    up : ndarray, shape (3,), or None
        Vertical of the lab.
    times : Times
        Times of the grasp.
    """
    frames = np.array(rows["frame"], dtype=int)
    if len(frames) < 2 or snapshot_frame not in frames:
        return None
    stride = -(-len(frames) // MOST_FRAMES)
    at = int(np.searchsorted(frames, snapshot_frame))
    kept = slice(at % stride, None, stride)
    columns = {name: values[kept] for name, values in rows.items()}
    seconds = array_of(columns["time"], ())
    position = array_of(columns["object_position"], (3,))
    quaternion = continuous_signs(array_of(columns["object_quaternion"], (4,)))
    return Motion(
        times=seconds,
        nodes=_nodes(columns, snapshot_nodes),
        object_position=position,
        object_quaternion=quaternion,
        gap=array_of(columns["gap"], (N_SITES,)),
        touching=_touching(columns["touching"]),
        snapshot=at // stride,
        phases=_phases(seconds, position @ up if up is not None else None, times),
    )


def array_of(values: list[Any], shape: tuple[int, ...]) -> Floats:
    """Return rows of numbers as an array of shape (n, *shape), NaN where they, or parts of them, are None."""
    whole = np.full((len(values), *shape), np.nan)
    for row, value in zip(whole, values, strict=True) if shape else ():
        if value is None:
            continue
        if len(shape) == 1:
            row[:] = [np.nan if number is None else number for number in value]
        else:
            row[:] = array_of(value, shape[1:])
    if not shape:
        whole[:] = [np.nan if value is None else value for value in values]
    return whole


def _touching(values: list[Any]) -> Bools:
    touching = np.zeros((len(values), N_SITES), dtype=bool)
    for row, value in zip(touching, values, strict=True):
        if value is not None:
            row[:] = [bool(touches) for touches in value]
    return touching


def _nodes(columns: dict[str, list[Any]], snapshot: Floats) -> Floats:
    """Return the hand's nodes in every frame: wrist and elbow go with the palm's sites as at the snapshot."""
    nodes = np.full((len(columns["frame"]), len(NODES), 3), np.nan)
    nodes[:, :N_SITES] = array_of(columns["sites"], (N_SITES, 3))
    if np.isfinite(snapshot[[*PALM, WRIST]]).all():
        palm = nodes[:, list(PALM)]
        fit = fit_rigid(snapshot[list(PALM)], palm, np.isfinite(palm).all(axis=2).astype(float))
        nodes[:, WRIST] = transform_points(fit.rotations, fit.positions, snapshot[None, WRIST])[:, 0]
    nodes[:, ELBOW] = elbows(columns["q"], nodes[:, WRIST])
    return nodes


def elbows(configurations: list[Any], wrists: Floats) -> Floats:
    """Return the far ends of the drawn forearms, shape (n, 3); NaN where no forearm is tracked.

    The forearm's frame has its origin in the wrist, and its x axis runs distally.
    """
    quaternions = array_of(
        [q[3:7] if q is not None and len(q) == N_Q else None for q in configurations], (4,)
    )
    return wrists - FOREARM_DRAWN * rotations_from_quaternions(quaternions)[:, :, 0]


def _phases(seconds: Floats, height: Floats | None, times: Times) -> tuple[Phase, ...]:
    """Return the parts of the trial: reach, contact, lift, hold, release."""
    first, last = float(seconds[0]), float(seconds[-1])
    release = last if times.release is None else times.release
    onset = first if times.onset is None else times.onset
    if times.lift is None:
        bounds = [("reach", first, onset), ("hold", onset, release)]
    else:
        top = _top(seconds, height, times.lift, release)
        bounds = [
            ("reach", first, onset),
            ("contact", onset, times.lift),
            ("lift", times.lift, top),
            ("hold", top, release),
        ]
    bounds.append(("release", release, last))
    return tuple(Phase(*bound) for bound in bounds if bound[2] > bound[1])


def _top(seconds: Floats, height: Floats | None, lift: float, release: float) -> float:
    """Return when the object has come near the greatest height of its hold."""
    if height is None:
        return lift
    held = np.flatnonzero((seconds >= lift) & (seconds <= release) & np.isfinite(height))
    if not len(held):
        return lift
    risen = height[held] - height[held[0]]
    return float(seconds[held[np.argmax(risen >= AT_THE_TOP * risen.max())]])
