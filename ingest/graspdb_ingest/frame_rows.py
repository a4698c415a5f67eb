"""Rows of the tables that have one row a frame: markers and frames."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from graspdb_ingest.columns import flag_column, list_column, number_column, sparse_column
from graspdb_ingest.contact_events import TOUCHES, UNKNOWN
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.trial import TrackedHand, TrackedTrial
from graspdb_ingest.trial_markers import TrialMarkers
from graspdb_schemas.conform import rows_schema


def marker_rows(trial: str, markers: TrialMarkers) -> pa.Table:
    """Return the positions of every marker of the recording, under its own labels, nothing filled in."""
    recording = markers.recording
    return position_rows(trial, markers.times, recording.labels, recording.positions)


def position_rows(trial: str, times: Floats, labels: Sequence[str], positions: Floats) -> pa.Table:
    """Return the rows of `markers`.

    Parameters
    ----------
    trial : str
        Key of the trial.
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    labels : sequence of str
        Labels of the markers.
    positions : ndarray, shape (n_frames, n_markers, 3)
        Where they were [m]; NaN where not seen.
    """
    n = len(times)
    return pa.Table.from_pydict(
        {
            "trial": pa.repeat(trial, n),
            "frame": np.arange(n),
            "time": times,
            "labels": pa.repeat(pa.scalar(list(labels), rows_schema("markers").field("labels").type), n),
            "positions": list_column(positions),
        },
        schema=rows_schema("markers"),
    )


def frame_rows(trial: str, tracked: TrackedTrial) -> pa.Table:
    """Return every frame of every hand."""
    parts = [_frames(trial, tracked, str(side), hand) for side, hand in tracked.hands.items()]
    return pa.concat_tables(parts)


def _frames(trial: str, tracked: TrackedTrial, side: str, hand: TrackedHand) -> pa.Table:
    n, track = len(tracked.markers.times), hand.track
    positions, quaternions = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
    residuals = np.full(n, np.nan)
    fitness = np.full(n, np.nan)
    if tracked.object is not None:
        pose = tracked.object.track
        fitness = fitness if tracked.object.fitness is None else tracked.object.fitness
        positions, quaternions, residuals = pose.positions, pose.quaternions, pose.residuals
    return pa.Table.from_pydict(
        {
            "trial": pa.repeat(trial, n),
            "side": pa.repeat(side, n),
            "frame": np.arange(n),
            "time": tracked.markers.times,
            "q": list_column(track.q),
            "q_sd": list_column(track.q_sd),
            "sites": list_column(track.sites),
            "sites_sd": list_column(track.sites_sd),
            "object_position": list_column(positions),
            "object_quaternion": list_column(quaternions),
            "object_residual": number_column(residuals),
            "object_fitness": number_column(fitness),
            "gap": list_column(hand.posed.gaps.gap),
            "touching": flag_column(hand.states == TOUCHES, hand.states == UNKNOWN),
            "residual": number_column(track.residual_rms),
            "marker_residuals": sparse_column(np.linalg.norm(track.residuals, axis=2)),
            "n_markers": track.used.sum(axis=1),
            "flags": _flags(hand),
        },
        schema=rows_schema("frames"),
    )


def _flags(hand: TrackedHand) -> list[list[str]]:
    track, labels = hand.track, hand.prepared.hand.markers
    seen = np.isfinite(track.residuals[..., 0])
    flags: list[list[str]] = [[] for _ in track.q]
    for frame in np.flatnonzero(~track.tracked):
        flags[frame].append("not_tracked")
    for frame in np.flatnonzero(track.tracked & ~track.used.any(axis=1)):
        flags[frame].append("no_markers")
    for frame in np.flatnonzero(track.at_limit):
        flags[frame].append("at_limit")
    faulty = np.zeros(seen.shape, dtype=bool)
    for fault in track.faults:
        names = "+".join(labels[m] for m in fault.markers)
        for flagged in flags[fault.start : fault.stop]:
            flagged.append(f"{fault.kind}:{names}")
        if fault.kind != "swapped":
            faulty[fault.start : fault.stop, fault.markers] = True
    for frame, marker in np.argwhere(seen & ~track.used & ~faulty):
        flags[frame].append(f"rejected:{labels[marker]}")
    for digit, of_digit in hand.prepared.hand.markers_of_digit.items():
        for frame in np.flatnonzero(track.tracked & ~track.used[:, of_digit].any(axis=1)):
            flags[frame].append(f"filled:{digit}")
    return flags
