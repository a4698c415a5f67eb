"""``graspdb info``: what a database holds."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


def info(
    db: Db = DEFAULT_DB,
    history: Annotated[
        bool, typer.Option("--history", help="Show its versions instead, the latest first.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Show what a database holds: rows and version of each table."""
    if history:
        _history(db, as_json)
        return
    from graspdb.database import Database

    with Database(db) as database:
        found = database.info()
    if as_json:
        described = {
            "path": str(found.path),
            "format": found.format,
            "rows": dict(found.rows),
            "versions": dict(found.versions),
            "rejected": found.rejected,
            "several_versions": list(found.several_versions),
        }
        typer.echo(json.dumps(described, indent=2))
        return
    typer.echo(f"{found.path}: graspdb format {found.format}")
    for name, count in found.rows.items():
        typer.echo(f"  {name:<14}{count:>12,} rows    version {found.versions[name]}")
    if found.rejected:
        typer.echo(f"{found.rejected} of {found.rows['trials']} trials rejected; their reasons:")
        typer.echo("  graspdb sql \"SELECT trial, reasons FROM trials WHERE status = 'rejected'\"")
    for name in found.several_versions:
        typer.echo(f"Some trials stand on an older version of {name}: ingest its session again.")


def _history(db: str, as_json: bool) -> None:
    """Print the versions of a database."""
    from graspdb.store.history import read_history
    from graspdb.store.location import location

    changes = read_history(location(db))
    if as_json:
        typer.echo(json.dumps([asdict(change) for change in changes], indent=2, default=str))
        return
    for change in changes:
        counts = {"added": change.added, "replaced": change.replaced, "removed": change.removed}
        told = ", ".join(f"{count} trials {what}" for what, count in counts.items() if count)
        moment = change.time.astimezone().isoformat(sep=" ", timespec="milliseconds")
        typer.echo(f"{change.version:>7}  {moment}  {change.action:<9} {told}".rstrip())
    typer.echo("Read a state with: graspdb sql --as-of VERSION 'SELECT ...'")
