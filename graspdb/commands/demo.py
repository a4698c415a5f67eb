"""``graspdb demo``: the whole way from a simulated session to answers."""

from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import Workers

GRASPS = """
    SELECT object, subject, count(*) AS grasps, round(avg(n_contacts), 1) AS contacts,
           round(avg(1000 * grip_aperture), 0) AS aperture_mm,
           round(avg(1e6 * hull_volume), 0) AS hull_cm3, round(avg(1e4 * feature_area), 0) AS feature_cm2
    FROM grasps GROUP BY object, subject ORDER BY object, subject
"""


def demo(
    directory: Annotated[
        Path, typer.Argument(metavar="[DIR]", help="Folder for session and database; empty or absent.")
    ] = Path("demo"),
    workers: Workers = None,
) -> None:
    """Simulate a session, ingest it, and show what came out.

    A session that is there from an earlier demo is used again.
    """
    import graspdb
    from graspdb.commands.ingest import run_with_progress, summary
    from graspdb.output import write_rows
    from graspdb.simulate import simulate_session
    from graspdb.simulate.accuracy import measure_accuracy
    from graspdb.simulate.accuracy import summary as figures

    session, db = directory / "session", directory / "grasps"
    if not (session / "session.yaml").exists():
        typer.echo(f"Simulating three people grasping a bottle, a mug and a milk jug into {session} ...")
        simulate_session(session, subjects=3, trials=1, seed=0)
    typer.echo(f"Ingesting it into {db} ...")
    report = run_with_progress(session, str(db), workers=workers)
    typer.echo(summary(report))
    with graspdb.open(db) as database:
        typer.echo("\nGrasps by object and subject:")
        with database.stream(GRASPS) as rows:
            write_rows(rows, "table", None)
        typer.echo("\nAgainst the truth that made the recordings:")
        for name, value in figures(measure_accuracy(session, database)).items():
            typer.echo(f"  {name:<28}{value}")
    typer.echo(
        "\nTry next:\n"
        f"  graspdb info --db {db}\n"
        f"  graspdb query contact_frequency --db {db}\n"
        f"  graspdb sql \"SELECT grasp, digits FROM grasps WHERE object = 'mug'\" --db {db}\n"
        f"  graspdb check {session}"
    )
    if report.rejected:
        raise typer.Exit(1)
