"""Errors of the SQL engine, said so that the asker can mend the query."""

import re
from typing import Final

from graspdb_queries.joins import views
from graspdb_schemas.errors import QueryError, nearest
from graspdb_schemas.tables import TABLES

_PREFIX: Final = re.compile(r"^(?:[A-Z][\w-]*(?: [A-Z][\w-]*)* Error|Error): ")
_TABLE: Final = re.compile(r"Table with name (.+?) does not exist|Referenced table \"(.+?)\" not found")
_COLUMN: Final = re.compile(r"Referenced column \"(.+?)\" not found|not have a column named \"(.+?)\"")
_SUGGESTION: Final = re.compile(r"^(Did you mean|Candidate |Use \"SET )")
_REFUSED: Final = re.compile(
    r"file system operations are disabled|disabled (?:by|through) configuration|configuration has been locked"
)

NOT_A_QUERY: Final = "SQL here only reads: one SELECT statement (or WITH, FROM, VALUES, DESCRIBE, SHOW)."


def query_error(message: str, statement: str = "") -> QueryError:
    """Return the error to raise for a message of DuckDB.

    Parameters
    ----------
    message : str
        What DuckDB says.
    statement : str
        The query; a misspelt column is looked for in the tables that it names.
    """
    lines = [line for line in message.strip().splitlines() if line.strip()]
    found = _PREFIX.sub("", lines[0]) if lines else "the query failed"
    shown = "\n".join([found, *(line for line in lines[1:] if not _SUGGESTION.match(line))])
    if _REFUSED.search(message):
        return QueryError(shown, "A query reads the tables of the database, and nothing outside of it.")
    if match := _TABLE.search(message):
        name = next(filter(None, match.groups()))
        names = [*TABLES, *views()]
        return QueryError(shown, f"The tables are {', '.join(names)}{nearest(name, names)}")
    if match := _COLUMN.search(message):
        name = next(filter(None, match.groups()))
        schemas = {**TABLES, **{view.name: view.schema for view in views().values()}}
        named = [table for table in schemas if re.search(rf"\b{table}\b", statement, re.IGNORECASE)]
        columns = sorted({column for table in named or schemas for column in schemas[table].names})
        listed = f"Columns of {', '.join(named)}: {', '.join(columns)}" if named else "No table has it"
        return QueryError(shown, f"{listed}{nearest(name, columns)}")
    suggestion = next((line for line in lines[1:] if line.startswith("Did you mean")), None)
    return QueryError(shown, suggestion or "graspdb schema lists tables and columns.")
