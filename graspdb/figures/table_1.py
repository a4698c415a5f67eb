"""Errors of contact points against measured centres of pressure: the paper's Table I."""

from pathlib import Path

from graspdb.database import Database
from graspdb.figures.canvas import PAGE, canvas
from graspdb.view import palette


def table_1_figure(database: Database, path: Path) -> None:
    """Draw the mean distance of each digit's contact point to its measured centre of pressure, by subject.

    Raises
    ------
    QueryError
        No grasp has a centre of pressure measured at its snapshot.
    ParameterError, MissingLibraryError, OutputError
        See `graspdb.figures.canvas.canvas`.
    """
    from graspdb.validation.contacts import contact_errors

    errors = contact_errors(database)
    subjects = list(dict.fromkeys(error.subject for error in errors))
    pairs = list(dict.fromkeys(error.pair for error in errors))
    means = {(e.subject, e.pair, e.digit): e.all_points.mean for e in errors}
    cells = [
        [
            "/".join(_mm(means.get((subject, pair, digit))) for digit in pair.split("+"))
            for subject in subjects
        ]
        for pair in pairs
    ]
    with canvas(path, min(PAGE, 45 + 30 * len(subjects)), 18 + 6 * len(pairs)) as figure:
        axes = figure.add_subplot()
        axes.axis("off")
        figure.suptitle(
            "Mean distance of contact points to\ncentres of pressure, by digit [mm]", fontsize=7.5
        )
        table = axes.table(
            cells,
            rowLabels=[pair.replace("+", "/") for pair in pairs],
            colLabels=[str(subject) for subject in subjects],
            cellLoc="center",
            loc="center",
            edges="horizontal",
        )
        table.auto_set_font_size(False)
        table.set_fontsize(7)
        table.scale(1, 1.25)
        for cell in table.get_celld().values():
            cell.set_linewidth(0.5)
            cell.set_edgecolor(palette.HULL)


def _mm(metres: float | None) -> str:
    return "-" if metres is None or metres != metres else f"{1e3 * metres:.1f}"
