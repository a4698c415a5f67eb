"""Named queries: one file of SQL each, whose head says what it answers, with what, and in which columns.

The head of ``sql/<name>.sql`` is a comment::

    -- What it answers?
    --
    -- Parameters:
    --   name  kind = default    what it does
    --
    -- Columns:
    --   name  what it holds
    --
    -- Anything else to know.

A kind is text, integer, number or boolean; a parameter without a default must be given.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final

from graspdb_schemas.errors import ParameterError, nearest

_BOOLEANS: Final = {"true": True, "false": False, "yes": True, "no": False}
_PARAMETER: Final = re.compile(r"(\w+)\s+(text|integer|number|boolean)(?:\s*=\s*(\S+))?\s+(.+)")
_COLUMN: Final = re.compile(r"(\w+)\s+(.+)")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a named query.

    Attributes
    ----------
    name, kind, doc : str
        Its name; text, integer, number or boolean; what it does.
    default : value or None
        Used where it is not given.
    required : bool
        Whether it has to be given.
    """

    name: str
    kind: str
    doc: str
    default: Any = None
    required: bool = False

    def value(self, given: Any) -> Any:
        """Return a value of the parameter's kind; texts are read as the command line gives them.

        Raises
        ------
        ParameterError
            The value is not of this kind.
        """
        if given is None:
            return None
        try:
            if self.kind == "text":
                return str(given)
            if self.kind == "boolean":
                return given if isinstance(given, bool) else _BOOLEANS[str(given).lower()]
            return int(str(given)) if self.kind == "integer" else float(given)
        except (KeyError, TypeError, ValueError):
            raise ParameterError(f"parameter {self.name}", given, f"a value of kind {self.kind}") from None


@dataclass(frozen=True)
class Column:
    """A column of an answer: its name and what it holds."""

    name: str
    doc: str


@dataclass(frozen=True)
class NamedQuery:
    """A query that has a name.

    Attributes
    ----------
    name : str
        Name of its file.
    title : str
        The question that it answers.
    parameters : tuple of Parameter
        What may be given.
    columns : tuple of Column
        What comes out.
    notes : str
        What else there is to know.
    sql : str
        The statement.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]
    notes: str
    sql: str

    def bind(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return a value for every parameter.

        Raises
        ------
        ParameterError
            A parameter is unknown, missing or of the wrong kind.
        """
        known = {parameter.name: parameter for parameter in self.parameters}
        for name in given:
            if name not in known:
                allowed = ", ".join(known) or "none"
                raise ParameterError(f"parameter of {self.name}", name, allowed + nearest(name, list(known)))
        for parameter in self.parameters:
            if parameter.required and parameter.name not in given:
                raise ParameterError(f"parameter {parameter.name}", "no value", parameter.doc)
        return {name: known[name].value(given.get(name, known[name].default)) for name in known}


def parse_query(name: str, text: str) -> NamedQuery:
    """Return the named query that a file of SQL holds.

    Raises
    ------
    ValueError
        The head is not as this module's documentation says.
    """
    lines = text.splitlines()
    n_head = next((i for i, line in enumerate(lines) if not line.startswith("--")), len(lines))
    paragraphs = "\n".join(line[2:].removeprefix(" ").rstrip() for line in lines[:n_head]).split("\n\n")
    title, parameters, columns, notes = paragraphs[0].replace("\n", " "), [], [], []
    for paragraph in paragraphs[1:]:
        heading, *entries = paragraph.splitlines()
        if heading == "Parameters:":
            parameters = [_parameter(name, entry) for entry in entries]
        elif heading == "Columns:":
            columns = [Column(*_match(name, _COLUMN, entry)) for entry in entries]
        else:
            notes.append(paragraph.replace("\n", " "))
    if not title or not columns:
        raise ValueError(f"{name}.sql: its head lacks a title or its columns")
    sql = "\n".join(lines[n_head:]).strip()
    return NamedQuery(name, title, tuple(parameters), tuple(columns), "\n\n".join(notes), sql)


@cache
def named_queries() -> Mapping[str, NamedQuery]:
    """Return the queries that come with graspdb, by name."""
    return {query.name: query for query in sorted(_read(), key=lambda query: query.name)}


def named_query(name: str) -> NamedQuery:
    """Return one of the queries that come with graspdb.

    Raises
    ------
    ParameterError
        There is none of this name.
    """
    queries = named_queries()
    if name not in queries:
        raise ParameterError("query", name, ", ".join(queries) + nearest(name, list(queries)))
    return queries[name]


def _read() -> Iterator[NamedQuery]:
    for file in (resources.files("graspdb_queries") / "sql").iterdir():
        if file.name.endswith(".sql"):
            yield parse_query(file.name.removesuffix(".sql"), file.read_text(encoding="utf-8"))


def _match(name: str, pattern: re.Pattern[str], entry: str) -> tuple[str, ...]:
    match = pattern.fullmatch(entry.strip())
    if match is None:
        raise ValueError(f"{name}.sql: cannot read the line {entry!r} of its head")
    return match.groups()


def _parameter(name: str, entry: str) -> Parameter:
    parameter, kind, default, doc = _match(name, _PARAMETER, entry)
    bare = Parameter(parameter, kind, doc, required=default is None)
    if default in (None, "null"):
        return bare
    return Parameter(parameter, kind, doc, default=bare.value(default))
