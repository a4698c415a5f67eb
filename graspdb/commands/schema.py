"""``graspdb schema``: the tables and their columns."""

import json
from typing import Annotated

import typer

from graspdb.commands.options import Json


def schema(
    table: Annotated[str | None, typer.Argument(metavar="TABLE", help="Show only this table.")] = None,
    as_json: Json = False,
) -> None:
    """Show the tables of a database: their columns with type, unit and meaning."""
    from graspdb_schemas.describe import describe_tables
    from graspdb_schemas.errors import ParameterError, nearest

    tables = {described.name: described for described in describe_tables()}
    if table is not None and table not in tables:
        raise ParameterError("table", table, ", ".join(tables) + nearest(table, list(tables)))
    chosen = [tables[table]] if table is not None else list(tables.values())
    if as_json:
        typer.echo(json.dumps([described.as_dict() for described in chosen], indent=2))
        return
    for described in chosen:
        typer.echo(f"{described.name}: {described.doc}")
        width = max(len(column.name) for column in described.columns)
        kinds = max(len(column.kind) for column in described.columns)
        for column in described.columns:
            unit = f" [{column.unit}]" if column.unit else ""
            typer.echo(f"  {column.name:<{width}}  {column.kind:<{kinds}}  {column.doc}{unit}")
        typer.echo()
