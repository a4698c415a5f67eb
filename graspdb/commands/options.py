"""Options that several commands have."""

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

DEFAULT_DB = "grasps"


class Format(StrEnum):
    """Forms of an answer."""

    TABLE = "table"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"


FormatOption = Annotated[Format, typer.Option("--format", help="Form of the answer.")]
