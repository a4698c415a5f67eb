"""A data glove on the simulated hand: joint angles with an offset for each sensor, noise and a clock."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from graspdb.simulate.arrays import Floats
from graspdb.simulate.measurement import NoiseParameters
from graspdb_schemas.vocabulary import JOINT_ANGLES

RATE: Final = 100.0
"""Samples a second [Hz]."""
LARGEST_DELAY: Final = 0.05
"""How far the glove's clock may be off the cameras' [s]."""
WORN: Final = tuple(joint for joint in JOINT_ANGLES if not joint.startswith("wrist"))
"""The joints that have a sensor; the forearm carries none."""


@dataclass(frozen=True)
class GloveTruth:
    """What is wrong with a trial's glove.

    Attributes
    ----------
    offset : dict of str to float
        Constant offset of each sensor, by joint [rad].
    delay : float
        How much later its clock shows a movement [s].
    """

    offset: dict[str, float]
    delay: float


def draw_glove(noise: NoiseParameters, rng: np.random.Generator) -> GloveTruth:
    """Return offsets and delay of a glove as it was put on."""
    offset = noise.glove_offset_sd * rng.standard_normal(len(WORN))
    delay = float(rng.uniform(-LARGEST_DELAY, LARGEST_DELAY)) if noise.glove_offset_sd else 0.0
    return GloveTruth(dict(zip(WORN, offset.tolist(), strict=True)), delay)


def write_glove(
    path: Path,
    times: Floats,
    q: Floats,
    truth: GloveTruth,
    noise: NoiseParameters,
    rng: np.random.Generator,
) -> None:
    """Write ``time`` [s] and an angle [degrees] for each sensor.

    Parameters
    ----------
    path : Path
        The file.
    times : ndarray, shape (n_frames,)
        Times of the trial [s].
    q : ndarray, shape (n_frames, 30)
        The hand.
    truth : GloveTruth
        Offsets and delay.
    noise : NoiseParameters
        Its `glove_sd`.
    rng : numpy.random.Generator
        Draws the noise.
    """
    path.parent.mkdir(exist_ok=True)
    sampled = np.arange(times[0], times[-1] + 0.5 / RATE, 1 / RATE)
    columns = []
    for joint in WORN:
        angle = np.interp(sampled - truth.delay, times, q[:, 7 + JOINT_ANGLES.index(joint)])
        columns.append(angle + truth.offset[joint] + noise.glove_sd * rng.standard_normal(len(sampled)))
    rows = np.column_stack([sampled, np.rad2deg(np.column_stack(columns))])
    titles = ",".join(["time", *(f"{joint} [deg]" for joint in WORN)])
    lines = [f"{row[0]:.5f}," + ",".join(f"{angle:.3f}" for angle in row[1:]) for row in rows]
    path.write_text("\n".join([titles, *lines]) + "\n", encoding="utf-8")
