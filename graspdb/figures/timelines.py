"""A trial over time: grip aperture, height of the object, contacts by digit."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from graspdb.database import Database
from graspdb.figures.canvas import PAGE, canvas
from graspdb.view import palette
from graspdb.view.reading import read_scene
from graspdb.view.scene import Floats, Motion, Scene
from graspdb_ingest.runs import runs
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import DIGITS, SITES

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def timelines_figure(database: Database, path: Path, key: str) -> None:
    """Draw what happens in the trial of a grasp, from reach to release.

    Grip aperture is the distance of thumb tip to index tip; height is that of the object's origin along the
    lab's vertical, over where it was first seen.

    Raises
    ------
    QueryError
        There is no such grasp, it has no frames, or the radii of its hand are not stored.
    ParameterError, MissingLibraryError, OutputError
        See `graspdb.figures.canvas.canvas`.
    """
    with canvas(path, PAGE, 85) as figure:
        scene = read_scene(database, key)
        if scene.motion is None:
            raise QueryError(
                f"grasp {key!r} is one instant, without frames", "Choose a grasp of a recording."
            )
        top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
        motion = scene.motion
        for axes in (top, middle, bottom):
            _phases(axes, motion, named=axes is top)
        top.plot(motion.times, 1e3 * aperture(motion), color=palette.CATEGORIES[0])
        top.set_ylabel("grip aperture [mm]")
        middle.plot(motion.times, 1e3 * height(scene, motion), color=palette.CATEGORIES[5])
        middle.set_ylabel("object height [mm]")
        _contacts(bottom, motion)
        bottom.set_xlabel("time [s]")
        bottom.set_xlim(motion.times[0], motion.times[-1])
        figure.suptitle(key)


def aperture(motion: Motion) -> Floats:
    """Return the distance of thumb tip to index tip [m], shape (n,)."""
    tips = motion.nodes[:, [SITES.index("thumb_tip"), SITES.index("index_tip")]]
    return np.asarray(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1))


def height(scene: Scene, motion: Motion) -> Floats:
    """Return how high the object is over where it was first seen [m], shape (n,); NaN where it is not."""
    up = scene.world_from_object[:3, :3] @ scene.up
    along = motion.object_position @ up
    known = np.isfinite(along)
    return np.asarray(along - along[known][0] if known.any() else along)


def _phases(axes: "Axes", motion: Motion, named: bool) -> None:
    for i, phase in enumerate(motion.phases):
        axes.axvspan(phase.start, phase.end, color=palette.HULL, alpha=0.10 if i % 2 else 0.22, linewidth=0)
        if named:
            axes.annotate(
                phase.name,
                ((phase.start + phase.end) / 2, 1.02),
                xycoords=("data", "axes fraction"),
                ha="center",
                fontsize=6.5,
            )
    axes.axvline(motion.times[motion.snapshot], color=palette.INK, linewidth=0.7, linestyle=(0, (3, 2)))


def _contacts(axes: "Axes", motion: Motion) -> None:
    for row, digit in enumerate(DIGITS):
        touches = np.asarray(motion.touching[:, 4 * row : 4 * row + 4].any(axis=1))
        for first, after in runs(touches):
            start, end = motion.times[first], motion.times[after - 1]
            axes.barh(row, end - start, left=start, height=0.62, color=palette.DIGIT_COLOURS[digit])
    axes.set_yticks(range(len(DIGITS)), DIGITS)
    axes.invert_yaxis()
    axes.set_ylabel("contacts")
