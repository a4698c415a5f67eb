"""Which statements only read: a query is checked as it was parsed, before it is bound or run.

DuckDB calls a statement a SELECT also where a common table expression of it writes, to tables or to any file
that may be opened; and two of its functions run a text as a statement of its own, which nobody has looked at.
"""

import re
from typing import Final

import duckdb

from graspdb_queries.explain import NOT_A_QUERY
from graspdb_schemas.errors import QueryError

_READING: Final = {"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"}
"""Nodes of a parsed statement that only read; those of INSERT, UPDATE, DELETE and COPY have other names."""

_RUN_TEXT: Final = {"query", "json_execute_serialized_sql"}
"""Functions that run a text as a statement."""

_NODE: Final = re.compile(r'"type":"(\w+_NODE)"')
_FUNCTION: Final = re.compile(r'"function_name":"((?:[^"\\]|\\.)*)"')


def read_only(cursor: duckdb.DuckDBPyConnection, text: str) -> duckdb.Statement:
    """Return the one statement that a text is, having checked that it only reads.

    Raises
    ------
    QueryError
        It is none, or several, or may do something else than read.
    duckdb.Error
        It cannot be parsed.
    """
    if not _is_utf8(text):
        raise QueryError("the query is not UTF-8 text", NOT_A_QUERY)
    parsed = cursor.extract_statements(text)
    if len(parsed) != 1:
        raise QueryError(f"found {len(parsed)} statements, and one can be answered", NOT_A_QUERY)
    kind = _kind(parsed[0])
    if kind == duckdb.StatementType.MULTI:
        raise QueryError("PIVOT has to be told its values", "Write PIVOT ... ON column IN (value, ...).")
    if kind != duckdb.StatementType.SELECT:
        raise QueryError(f"found a statement of kind {kind.name if kind else 'unknown'}", NOT_A_QUERY)
    _check_parts(cursor, text)
    return parsed[0]


def _check_parts(cursor: duckdb.DuckDBPyConnection, text: str) -> None:
    """Raise QueryError unless all parts of a statement read, and none runs a text.

    They are looked for in the text of the parsed statement as JSON: it may be nested deeper than a reader of
    JSON goes. What the asker wrote stands in it with its quotes escaped, so it is not taken for a part.
    """
    (tree,) = cursor.execute("SELECT json_serialize_sql($text)", {"text": text}).fetchall()[0]
    nodes = set(_NODE.findall(tree))
    if not nodes:
        raise QueryError("the query cannot be checked", NOT_A_QUERY)
    for node in sorted(nodes - _READING):
        kind = node.removesuffix("_NODE").removesuffix("_QUERY").replace("_", " ")
        raise QueryError(f"found a part of kind {kind}", NOT_A_QUERY)
    for name in sorted({name.lower() for name in _FUNCTION.findall(tree)} & _RUN_TEXT):
        raise QueryError(f"the function {name} runs a text as a query", "Write that query itself.")


def _kind(statement: duckdb.Statement) -> duckdb.StatementType | None:
    """Return the kind of a statement, None for one of which DuckDB's Python package has no name."""
    try:
        return duckdb.StatementType(statement.type)
    except ValueError:
        return None


def _is_utf8(text: str) -> bool:
    """Whether a text is free of lone surrogates, which stand for undecodable bytes of a command line."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
