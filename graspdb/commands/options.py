"""Options that several commands have."""

from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Db = Annotated[
    str,
    typer.Option(
        "--db", envvar="GRASPDB", metavar="DB", help="Folder of the database, or s3://bucket/folder."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write here instead of to standard output."),
]

Workers = Annotated[
    int | None,
    typer.Option(
        min=1, show_default="as many as there are cores", help="Trials that are worked on side by side."
    ),
]

AsOf = Annotated[
    str | None,
    typer.Option(
        "--as-of",
        metavar="VERSION|TIME",
        help="An earlier state: a version of graspdb info --history, or a time such as 2026-03-01T12:00.",
    ),
]

DEFAULT_DB = "grasps"


class Format(StrEnum):
    """Forms of an answer."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"


FormatOption = Annotated[Format, typer.Option("--format", help="Form of the answer.")]


def parse_as_of(text: str | None) -> int | datetime | None:
    """Return a version or a time from what a user wrote; a time without a zone is local.

    Raises
    ------
    typer.BadParameter
        It is neither.
    """
    if text is None or text.isdecimal():
        return None if text is None else int(text)
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise typer.BadParameter(
            f"{text!r} is neither a version nor a time such as 2026-03-01T12:00", param_hint="--as-of"
        ) from None
