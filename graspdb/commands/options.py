"""Options that several commands have."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Db = Annotated[Path, typer.Option("--db", envvar="GRASPDB", metavar="DIR", help="Folder of the database.")]
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

DEFAULT_DB = Path("grasps")


class Format(StrEnum):
    """Forms of an answer."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"


FormatOption = Annotated[Format, typer.Option("--format", help="Form of the answer.")]
