"""``graspdb verify``: whether a database is whole."""

import json
from dataclasses import asdict

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


def verify(db: Db = DEFAULT_DB, as_json: Json = False) -> None:
    """Read a whole database and check files, hashes, formats and references between its tables.

    The exit status is 1 if something is wrong.
    """
    from graspdb.maintenance import verify

    found = verify(db)
    if as_json:
        tables = {name: asdict(table) for name, table in found.tables.items()}
        typer.echo(json.dumps({"path": str(found.path), "whole": found.whole, "tables": tables}, indent=2))
    else:
        for name, table in found.tables.items():
            dead = f", {table.dead_rows:,} dead" if table.dead_rows else ""
            typer.echo(f"{name:<20}{table.rows:>12,} rows in {table.files:,} files{dead}")
            for problem in table.problems:
                typer.echo(f"    {problem}")
        typer.echo(f"{found.path}: " + ("whole" if found.whole else "not whole; restore it from a copy"))
    if not found.whole:
        raise typer.Exit(1)
