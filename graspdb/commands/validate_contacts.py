"""``graspdb validate contacts``: contact points against measured centres of pressure."""

import json
from typing import TYPE_CHECKING, Final

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from graspdb.validation.contacts import ContactError, MeanError


ESTIMATES: Final = {"all": "all_points", "weighted": "weighted", "most distal": "most_distal"}
"""Columns and rows of the tables, and the errors that they show."""


def contacts(db: Db = DEFAULT_DB, as_json: Json = False) -> None:
    """Print the distance of each digit's contact to its measured centre of pressure: the paper's Table I.

    For trials whose manifest names reference_contacts. A digit's contact is the mean of its contact points,
    as in the paper; beside it stand the error of their mean weighted as elastic pads press, and that of the
    contact point of its most distal touching site.
    """
    from graspdb.database import Database
    from graspdb.validation.contacts import contact_errors

    with Database(db) as database:
        errors = contact_errors(database)
    if as_json:
        typer.echo(json.dumps([_plain(error) for error in errors], indent=2))
    else:
        _print(errors)


def _plain(error: "ContactError") -> dict[str, object]:
    described: dict[str, object] = {
        "subject": error.subject,
        "pair": error.pair,
        "digit": error.digit,
        "n_missed": error.n_missed,
    }
    for name in ESTIMATES.values():
        mean = getattr(error, name)
        values = (mean.mean, mean.low, mean.high)
        numbers = [None if value != value else round(1000 * value, 4) for value in values]
        described[name] = {"n": mean.n, "mean_mm": numbers[0], "low_mm": numbers[1], "high_mm": numbers[2]}
    return described


def _print(errors: "Sequence[ContactError]") -> None:
    from rich.console import Console
    from rich.table import Table

    from graspdb.validation.contacts import PAPER

    subjects = list(dict.fromkeys(error.subject for error in errors))
    pairs = sorted(
        dict.fromkeys(error.pair for error in errors),
        key=lambda pair: (pair not in PAPER, [*PAPER].index(pair) if pair in PAPER else pair),
    )
    known = {(error.subject, error.pair, error.digit): error for error in errors}
    table = Table("digits", "points", *subjects, "paper", box=None, pad_edge=False)
    for column in table.columns:
        column.no_wrap = True
    for pair in pairs:
        for title, name in ESTIMATES.items():
            cells = []
            for subject in subjects:
                found = [known.get((subject, pair, digit)) for digit in pair.split("+")]
                cells.append("/".join("-" if e is None else _mm(getattr(e, name).mean) for e in found))
            paper = "  ".join(PAPER.get(pair, ("-",))) if name == "all_points" else ""
            table.add_row(pair if name == "all_points" else "", title, *cells, paper)
    console = Console()
    console.print("Mean distance to the measured centre of pressure in mm, digit by digit\n")
    console.print(table)
    console.print("\nWith 95 % confidence intervals of the means, in mm\n", highlight=False)
    console.print(_details(errors))


def _details(errors: "Sequence[ContactError]") -> object:
    from rich.table import Table

    titles = ("subject", "digits", "digit", "n", "missed", *ESTIMATES)
    table = Table(*titles, box=None, pad_edge=False)
    for error in errors:
        table.add_row(
            error.subject,
            error.pair,
            error.digit,
            str(error.all_points.n),
            str(error.n_missed),
            *(_interval(getattr(error, name)) for name in ESTIMATES.values()),
        )
    return table


def _interval(error: "MeanError") -> str:
    return f"{_mm(error.mean)} ({_mm(error.low)} to {_mm(error.high)})"


def _mm(metres: float) -> str:
    return "-" if metres != metres else f"{1000 * metres:.1f}"
