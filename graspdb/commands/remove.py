"""``graspdb remove``: trials, sessions and subjects out of a database."""

import json
from dataclasses import asdict
from enum import StrEnum
from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json


class KindName(StrEnum):
    """What can be taken out of a database."""

    TRIAL = "trial"
    SESSION = "session"
    SUBJECT = "subject"


def remove(
    kind: Annotated[KindName, typer.Argument(help="What the keys name.")],
    keys: Annotated[
        list[str],
        typer.Argument(metavar="KEY...", help="SESSION/TRIAL, SESSION/SUBJECT, or SESSION."),
    ],
    db: Db = DEFAULT_DB,
    as_json: Json = False,
) -> None:
    """Take trials, whole sessions or all trials of a subject out of a database, in one step.

    Their bytes stay in earlier states until "graspdb optimize" deletes these; with "--retention 0" it leaves
    none. The sessions' own folders are not touched.
    """
    from graspdb.maintenance import remove

    removed = remove(db, kind.value, keys)
    if as_json:
        typer.echo(json.dumps(asdict(removed), indent=2))
        return
    for trial in removed.trials:
        typer.echo(f"removed {trial}")
    typer.echo(f"{len(removed.trials)} trials removed; earlier states still have them, until")
    typer.echo(f"  graspdb optimize --db {db} --retention 0")
    typer.echo("Take them out of session.yaml too, or the next ingest of their session brings them back.")
