"""``graspdb import``: public hand-object data sets into a database."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from graspdb.commands.ingest import plain, progress_bar, summary
from graspdb.commands.options import DEFAULT_DB, Db, Json, Workers

if TYPE_CHECKING:
    from graspdb.ingestion import IngestReport


def import_(
    form: Annotated[
        str | None, typer.Argument(metavar="FORMAT", help="Format of the data set; see --list.")
    ] = None,
    path: Annotated[
        Path | None, typer.Argument(metavar="PATH", help="Folder of the data set, or a file of it.")
    ] = None,
    db: Db = DEFAULT_DB,
    list_formats: Annotated[bool, typer.Option("--list", help="Show all formats and exit.")] = False,
    session: Annotated[
        str | None, typer.Option(help="Session that the clips become trials of; by default the format.")
    ] = None,
    units: Annotated[
        str | None,
        typer.Option(metavar="UNIT", help="Unit where files do not say it: m, dm, cm, mm."),
    ] = None,
    order: Annotated[
        str | None, typer.Option(help="Order of key points: usual, openpose, mano, or 21 names with commas.")
    ] = None,
    side: Annotated[
        str | None, typer.Option(metavar="HAND", help="right or left, where files do not say it.")
    ] = None,
    subject: Annotated[str | None, typer.Option(help="Whose hands, where files do not say it.")] = None,
    rate: Annotated[float | None, typer.Option(help="Frames per second, where files do not say it.")] = None,
    objects: Annotated[
        Path | None, typer.Option(help="Folder of the objects' meshes, or the one mesh.")
    ] = None,
    mano: Annotated[Path | None, typer.Option(help="Folder or file of the MANO hand model.")] = None,
    licence: Annotated[
        str | None, typer.Option(metavar="NOTE", help="Licence note of the data, kept with every trial.")
    ] = None,
    fit: Annotated[
        bool, typer.Option("--fit", help="Fit the hand model to the key points, for joint angles.")
    ] = False,
    workers: Workers = None,
    force: Annotated[bool, typer.Option("--force", help="Import unchanged clips too.")] = False,
    surface: Annotated[
        str, typer.Option(metavar="NAME", help="Surface of the hand: spheres, capsules or skin.")
    ] = "spheres",
    as_json: Json = False,
) -> None:
    """Turn a public data set, or key points of your own, into rows beside those of recordings.

    Unchanged clips are skipped. One that cannot be used is stored as rejected, with its reasons, and the
    exit status is 1.
    """
    from graspdb.importing import import_data_set
    from graspdb_ingest.importers.base import ImportOptions
    from graspdb_ingest.parameters import ContactParameters, IngestParameters
    from graspdb_schemas.errors import ParameterError
    from graspdb_schemas.vocabulary import Side

    if list_formats:
        typer.echo(_formats(as_json))
        return
    if form is None or path is None:
        raise typer.BadParameter("FORMAT and PATH are needed; graspdb import --list shows the formats.")
    if side is not None and side not in tuple(Side):
        raise ParameterError("side", side, "right or left")
    options = ImportOptions(
        session=session,
        units=units,
        order=order,
        side=None if side is None else Side(side),
        subject=subject,
        rate=rate,
        objects=objects,
        mano=mano,
        licence=licence,
    )
    with progress_bar(f"{path}: looking") as advance:
        report = import_data_set(
            form,
            path,
            db,
            options=options,
            fit=fit,
            workers=workers,
            force=force,
            parameters=IngestParameters(contact=ContactParameters(surface=surface)),
            progress=advance,
        )
    told = "\n".join([summary(report), *_notes(report)])
    typer.echo(json.dumps(plain(report), indent=2) if as_json else told)
    if report.rejected:
        raise typer.Exit(1)


def _notes(report: "IngestReport") -> Iterator[str]:
    """Yield what to know of the clips, each thing once with the first clip that it is said of."""
    trials: dict[str, list[str]] = {}
    for trial in report.trials:
        for note in trial.reasons if trial.status == "ok" else ():
            trials.setdefault(note, []).append(trial.trial)
    for note, said_of in trials.items():
        others = f" and {len(said_of) - 1} more" if len(said_of) > 1 else ""
        yield f"  note on {said_of[0]}{others}: {note}"


def _formats(as_json: bool) -> str:
    """Return all formats, as JSON or to be read."""
    from dataclasses import asdict

    from graspdb_ingest.importers.registry import IMPORTERS

    formats = [entry.format for entry in IMPORTERS.values()]
    if as_json:
        return json.dumps([asdict(form) for form in formats], indent=2)
    return "\n\n".join(
        f"{form.name}: {form.title}, version {form.version}\n"
        f"  licence: {form.licence or 'as you say with --licence'}\n"
        + "".join(f"  needs: {need}\n" for need in form.needs)
        + f"  documentation: {form.documentation}"
        for form in formats
    )
