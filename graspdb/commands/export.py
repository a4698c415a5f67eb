"""``graspdb export``: what a query selects, for trainers and other tools."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json

if TYPE_CHECKING:
    from graspdb.export.run import ExportReport, Progress


def export(
    form: Annotated[str | None, typer.Argument(metavar="FORMAT", help="Format to write; see --list.")] = None,
    out: Annotated[
        Path | None,
        typer.Argument(metavar="OUT", help="Folder to write, empty or not there yet; of duckdb the file."),
    ] = None,
    db: Db = DEFAULT_DB,
    list_formats: Annotated[bool, typer.Option("--list", help="Show all formats and exit.")] = False,
    where: Annotated[
        str | None,
        typer.Option(metavar="SQL", help="Only grasps for which this is true: \"task = 'lift'\"."),
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            metavar="BY",
            help="Sides to train and to validate, without a common subject, object, session "
            "or, with random, trial.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Decides, with its name alone, which side something is on.")] = 0,
    fps: Annotated[
        int | None,
        typer.Option(help="Frames a second of episodes; by default the lowest rate of the trials."),
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What stands for the hand: configuration (default) or sites."),
    ] = None,
    missing: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Frames without a pose: drop (default), or mask: fill and mark."),
    ] = None,
    retarget: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Configuration of dex-retargeting: adds a robot hand's joints; {side}: right or left.",
        ),
    ] = None,
    refuse_licence: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="Leave out trials with this in their licence note, such as NC."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write what a query selects: training sets for robots, and files for other tools.

    A folder holds the files, a card (README.md) with counts, features, units, licences and provenance, and
    SHA256SUMS. Where an export was interrupted, the same command goes on with it.

    duckdb writes a small file of views on the tables instead, for any DuckDB client. They show the state of
    the database at this moment, for as long as its files are not vacuumed and the folder is not moved.
    """
    from graspdb.database import Database

    if list_formats:
        typer.echo(_formats(as_json))
        return
    if form is None or out is None:
        raise typer.BadParameter("FORMAT and OUT are needed; graspdb export --list shows the formats.")
    _check(form)
    given = {"where": where, "split": split, "seed": seed, "fps": fps, "state": state, "missing": missing}
    given |= {"retarget": retarget}
    options = {name: value for name, value in given.items() if value is not None}
    with Database(db) as database, _progress_bar() as advance:
        report = database.export(form, out, refuse_licences=refuse_licence or (), progress=advance, **options)
    if form == "duckdb" and not as_json:
        place = database.path.resolve() if isinstance(database.path, Path) else database.path
        typer.echo(f"Wrote {out}: views on {place}")
        return
    typer.echo(json.dumps(_plain(report), indent=2) if as_json else _summary(report))


def _check(form: str) -> None:
    """Raise BadParameter unless there is such a format."""
    from graspdb.export.registry import writers
    from graspdb_schemas.errors import nearest

    names = ["duckdb", *writers()]
    if form not in names:
        raise typer.BadParameter(
            f"{form!r} is not one of {', '.join(names)}{nearest(form, names)}", param_hint="FORMAT"
        )


@contextmanager
def _progress_bar() -> "Iterator[Progress]":
    """Show a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        bar = bars.add_task("exporting", total=None)
        yield lambda done, total: bars.update(bar, total=total, completed=done)


def _summary(report: "ExportReport") -> str:
    """Return what became of an export, one line for it, each side of the split, and each thing left out."""
    lines = [f"Wrote {report.path}: {_counted(report.counts)}"]
    lines += [f"  {side}: {_counted(counts)}" for side, counts in report.splits.items()]
    lines += [f"  left out: {number:,} {reason}" for reason, number in report.left_out.items()]
    return "\n".join(lines)


def _counted(counts: dict[str, int]) -> str:
    return ", ".join(f"{number:,} {name}" for name, number in counts.items())


def _plain(report: "ExportReport") -> dict[str, Any]:
    """Return a report as plain values, for JSON."""
    from dataclasses import asdict

    return {**asdict(report), "path": str(report.path)}


def _formats(as_json: bool) -> str:
    """Return all formats, as JSON or to be read."""
    from graspdb.export.registry import writers

    titles = {"duckdb": "DuckDB file of views on the tables"}
    titles |= {name: writer.format.title for name, writer in writers().items()}
    if as_json:
        return json.dumps([{"name": name, "title": title} for name, title in titles.items()], indent=2)
    return "\n".join(f"{name:<12} {title}" for name, title in titles.items())
