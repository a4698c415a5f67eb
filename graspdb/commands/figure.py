"""``graspdb figure KIND``: still pictures for papers."""

from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db

figure = typer.Typer(
    name="figure",
    help="Draw a still picture for a paper: PNG, SVG or PDF, by the ending of the file.",
    rich_markup_mode=None,
    no_args_is_help=True,
)

Grasp = Annotated[str, typer.Argument(metavar="GRASP", help="Key of a grasp of the database.")]
Drawn = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="File to write: .png, .svg or .pdf.")
]


@figure.callback()
def _figure() -> None:
    """Draw a still picture for a paper: PNG, SVG or PDF, by the ending of the file."""


@figure.command()
def snapshot(grasp: Grasp, output: Drawn, db: Db = DEFAULT_DB) -> None:
    """Draw a grasp at its snapshot, as in the paper's figure 1.

    It shows object, hand, touching spheres, enclosing space, graspable feature and contacts.
    """
    from graspdb.database import Database
    from graspdb.figures.snapshot import snapshot_figure

    with Database(db) as database:
        snapshot_figure(database, output, grasp)
    _tell(output)


@figure.command()
def grid(
    output: Drawn,
    where: Annotated[
        str, typer.Option(metavar="SQL", help="Only grasps for which this is true: \"subject = 's1'\".")
    ] = "true",
    db: Db = DEFAULT_DB,
) -> None:
    """Draw snapshots of many grasps, as in the paper's figure 3.

    Each subject and object is a row, with its repetitions side by side.
    """
    from graspdb.database import Database
    from graspdb.figures.grid import grid_figure

    with Database(db) as database:
        grid_figure(database, output, where)
    _tell(output)


@figure.command()
def timelines(grasp: Grasp, output: Drawn, db: Db = DEFAULT_DB) -> None:
    """Draw grip aperture, height of the object and contacts by digit over the trial of a grasp."""
    from graspdb.database import Database
    from graspdb.figures.timelines import timelines_figure

    with Database(db) as database:
        timelines_figure(database, output, grasp)
    _tell(output)


@figure.command("contact-density")
def contact_density(
    object_: Annotated[str, typer.Argument(metavar="OBJECT", help="Name of an object.")],
    output: Drawn,
    db: Db = DEFAULT_DB,
) -> None:
    """Draw an object from four sides, coloured by how often each part of it is touched."""
    from graspdb.database import Database
    from graspdb.figures.density import contact_density_figure

    with Database(db) as database:
        contact_density_figure(database, output, object_)
    _tell(output)


@figure.command()
def synergies(output: Drawn, db: Db = DEFAULT_DB) -> None:
    """Draw all grasps in the plane of their first two postural synergies, and what each explains."""
    from graspdb.database import Database
    from graspdb.figures.synergies import synergies_figure

    with Database(db) as database:
        synergies_figure(database, output)
    _tell(output)


@figure.command("table-1")
def table_1(output: Drawn, db: Db = DEFAULT_DB) -> None:
    """Draw the paper's Table I: errors of contact points against measured centres of pressure."""
    from graspdb.database import Database
    from graspdb.figures.table_1 import table_1_figure

    with Database(db) as database:
        table_1_figure(database, output)
    _tell(output)


def _tell(path: Path) -> None:
    typer.echo(f"Wrote {path}")
