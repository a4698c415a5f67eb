"""Snapshots of many grasps: the paper's figure 3."""

from pathlib import Path
from typing import Any, Final

from graspdb.database import Database
from graspdb.figures.canvas import PAGE, bare, canvas, pixels
from graspdb.figures.snapshot import add_legend
from graspdb.view.picture import picture
from graspdb.view.reading import SceneReader
from graspdb_schemas.errors import ParameterError, QueryError

MOST: Final = 150
"""Grasps that a figure shows at most."""

_LARGEST, _CAPTION = 34.0, 10.0
"""Largest side of a snapshot, and height that the legend takes [mm]."""

_GRASPS: Final = """
    SELECT subject, object, grasp
    FROM grasps
    WHERE {where}
    ORDER BY subject, object, repetition, grasp
"""


def grid_figure(database: Database, path: Path, where: str = "true") -> None:
    """Draw grasps in a grid: a row for each subject and object, its repetitions side by side.

    Parameters
    ----------
    database : Database
        The database.
    path : Path
        The file.
    where : str
        A boolean SQL expression over the columns of `grasps`; those for which it is true are drawn.

    Raises
    ------
    QueryError
        No grasp passes the filter, or the filter is wrong.
    ParameterError
        More than `MOST` pass it; or see `graspdb.figures.canvas.canvas`, as for other errors.
    """
    rows: dict[tuple[Any, Any], list[str]] = {}
    for subject, name, key in database.sql(_GRASPS.format(where=f"({where}\n)")).rows():
        rows.setdefault((subject, name), []).append(key)
    count = sum(map(len, rows.values()))
    if not count:
        raise QueryError(
            f"no grasp passes {where}", "graspdb sql 'SELECT * FROM grasps' shows what there is."
        )
    if count > MOST:
        raise ParameterError("--where", f"{where}, which {count} grasps pass", f"at most {MOST} grasps")
    columns = max(map(len, rows.values()))
    side = min(_LARGEST, PAGE / columns)
    reader = SceneReader(database)
    with canvas(path, max(columns * side, 85), len(rows) * side + _CAPTION) as figure:
        axes = figure.subplots(len(rows), columns, squeeze=False)
        figure.set_layout_engine("constrained", w_pad=0.005, h_pad=0.005, wspace=0, hspace=0)
        for row, ((subject, name), keys) in enumerate(rows.items()):
            for column, one in enumerate(axes[row]):
                bare(one)
                if column < len(keys):
                    size = pixels(side)
                    one.imshow(picture(reader.scene(keys[column], motion=False), size, size))
            axes[row][0].set_ylabel(f"{subject}\n{name}" if subject else f"{name}")
        add_legend(figure)
