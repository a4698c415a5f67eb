"""``graspdb explore``: a database in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db


def explore(
    folder: Annotated[
        Path | None, typer.Argument(metavar="DB", help="Folder of the database, in place of --db.")
    ] = None,
    port: Annotated[
        int, typer.Option(help="Port to listen on; 0 takes one that is free.", min=0, max=65535)
    ] = 0,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    db: Db = DEFAULT_DB,
) -> None:
    """Show a database in the browser, until Ctrl-C: grasps to filter, questions, SQL, more like this.

    The address that is printed leads to pages that this machine alone can open, and nobody without the
    address. Nothing in them can write. They show the database as it is when the command starts.
    """
    from graspdb.database import Database
    from graspdb.explore import Server

    with Database(folder or db) as database:
        server = Server(database, port)
        typer.echo(server.address)
        typer.echo("Ctrl-C ends it.", err=True)
        if show:
            typer.launch(server.address)
        server.serve()
