"""``graspdb schema``: the tables and their columns."""

import json
from typing import Annotated

import typer

from graspdb.commands.options import Json


def schema(
    table: Annotated[
        str | None, typer.Argument(metavar="TABLE", help="Show only this table or view.")
    ] = None,
    functions: Annotated[
        bool, typer.Option("--functions", help="Show the functions that queries may call instead.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Show the tables and views of a database: their columns with type, unit and meaning."""
    if functions:
        _functions(as_json)
        return
    from graspdb_queries.joins import describe_views
    from graspdb_schemas.describe import describe_tables
    from graspdb_schemas.errors import ParameterError, nearest

    tables = {described.name: described for described in (*describe_tables(), *describe_views())}
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


def _functions(as_json: bool) -> None:
    """Print every function with an example."""
    from graspdb_queries.macros import macros

    if as_json:
        described = [
            {"name": m.name, "arguments": list(m.arguments), "doc": m.doc, "example": m.example}
            for m in macros()
        ]
        typer.echo(json.dumps(described, indent=2))
        return
    width = max(len(macro.call) for macro in macros())
    for macro in macros():
        typer.echo(f"{macro.call:<{width}}  {macro.doc}\n{'':<{width}}  SELECT {macro.example}")
