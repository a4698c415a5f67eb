"""`graspdb check`: read a whole session, report, write nothing."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from graspdb_ingest.check import SessionReport, TrialReport
    from graspdb_ingest.check_objects import ObjectReport


def check(
    session: Annotated[Path, typer.Argument(help="The session's folder, or its session.yaml.", exists=True)],
    data_root: Annotated[
        Path | None,
        typer.Option(help="Folder of recordings kept elsewhere.", exists=True, file_okay=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Read every recording and object of a session and report what is in them; write nothing.

    Of recordings that is frames, markers, gaps and rigidity. The exit status is 1 if the manifest has
    problems, or a recording, an object or a hand model cannot be used.
    """
    from rich.console import Console

    from graspdb_ingest.check import check_session
    from graspdb_schemas.errors import GraspDBError

    try:
        report = check_session(session, data_root)
    except GraspDBError as error:
        Console(stderr=True).print(str(error), markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(1) from error
    if as_json:
        import json

        typer.echo(json.dumps(as_plain(report), indent=2))
    else:
        _print_report(report, Console())
    if not report.readable:
        raise typer.Exit(1)


def as_plain(report: "SessionReport") -> dict[str, Any]:
    """Return a report as tables, lists, texts and numbers; what is not a number is None."""
    from dataclasses import asdict

    plain: dict[str, Any] = _plain(asdict(report))
    return plain | {"readable": report.readable}


def _plain(value: Any) -> Any:
    match value:
        case dict():
            return {key: _plain(item) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case float():
            return value if value == value and abs(value) != float("inf") else None
        case Path():
            return str(value)
        case _:
            return value


def _print_report(report: "SessionReport", console: "Console") -> None:
    from rich.markup import escape

    console.print(f"[bold]{escape(report.id)}[/bold]  {escape(str(report.path))}", soft_wrap=True)
    for kind, trials in (("trial", report.trials), ("calibration", report.calibrations)):
        for trial in trials:
            _print_trial(kind, trial, console)
    for thing in report.objects:
        _print_object(thing, console)
    for problem in report.hands:
        console.print(f"\n{problem}", markup=False, highlight=False, soft_wrap=True)
    recordings = (*report.trials, *report.calibrations)
    bad = [trial.name for trial in recordings if trial.problem]
    warned = sum(bool(trial.warnings) for trial in recordings)
    console.print(
        f"\n{len(recordings)} recordings, {len(bad)} unreadable, {warned} with warnings; "
        f"{len(report.objects)} objects, {sum(bool(thing.problem) for thing in report.objects)} unusable",
        highlight=False,
    )


def _print_trial(kind: str, trial: "TrialReport", console: "Console") -> None:
    from rich.markup import escape

    about = f"{kind} [bold]{escape(trial.name)}[/bold]  subject {escape(trial.subject)}"
    if trial.object:
        about += f", object {escape(trial.object)}"
    console.print(f"\n{about}", highlight=False, soft_wrap=True)
    if trial.problem:
        console.print(f"  cannot be read: {trial.problem}", markup=False, highlight=False, soft_wrap=True)
        return
    console.print(
        f"  {trial.n_frames} frames at {trial.rate:g} Hz, {trial.duration:.2f} s; "
        f"{len(trial.markers)} markers found, {len(trial.not_found)} not found",
        highlight=False,
    )
    for title, labels in (("not found", trial.not_found), ("not used", trial.unused)):
        if labels:
            console.print(f"  {title}: {', '.join(labels)}", markup=False, highlight=False, soft_wrap=True)
    console.print(_marker_table(trial))
    if trial.distances:
        console.print(_distance_table(trial))
    for warning in trial.warnings:
        console.print(f"  warning: {warning}", markup=False, highlight=False, soft_wrap=True)


def _print_object(thing: "ObjectReport", console: "Console") -> None:
    from rich.markup import escape

    console.print(
        f"\nobject [bold]{escape(thing.name)}[/bold]  {escape(thing.file)}", highlight=False, soft_wrap=True
    )
    if thing.problem:
        console.print(f"  cannot be used: {thing.problem}", markup=False, highlight=False, soft_wrap=True)
        return
    kind = f"{thing.n_faces} triangles, {'' if thing.watertight else 'not '}watertight"
    size = " x ".join(f"{1000 * extent:.1f}" for extent in thing.extents)
    console.print(f"  {kind if thing.n_faces else f'{thing.n_vertices} points'}; {size} mm", highlight=False)
    for warning in thing.warnings:
        console.print(f"  warning: {warning}", markup=False, highlight=False, soft_wrap=True)


def _marker_table(trial: "TrialReport") -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table("marker", "missing", "longest gap", box=None, pad_edge=True)
    for column in table.columns[1:]:
        column.justify = "right"
    for marker in trial.markers:
        table.add_row(escape(marker.label), f"{100 * marker.missing:.1f} %", f"{marker.longest_gap:.2f} s")
    return table


def _distance_table(trial: "TrialReport") -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table("distance", "mean", "sd", "model", "difference", box=None, pad_edge=True)
    for column in table.columns[1:]:
        column.justify = "right"
    for entry in trial.distances:
        lengths = (entry.mean, entry.sd, entry.model, entry.difference)
        cells = [f"{1000 * length:.2f} mm" if length == length else "-" for length in lengths]
        table.add_row(f"{escape(entry.first)} - {escape(entry.second)}", *cells)
    return table
