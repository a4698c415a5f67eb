"""``graspdb validate markers``: hidden markers against their prediction from the others."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from graspdb.commands.options import Json, Output

if TYPE_CHECKING:
    from collections.abc import Sequence

    from graspdb.validation.markers import MarkerError


def markers(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of a session, or its manifest.")],
    hold_out: Annotated[
        float, typer.Option(metavar="SECONDS", help="How long markers are hidden [s].")
    ] = 0.5,
    gaps: Annotated[int, typer.Option(min=1, help="Random gaps for each marker of a hand.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="The same seed hides the same gaps.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes that work side by side.")] = 1,
    data_root: Annotated[
        Path | None, typer.Option(help="Folder of the manifest's files, if not the session's own.")
    ] = None,
    as_json: Json = False,
    output: Output = None,
) -> None:
    """Hide each marker in random gaps, predict it from the rest, and print the error of each marker.

    The tracker is the one that ingest uses. The gaps are hidden from the hand's calibration and
    posture prior too, so the error is that of a marker which the session never showed there.
    """
    from rich.console import Console
    from rich.progress import Progress

    from graspdb.validation.markers import held_out_errors

    with Progress(console=Console(stderr=True), transient=True) as bars:
        bar = bars.add_task(f"{session}: hiding markers", total=None)
        errors = held_out_errors(
            session,
            seconds=hold_out,
            gaps=gaps,
            seed=seed,
            workers=workers,
            data_root=data_root,
            progress=lambda total: bars.update(bar, total=total, advance=1),
        )
    plain = {
        "session": str(session),
        "hold_out_s": hold_out,
        "gaps": gaps,
        "seed": seed,
        "markers": [_plain(e) for e in errors],
    }
    text = json.dumps(plain, indent=2)
    if output is not None:
        output.write_text(text + "\n", encoding="utf-8")
    if as_json:
        typer.echo(text)
    elif output is None:
        _print(errors, hold_out)


def _plain(error: "MarkerError") -> dict[str, object]:
    figures = {"mean_mm": error.mean, "median_mm": error.median, "worst_mm": error.worst}
    return {
        "subject": error.subject,
        "side": str(error.side),
        "marker": error.marker,
        "n_gaps": error.n_gaps,
        "n_lost": error.n_lost,
        **{name: None if value != value else round(1e3 * value, 4) for name, value in figures.items()},
    }


def _print(errors: "Sequence[MarkerError]", seconds: float) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(
        title=f"error of hidden markers, gaps of {seconds:g} s [mm]", title_justify="left", box=None
    )
    for column in ("subject", "hand", "marker"):
        table.add_column(column)
    for column in ("gaps", "mean", "median", "worst"):
        table.add_column(column, justify="right")
    for e in errors:
        figures = ("" if v != v else f"{1e3 * v:.2f}" for v in (e.mean, e.median, e.worst))
        table.add_row(e.subject, str(e.side), e.marker, str(e.n_gaps), *figures)
    Console().print(table)
    known = [e.mean for e in errors if e.mean == e.mean]
    lost = sum(e.n_lost for e in errors)
    if known:
        typer.echo(f"mean over {len(known)} markers: {1e3 * sum(known) / len(known):.2f} mm")
    if lost:
        typer.echo(f"the hand was lost in {lost} gaps, which the means leave out")
