"""``graspdb optimize``: dead rows swept, small files joined, old ones deleted."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


def optimize(
    db: Db = DEFAULT_DB,
    retention: Annotated[
        int, typer.Option(min=0, metavar="HOURS", help="How far back earlier states stay readable.")
    ] = 168,
    as_json: Json = False,
) -> None:
    """Delete dead rows, join small files, and delete files that no state of the last week needs.

    Ingests and queries may run at the same time. "--retention 0" leaves no byte of what was removed or
    replaced; databases that are open then have to be opened again.
    """
    from graspdb.maintenance import optimize

    done = optimize(db, retention_hours=retention)
    if as_json:
        typer.echo(json.dumps({name: asdict(table) for name, table in done.items()}, indent=2))
        return
    for name, table in done.items():
        if table.swept or table.vacuumed or table.files_before != table.files_after:
            typer.echo(
                f"{name:<20}{table.swept:>10,} dead rows swept, {table.files_before:,} files joined to "
                f"{table.files_after:,}, {table.vacuumed:,} old files deleted"
            )
    typer.echo(f"{db}: optimized")
