"""``graspdb view``: a grasp to look at, in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db


def view(
    grasp: Annotated[str, typer.Argument(metavar="GRASP", help="Key of a grasp of the database.")],
    other: Annotated[
        str | None, typer.Argument(metavar="[OTHER]", help="Another grasp, laid beside the first.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The page to write.")] = Path(
        "grasp.html"
    ),
    db: Db = DEFAULT_DB,
) -> None:
    """Write a page of a grasp, which any browser opens from disk with no network.

    It shows the object, the hand, the spheres that touch, the enclosing space, the graspable feature,
    contacts and contact map, as layers, and the motion of the trial. With a second grasp the two stand
    side by side, laid over each other by their features, and the page says what makes them alike.
    """
    from graspdb.database import Database
    from graspdb.view.write import write_page

    with Database(db) as database:
        page = write_page(database, output, grasp, other)
    typer.echo(f"Wrote {page}: open it in a browser")
