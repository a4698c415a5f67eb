"""Grasps in the plane of their first two postural synergies, and what synergies explain."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspdb.database import Database
from graspdb.figures.canvas import PAGE, canvas
from graspdb.view import palette
from graspdb_schemas.errors import QueryError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKERS: Final = "os^DvP*X"
_SHOWN: Final = 10
"""Components whose share of the variance is drawn."""


def synergies_figure(database: Database, path: Path) -> None:
    """Draw grasps by their scores on two synergies, coloured by object, with a mark for each subject.

    The numbers are those of the queries synergy_space and synergies.

    Raises
    ------
    QueryError
        Too few grasps have a posture.
    ParameterError, MissingLibraryError, OutputError
        See `graspdb.figures.canvas.canvas`.
    """
    scores = database.query("synergy_space", components=2).table.to_pylist()
    explained = database.query("synergies").table.to_pylist()
    if len(scores) < 3:
        raise QueryError("fewer than three grasps have a posture", "Ingest recordings that are tracked.")
    with canvas(path, PAGE, 80) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        _plane(left, scores, [row["explained"] for row in explained])
        _explained(right, explained)


def _plane(axes: "Axes", scores: list[dict[str, Any]], explained: list[float]) -> None:
    objects = sorted({str(row["object"]) for row in scores})
    subjects = sorted({str(row["subject"]) for row in scores})
    for i, name in enumerate(objects):
        for k, subject in enumerate(subjects):
            rows = [r for r in scores if str(r["object"]) == name and str(r["subject"]) == subject]
            places = np.array([[r["score_1"], r["score_2"]] for r in rows]).reshape(-1, 2)
            colour = palette.CATEGORIES[i % len(palette.CATEGORIES)]
            mark = _MARKERS[k % len(_MARKERS)]
            first, second = places.T
            axes.scatter(first, second, s=16, color=colour, marker=mark, linewidths=0, alpha=0.85)
    for i, name in enumerate(objects[:12]):
        axes.scatter([], [], s=16, color=palette.CATEGORIES[i % len(palette.CATEGORIES)], label=name)
    for k, subject in enumerate(subjects[:12]):
        axes.scatter([], [], s=16, color=palette.HULL, marker=_MARKERS[k % len(_MARKERS)], label=subject)
    axes.set_xlabel(f"first synergy [rad], {100 * explained[0]:.0f} % of the variance")
    axes.set_ylabel(f"second synergy [rad], {100 * explained[1]:.0f} %")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="best")


def _explained(axes: "Axes", rows: list[dict[str, Any]]) -> None:
    first = rows[:_SHOWN]
    numbers = [row["component"] for row in first]
    axes.bar(numbers, [100 * row["explained"] for row in first], color=palette.CATEGORIES[0], width=0.7)
    axes.plot(
        numbers, [100 * row["cumulative"] for row in first], color=palette.INK, marker="o", markersize=3
    )
    axes.set_ylim(0, 100)
    axes.set_xticks(numbers)
    axes.set_xlabel(f"synergy, of {rows[0]['n_postures']} grasps")
    axes.set_ylabel("variance explained [%], line: together")
