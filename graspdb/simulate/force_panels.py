"""The first experiment's force panels: the centre of pressure of each digit in the object's frame."""

from pathlib import Path

import numpy as np

from graspdb.simulate.arrays import Floats
from graspdb.simulate.measurement import NoiseParameters, slow_drift
from graspdb.simulate.surface import Surface
from graspdb.simulate.truth import TrialTruth
from graspdb.simulate.writer import MILLIMETRES
from graspdb_schemas.vocabulary import DIGIT_OF_SITE

DRIFT_TIME = 0.5
"""Time scale of the sensors' error [s]."""

PAD_COMPRESSION = 0.002
"""How far the pads of a grasping digit are pressed in [m]: half the depth of the flesh over the bones."""


def write_pressure(
    path: Path,
    digits: tuple[str, ...],
    surface: Surface,
    sites: Floats,
    radii: Floats,
    truth: TrialTruth,
    noise: NoiseParameters,
    rng: np.random.Generator,
) -> None:
    """Write ``time, digit, x, y, z`` [s, mm] for every frame in which a digit presses a panel.

    The sensor's error moves the `centres_of_pressure` within the panel.

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
    radii : ndarray, shape (20,)
        Their radii [m].
    truth : TrialTruth
        Gaps, contacts and times of the trial.
    noise : NoiseParameters
        Its `pressure_sd`.
    rng : numpy.random.Generator
        Draws the error.
    """
    path.parent.mkdir(exist_ok=True)
    times = truth.times
    rate = 1 / (times[1] - times[0])
    rows = []
    for digit in digits:
        own = [i for i, name in enumerate(DIGIT_OF_SITE) if name == digit]
        nearest = surface.nearest(sites[:, own]).point
        point = centres_of_pressure(nearest, truth.gap[:, own], radii[own])
        error = noise.pressure_sd * slow_drift((len(times), 2), DRIFT_TIME * rate, rng)
        point[:, [0, 2]] += error
        pressed = np.flatnonzero(truth.contact[:, own].any(axis=1))
        rows += [(times[i], digit, *(MILLIMETRES * point[i])) for i in pressed]
    lines = [f"{time:.6f},{digit},{x:.4f},{y:.4f},{z:.4f}" for time, digit, x, y, z in sorted(rows)]
    path.write_text("\n".join(["time,digit,x,y,z", *lines]) + "\n", encoding="utf-8")


def centres_of_pressure(points: Floats, gaps: Floats, radii: Floats) -> Floats:
    """Return where the spheres of a digit press together on a flat panel [m], shape (n, 3).

    The pad of each sphere is an elastic foundation (Johnson 1985, Contact Mechanics, section 4.3): pressure
    follows the depth, and over a sphere pressed in by d it adds up to a force that goes with ``r d ** 2``.
    All of a digit's spheres are pressed as far as its bones come near the panel, `PAD_COMPRESSION` at those
    that touch.

    Parameters
    ----------
    points : ndarray, shape (n, k, 3)
        The panel's points nearest to the spheres [m].
    gaps : ndarray, shape (n, k)
        Gaps of the spheres, whose radii are those of pads that nothing presses [m].
    radii : ndarray, shape (k,)
        Their radii [m].
    """
    force = radii * np.maximum(0.0, PAD_COMPRESSION - gaps) ** 2
    total = force.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.einsum("nk,nki->ni", force / total, points))
