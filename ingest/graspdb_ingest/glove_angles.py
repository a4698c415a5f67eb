"""From a glove's sensors to the joints of a trial's hands."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats, HandModel
from graspdb_ingest.readers.glove import GloveRecording
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError, nearest
from graspdb_schemas.vocabulary import Side

SHORTEST_COVER: Final = 0.5
"""Share of a trial that its glove must cover."""
LENGTH_TOLERANCE: Final = 0.05
"""A glove without times must be as long as the recording, give or take this share of it ..."""
LENGTH_SLACK: Final = 0.5
"""... and this [s]."""
LONGEST_GAP: Final = 0.1
"""Missing samples are interpolated over no longer than this [s]."""


@dataclass(frozen=True)
class GloveAngles:
    """What a glove says of one hand's joints.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints that have a sensor.
    hinges : ndarray of int, shape (n_sensors,)
        Their places among the hand's hinges.
    times : ndarray, shape (n_samples,)
        Time of each sample on the recording's clock [s].
    angles : ndarray, shape (n_samples, n_sensors)
        Angles [rad], NaN where missing.
    """

    joints: tuple[str, ...]
    hinges: NDArray[np.int64]
    times: Floats
    angles: Floats

    def at(self, times: Floats, delay: float = 0.0) -> Floats:
        """Return the angles at given times, shape (n_times, n_sensors), NaN where there is no sample near.

        Parameters
        ----------
        times : ndarray, shape (n_times,)
            Times on the recording's clock [s].
        delay : float
            How much later the glove's clock shows what happens at a time [s].
        """
        wanted = times + delay
        values = np.full((len(times), len(self.joints)), np.nan)
        for i, column in enumerate(self.angles.T):
            known = np.flatnonzero(np.isfinite(column))
            if len(known) < 2:
                continue
            when = self.times[known]
            after = np.clip(np.searchsorted(when, wanted), 1, len(when) - 1)
            near = when[after] - when[after - 1] <= LONGEST_GAP
            inside = (wanted >= when[0]) & (wanted <= when[-1])
            values[:, i] = np.where(inside & near, np.interp(wanted, when, column[known]), np.nan)
        return values


def select_glove(
    glove: GloveRecording, recording: Recording, times: Floats, hands: Mapping[Side, HandModel]
) -> tuple[dict[Side, GloveAngles], tuple[str, ...]]:
    """Pick a trial's joint angles out of a glove's recording.

    Parameters
    ----------
    glove : GloveRecording
        What was read from the glove's file.
    recording : Recording
        The whole recording of markers, whose clock counts.
    times : ndarray, shape (n_frames,)
        Times of the trial's frames [s].
    hands : mapping of Side to HandModel
        The trial's hands; a sensor is named like a hinge, behind ``right_`` or ``left_`` where there
        are both.

    Returns
    -------
    angles : dict of Side to GloveAngles
        The sensors of each hand.
    notes : tuple of str
        What to know: columns that name no joint, a glove that covers a part of the trial.

    Raises
    ------
    RecordingError
        If no column names a joint, or the glove belongs to another recording.
    """
    clock = _on_clock(glove, recording, times)
    picked, taken = {}, set()
    for side, hand in hands.items():
        columns = {}
        for hinge, joint in enumerate(hand.joints):
            for name in (f"{side}_{joint}", *([joint] if len(hands) == 1 else [])):
                if name in glove.sensors and hinge not in columns:
                    columns[hinge] = glove.sensors.index(name)
        taken |= set(columns.values())
        if columns:
            hinges = np.array(list(columns), dtype=np.int64)
            joints = tuple(hand.joints[i] for i in hinges)
            picked[side] = GloveAngles(joints, hinges, clock, glove.angles[:, list(columns.values())])
    if not picked:
        raise _no_joint(glove, hands)
    unused = [name for i, name in enumerate(glove.sensors) if i not in taken]
    notes = [f"columns of the glove that are no joint: {', '.join(unused)}"] if unused else []
    covered = float(np.mean([np.isfinite(angles.at(times)).any(axis=1) for angles in picked.values()]))
    if covered < 0.99:
        notes.append(f"the glove covers {covered:.0%} of the frames")
    return picked, tuple(notes)


def _on_clock(glove: GloveRecording, recording: Recording, times: Floats) -> Floats:
    """Return the samples' times on the recording's clock, or refuse a glove of another recording."""
    if not glove.own_clock:
        length, other = float(glove.times[-1]), float(recording.times[-1] - recording.times[0])
        if abs(length - other) > max(LENGTH_TOLERANCE * other, LENGTH_SLACK):
            raise RecordingError(
                glove.path,
                f"it lasts {length:.2f} s and the recording of the markers {other:.2f} s",
                "A glove without times must begin and end with the recording: check the file, or its rate.",
            )
        return glove.times + recording.start_time
    inside = (times >= glove.times[0]) & (times <= glove.times[-1])
    if inside.mean() < SHORTEST_COVER:
        raise RecordingError(
            glove.path,
            f"its times run from {glove.times[0]:g} to {glove.times[-1]:g} s, and the trial from "
            f"{times[0]:g} to {times[-1]:g} s",
            f"It must cover {SHORTEST_COVER:.0%} of the trial, in the recording's own time: check the file.",
        )
    return glove.times


def _no_joint(glove: GloveRecording, hands: Mapping[Side, HandModel]) -> RecordingError:
    joints = list(dict.fromkeys(joint for hand in hands.values() for joint in hand.joints))
    if len(hands) > 1:
        joints = [f"{side}_{joint}" for side in hands for joint in joints]
    hint = nearest(glove.sensors[0], joints)
    return RecordingError(
        glove.path,
        f"none of its columns names a joint: {', '.join(glove.sensors[:8])}{hint}",
        f"Map them with `glove: names` in session.yaml to the hand's joints: {', '.join(joints)}.",
    )
