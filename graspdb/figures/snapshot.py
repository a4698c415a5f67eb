"""A grasp at its snapshot: the paper's figure 1."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

from graspdb.database import Database
from graspdb.figures.canvas import COLUMN, bare, canvas, pixels
from graspdb.view import palette
from graspdb.view.facts import subtitle
from graspdb.view.picture import picture
from graspdb.view.reading import read_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEGEND: Final = (
    (palette.TOUCHING, "touching spheres"),
    (palette.HULL, "enclosing space"),
    (palette.FEATURE, "graspable feature"),
    (palette.CONTACT, "contacts and normals"),
)

_CAPTION: Final = 18.0
"""Height that title and legend take [mm]."""


def snapshot_figure(database: Database, path: Path, key: str) -> None:
    """Draw one grasp: object, hand, touching spheres, enclosing space, feature and contacts.

    Raises
    ------
    QueryError
        There is no such grasp, or the radii of its hand are not stored.
    ParameterError, MissingLibraryError, OutputError
        See `graspdb.figures.canvas.canvas`.
    """
    with canvas(path, COLUMN, COLUMN + _CAPTION) as figure:
        scene = read_scene(database, key, motion=False)
        axes = figure.add_subplot()
        bare(axes)
        size = pixels(COLUMN)
        axes.imshow(picture(scene, size, size), interpolation="lanczos")
        figure.suptitle(f"{key}\n{subtitle(scene)}", fontsize=7.5)
        add_legend(figure, columns=2)


def add_legend(figure: "Figure", columns: int = len(_LEGEND)) -> None:
    """Say below a figure what the colours of a grasp mean, in so many columns."""
    from matplotlib.lines import Line2D

    dots = [
        Line2D([], [], marker="o", linestyle="", markersize=4, color=colour, label=label)
        for colour, label in _LEGEND
    ]
    figure.legend(handles=dots, loc="outside lower center", ncols=columns, handletextpad=0.1, columnspacing=1)
