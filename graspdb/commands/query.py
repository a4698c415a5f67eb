"""``graspdb query``: answer a named query."""

from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Format, FormatOption, Output


def query(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the query.")] = None,
    param: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="KEY=VALUE", help="A parameter of the query; may be repeated."),
    ] = None,
    show_list: Annotated[
        bool, typer.Option("--list", help="List the queries, their parameters and columns.")
    ] = False,
    db: Db = DEFAULT_DB,
    format_: FormatOption = Format.TABLE,
    output: Output = None,
) -> None:
    """Answer one of the questions that come with graspdb."""
    if show_list:
        _list()
        return
    if name is None:
        raise typer.BadParameter("give the NAME of a query, or --list", param_hint="NAME")
    from graspdb.database import Database
    from graspdb.output import write_rows
    from graspdb_queries.named import named_query

    bound = named_query(name).bind(_parameters(param or []))
    with Database(db) as database:
        write_rows(database.query(name, **bound).arrow().to_reader(), format_.value, output)


def _parameters(given: list[str]) -> dict[str, str]:
    """Return parameters from texts key=value."""
    parameters = {}
    for text in given:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise typer.BadParameter(f"{text!r} is not KEY=VALUE", param_hint="--param")
        parameters[key] = value
    return parameters


def _list() -> None:
    """Print the head of every named query."""
    from graspdb_queries.named import named_queries

    for named in named_queries().values():
        typer.echo(f"{named.name}: {named.title}")
        for parameter in named.parameters:
            default = f" (default {parameter.default})" if parameter.default is not None else ""
            must = " (must be given)" if parameter.required else default
            typer.echo(f"  --param {parameter.name}=<{parameter.kind}>  {parameter.doc}{must}")
        for column in named.columns:
            typer.echo(f"  {column.name:<18}  {column.doc}")
        if named.notes:
            typer.echo(f"  {named.notes}")
        typer.echo()
