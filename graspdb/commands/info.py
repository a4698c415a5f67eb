"""``graspdb info``: what a database holds."""

import json

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


def info(db: Db = DEFAULT_DB, as_json: Json = False) -> None:
    """Show what a database holds: rows and version of each table."""
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
