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
    -- Computed by: module.function
    --
    -- Example: name=value name=value
    --
    -- Anything else to know.

A kind is text, integer, number, boolean, or the allowed words with | between them; a parameter without a
default must be given. Where a head says by what the answer is computed, the rows of the SQL go through that
function of graspdb_queries, and the columns are those of what it returns. The example is shown in the docs.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module, resources
from typing import TYPE_CHECKING, Any, Final

from graspdb_schemas.errors import ParameterError, nearest

if TYPE_CHECKING:
    from graspdb_queries.engine import Engine
    from graspdb_queries.result import Result

_BOOLEANS: Final = {"true": True, "false": False, "yes": True, "no": False}
_PARAMETER: Final = re.compile(r"(\w+)\s+(text|integer|number|boolean|\w+(?:\|\w+)+)(?:\s*=\s*(\S+))?\s+(.+)")
_COLUMN: Final = re.compile(r"(\w+)\s+(.+)")
_COMPUTED: Final = "Computed by: "
_EXAMPLE: Final = "Example: "


@dataclass(frozen=True)
class Parameter:
    """A parameter of a named query.

    Attributes
    ----------
    name, kind, doc : str
        Its name; text, integer, number, boolean or words with | between them; what it does.
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
            if self.required:
                raise ParameterError(f"parameter {self.name}", "no value", self.doc)
            return None
        if "|" in self.kind:
            words = self.kind.split("|")
            if given not in words:
                raise ParameterError(
                    f"parameter {self.name}", given, ", ".join(words) + nearest(str(given), words)
                )
            return given
        try:
            if self.kind == "text":
                return str(given)
            if self.kind == "boolean":
                return given if isinstance(given, bool) else _BOOLEANS[str(given).lower()]
            if self.kind == "integer":
                return int(str(given))
            number = float(given)
            if math.isnan(number):
                raise ValueError
            return number
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
    computed_by : str
        ``module.function`` of graspdb_queries that the statement's rows go through; empty if none.
    example : tuple of (str, str)
        Parameters of the example in the docs.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]
    notes: str
    sql: str
    computed_by: str = ""
    example: tuple[tuple[str, str], ...] = ()

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
        return {name: known[name].value(given.get(name, known[name].default)) for name in known}

    def run(self, engine: "Engine", given: Mapping[str, Any]) -> "Result":
        """Return the answer.

        Raises
        ------
        ParameterError
            A parameter is unknown, missing, of the wrong kind or out of range.
        QueryError
            What the database holds does not allow an answer.
        """
        bound = self.bind(given)
        in_sql = {name: value for name, value in bound.items() if re.search(rf"\${name}\b", self.sql)}
        if not self.computed_by:
            return engine.sql(self.sql, in_sql)
        from graspdb_queries.result import Result

        module, _, function = self.computed_by.rpartition(".")
        compute = getattr(import_module(f"graspdb_queries.{module}"), function)
        with engine.stream(self.sql, in_sql) as rows:
            return Result(compute(rows, bound))


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
    computed_by, example = "", ""
    for paragraph in paragraphs[1:]:
        heading, *entries = paragraph.splitlines()
        if heading == "Parameters:":
            parameters = [_parameter(name, entry) for entry in entries]
        elif heading == "Columns:":
            columns = [Column(*_match(name, _COLUMN, entry)) for entry in entries]
        elif paragraph.startswith(_COMPUTED):
            computed_by = paragraph.removeprefix(_COMPUTED)
        elif paragraph.startswith(_EXAMPLE):
            example = paragraph.removeprefix(_EXAMPLE)
        else:
            notes.append(paragraph.replace("\n", " "))
    if not title or not columns:
        raise ValueError(f"{name}.sql: its head lacks a title or its columns")
    sql = "\n".join(lines[n_head:]).strip()
    return NamedQuery(
        name,
        title,
        tuple(parameters),
        tuple(columns),
        "\n\n".join(notes),
        sql,
        computed_by,
        tuple(_assignment(name, word) for word in example.split()),
    )


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


def _assignment(name: str, word: str) -> tuple[str, str]:
    parameter, equals, value = word.partition("=")
    if not equals:
        raise ValueError(f"{name}.sql: {word!r} in the example of its head is not name=value")
    return parameter, value


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
