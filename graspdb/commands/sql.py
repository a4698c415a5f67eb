"""``graspdb sql``: answer a SELECT statement."""

from typing import Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, AsOf, Db, Format, FormatOption, Output, parse_as_of


def sql(
    statement: Annotated[str, typer.Argument(metavar="SELECT", help="One SELECT statement of DuckDB's SQL.")],
    db: Db = DEFAULT_DB,
    as_of: AsOf = None,
    format_: FormatOption = Format.TABLE,
    output: Output = None,
) -> None:
    """Answer a SELECT statement over the tables of a database.

    It reads one consistent state of the database, and no file outside of it. "graspdb schema" lists the
    tables and columns.
    """
    from graspdb.database import Database
    from graspdb.output import write_rows

    with Database(db, as_of=parse_as_of(as_of)) as database, database.stream(statement) as rows:
        write_rows(rows, format_.value, output)
