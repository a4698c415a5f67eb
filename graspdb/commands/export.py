"""``graspdb export FORMAT``: a database in a form that other programs read."""

from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db

export = typer.Typer(
    name="export",
    help="Write a database in a form that other programs read.",
    rich_markup_mode=None,
    no_args_is_help=True,
)


@export.callback()
def _export() -> None:
    """Write a database in a form that other programs read."""


@export.command()
def duckdb(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="DuckDB file to write, such as grasps.duckdb.")
    ],
    db: Db = DEFAULT_DB,
    refuse_licence: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="Leave out trials with this in their licence note, such as NC."),
    ] = None,
) -> None:
    """Write a small DuckDB file of views on the tables, for any DuckDB client.

    It has every table, view and function that graspdb sql has, and no rows of its own: the views read the
    database's Parquet files where they lie. They show the state of the database at this moment, for as
    long as its files are not vacuumed and the folder is not moved.
    """
    from graspdb.database import Database

    with Database(db) as database:
        database.export("duckdb", file, refuse_licences=refuse_licence or ())
        place = database.path.resolve() if isinstance(database.path, Path) else database.path
    typer.echo(f"Wrote {file}: views on {place}")
