"""``graspdb report``: a session on one page."""

import json
from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


def report(
    session: Annotated[str, typer.Argument(metavar="SESSION", help="A session of the database.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="HTML file to write, such as report.html.")
    ],
    pages: Annotated[
        bool,
        typer.Option("--pages", help="Write a page of each grasp beside it, and link it."),
    ] = False,
    db: Db = DEFAULT_DB,
    as_json: Json = False,
) -> None:
    """Write a report on a session: what was recorded, how well, what happened, where objects are touched.

    The file needs nothing from elsewhere, has no scripts, and prints well. With --pages the viewer's page of
    every grasp is written beside it: report.html links to pages in report_grasps, a few megabytes each.
    """
    from graspdb.database import Database
    from graspdb.report import write_report

    with Database(db) as database:
        written = write_report(database, session, output, pages=pages)
    if as_json:
        described = {
            "file": str(output),
            "bytes": output.stat().st_size,
            "session": written.session,
            "trials": len(written.quality.trials),
            "rejected": len(written.quality.rejected),
            "grasps": len(written.grasps),
        }
        typer.echo(json.dumps(described, indent=2))
        return
    typer.echo(
        f"Wrote {output}: {len(written.quality.trials)} trials, {len(written.quality.rejected)} rejected, "
        f"{len(written.grasps)} grasps"
    )
