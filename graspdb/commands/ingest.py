"""``graspdb ingest``: sessions into a database."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json, Workers

if TYPE_CHECKING:
    from graspdb.ingestion import IngestReport, Progress, TrialReport


def ingest(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION...", help="Folders of sessions, or their manifests.")
    ],
    db: Db = DEFAULT_DB,
    workers: Workers = None,
    engine: Annotated[
        str,
        typer.Option(metavar="ENGINE", help="local: processes of this machine; ray: a Ray cluster."),
    ] = "local",
    data_root: Annotated[
        Path | None, typer.Option(help="Folder of the manifest's files, if not the session's own.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Ingest unchanged trials too.")] = False,
    surface: Annotated[
        str, typer.Option(metavar="NAME", help="Surface of the hand: spheres, capsules or skin.")
    ] = "spheres",
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Say for each trial what would be done and why; write nothing."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Turn sessions into rows: track, find contacts and features, commit as trials are done.

    Unchanged trials are skipped. A trial that cannot be used is stored as rejected, with its
    reasons, and the exit status is 1.
    """
    if explain:
        _explain(sessions, db, data_root, force, surface, as_json)
        return
    reports = [
        run_with_progress(
            session, db, workers=workers, engine=engine, data_root=data_root, force=force, surface=surface
        )
        for session in sessions
    ]
    if as_json:
        typer.echo(json.dumps([plain(report) for report in reports], indent=2))
    else:
        for report in reports:
            typer.echo(summary(report))
    if any(report.rejected for report in reports):
        raise typer.Exit(1)


def _explain(
    sessions: list[Path], db: str, data_root: Path | None, force: bool, surface: str, as_json: bool
) -> None:
    """Print what would be done with each trial, and why."""
    from graspdb.explaining import explain_ingest
    from graspdb_ingest.parameters import ContactParameters, IngestParameters

    parameters = IngestParameters(contact=ContactParameters(surface=surface))
    plans = [
        plan
        for session in sessions
        for plan in explain_ingest(session, db, data_root=data_root, force=force, parameters=parameters)
    ]
    if as_json:
        typer.echo(json.dumps([asdict(plan) for plan in plans], indent=2))
        return
    for plan in plans:
        typer.echo(f"{plan.action:<5} {plan.trial}")
        for reason in plan.reasons:
            typer.echo(f"        {reason}")
    counts = {
        action: sum(plan.action == action for plan in plans)
        for action in dict.fromkeys(p.action for p in plans)
    }
    typer.echo(
        f"{len(plans)} trials: " + (", ".join(f"{n} to {action}" for action, n in counts.items()) or "none")
    )


def run_with_progress(
    session: Path,
    db: str,
    *,
    workers: int | None,
    engine: str = "local",
    data_root: Path | None = None,
    force: bool = False,
    surface: str = "spheres",
) -> "IngestReport":
    """Ingest a session with a progress bar on standard error."""
    from graspdb.ingestion import ingest
    from graspdb_ingest.parameters import ContactParameters, IngestParameters
    from graspdb_ingest.tracking.following import is_compiled

    first = "preparing" if is_compiled() else "compiling for this machine, once (about a minute)"
    with progress_bar(f"{session}: {first}") as advance:
        return ingest(
            session,
            db,
            workers=workers,
            engine=engine,
            data_root=data_root,
            force=force,
            parameters=IngestParameters(contact=ContactParameters(surface=surface)),
            progress=advance,
        )


@contextmanager
def progress_bar(beginning: str) -> "Iterator[Progress]":
    """Show trials done, their rate and the time left on standard error, and a text until the first is done.

    Where Ctrl-C ends it, it says how many trials are safe.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    start = time.monotonic()
    with Bars(*columns, console=console, transient=True) as bars:
        bar = bars.add_task(beginning, total=None, rate="")

        def advance(report: "TrialReport", total: int) -> None:
            a_minute = 60 * (bars.tasks[0].completed + 1) / (time.monotonic() - start)
            bars.update(
                bar, total=total, advance=1, description=report.trial, rate=f"{a_minute:.3g} trials/min"
            )

        try:
            yield advance
        except KeyboardInterrupt:
            done, total = int(bars.tasks[0].completed), bars.tasks[0].total
            counted = f"{done} of {int(total)} trials" if total else "no trial"
            bars.stop()
            console.print(
                f"interrupted: {counted} committed, and safe; run again to do the rest", highlight=False
            )
            raise


def summary(report: "IngestReport") -> str:
    """Return what became of a session, one line for it and one for each rejected trial."""
    outcomes = [str(trial.outcome) for trial in report.trials]
    counts = ", ".join(f"{outcomes.count(o)} {o}" for o in dict.fromkeys(outcomes))
    grasps = sum(trial.n_grasps or 0 for trial in report.trials)
    lines = [f"{report.session}: {len(report.trials)} trials ({counts or 'none'}), {grasps} new grasps"]
    lines.extend(f"  rejected {trial.trial}: {'; '.join(trial.reasons)}" for trial in report.rejected)
    return "\n".join(lines)


def plain(report: "IngestReport") -> dict[str, object]:
    """Return a report as plain values, for JSON."""
    return {**asdict(report), "db": str(report.db)}
