"""The first experiment's force panels: the centre of pressure of each digit in the object's frame."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from graspdb.simulate.arrays import Floats
from graspdb.simulate.measurement import NoiseParameters, slow_drift
from graspdb.simulate.surface import Surface
from graspdb.simulate.writer import MILLIMETRES
from graspdb_schemas.vocabulary import SITES

DRIFT_TIME = 0.5
"""Time scale of the sensors' error [s]."""


def write_pressure(
    path: Path,
    digits: tuple[str, ...],
    surface: Surface,
    sites: Floats,
    contact: NDArray[np.bool_],
    times: Floats,
    noise: NoiseParameters,
    rng: np.random.Generator,
) -> None:
    """Write ``time, digit, x, y, z`` [s, mm] for every frame in which a digit's pad presses a panel.

    The centre of pressure is the point of the panel nearest to the centre of the tip's sphere; the
    sensor's error moves it within the panel.

    Parameters
    ----------
    path : Path
        The file.
    digits : tuple of str
        The two digits.
    surface : Surface
        The inverted T.
    sites : ndarray, shape (n_frames, 20, 3)
        Sphere centres in the object's frame [m].
    contact : ndarray of bool, shape (n_frames, 20)
        Where a sphere touches.
    times : ndarray, shape (n_frames,)
        Times [s].
    noise : NoiseParameters
        Its `pressure_sd`.
    rng : numpy.random.Generator
        Draws the error.
    """
    path.parent.mkdir(exist_ok=True)
    rate = 1 / (times[1] - times[0])
    rows = []
    for digit in digits:
        tip = SITES.index(f"{digit}_tip")
        point = surface.nearest(sites[:, tip]).point
        error = noise.pressure_sd * slow_drift((len(times), 2), DRIFT_TIME * rate, rng)
        point[:, [0, 2]] += error
        rows += [(times[i], digit, *(MILLIMETRES * point[i])) for i in np.flatnonzero(contact[:, tip])]
    lines = [f"{time:.6f},{digit},{x:.4f},{y:.4f},{z:.4f}" for time, digit, x, y, z in sorted(rows)]
    path.write_text("\n".join(["time,digit,x,y,z", *lines]) + "\n", encoding="utf-8")
