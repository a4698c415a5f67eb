"""YAML to plain values that JSON can hold, with every oddity reported instead of passed on."""

import math
from collections.abc import Hashable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from graspdb_schemas.errors import Problem

_MOST_VALUES: Final = 200_000
_DEEPEST: Final = 30
_LARGEST: Final = 2**53
"""Whole numbers up to here are floats, and JSON, without loss."""
_ROOT: Final = "the manifest"


class _Loader(yaml.SafeLoader):
    """A safe loader that leaves dates as they are written, since JSON has none."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Return a node's value; say where it stands if it is none of what its tag says."""
        try:
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            kind = node.tag.rpartition(":")[2]
            message = f"{describe(node.value)} is no {kind}"
            raise yaml.constructor.ConstructorError(problem=message, problem_mark=node.start_mark) from error


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def describe(value: object) -> str:
    """Return how a value of a manifest reads in a message."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case str():
            shown = repr(value if len(value) <= 60 else value[:57] + "...")
            return shown if value else "empty text"
        case dict():
            return f"a table of {', '.join(str(key) for key in list(value)[:6]) or 'nothing'}"
        case list():
            return f"a list of {len(value)}"
        case _:
            return str(value)


def table(value: object) -> Mapping[str, Any]:
    """Return a value that is a table, or an empty table."""
    return value if isinstance(value, dict) else {}


def join_key(parent: str, key: object) -> str:
    """Return the dotted path of a key; list indices stand in brackets."""
    if isinstance(key, int):
        return f"{parent}[{key}]"
    return f"{parent}.{key}" if parent else str(key)


def load_yaml(path: Path) -> tuple[Any, list[Problem]]:
    """Read a manifest as plain tables, lists, texts and numbers.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    value : Any
        What it holds; None where it is no YAML. Keys are texts, dates stay as they were written.
    problems : list of Problem
        Syntax errors, keys that stand twice, and values that are no plain data.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        return None, [Problem(_ROOT, f"a file that cannot be read ({error.strerror})", "a readable file")]
    except UnicodeDecodeError as error:
        return None, [Problem(_ROOT, f"bytes that are not UTF-8 at {error.start}", "text in UTF-8")]
    try:
        node = yaml.compose(text, _Loader)
        if node is None:
            return None, []
        problems = [_twice(*found) for found in _duplicates(node, "", set())]
        loader = _Loader("")
        value = loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        return None, [_syntax(error)]
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        found = str(error).splitlines()[0] if str(error) else type(error).__name__
        return None, [Problem(_ROOT, f"YAML that cannot be read: {found}", "plain YAML")]
    plain = _Plain()
    return plain.copy(value, "", 0), problems + plain.problems


def _syntax(error: yaml.MarkedYAMLError) -> Problem:
    mark = error.problem_mark or error.context_mark
    where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else _ROOT
    return Problem(where, f"YAML that cannot be read: {error.problem or error.context}", "plain YAML")


def _twice(key: str, first: int, second: int) -> Problem:
    return Problem(key, f"the same key in line {first} and in line {second}", "each key once")


def _duplicates(node: yaml.Node, path: str, done: set[int]) -> Iterator[tuple[str, int, int]]:
    """Yield key, first line and second line of every key that stands twice in one table."""
    if id(node) in done:
        return
    done.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield from _duplicates(item, join_key(path, index), done)
    elif isinstance(node, yaml.MappingNode):
        lines: dict[Hashable, int] = {}
        for key, value in node.value:
            here = join_key(path, str(key.value)) if isinstance(key, yaml.ScalarNode) else path
            if isinstance(key, yaml.ScalarNode) and key.tag != "tag:yaml.org,2002:merge":
                line = key.start_mark.line + 1
                if (key.tag, key.value) in lines:
                    yield here, lines[key.tag, key.value], line
                lines.setdefault((key.tag, key.value), line)
            yield from _duplicates(value, here, done)


class _Plain:
    """Copies a value into what JSON can hold, and notes what it cannot."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self._count = 0

    def copy(self, value: object, path: str, depth: int) -> Any:
        """Return the value as plain data; what is not plain becomes None and a problem."""
        self._count += 1
        if depth > _DEEPEST or self._count > _MOST_VALUES:
            if self._count <= _MOST_VALUES + 1:
                self._note(path, "a structure without end, or larger than any session", "a few levels")
                self._count = _MOST_VALUES + 1
            return None
        match value:
            case None | bool() | str():
                return value
            case int():
                if abs(value) > _LARGEST:
                    self._note(path, f"a number of {value.bit_length()} bits", f"at most {_LARGEST}")
                return value if abs(value) <= _LARGEST else 0
            case float():
                if not math.isfinite(value):
                    self._note(path, str(value), "a finite number")
                return value if math.isfinite(value) else 0.0
            case list() | tuple():
                return [self.copy(item, join_key(path, i), depth + 1) for i, item in enumerate(value)]
            case dict():
                return {
                    self._key(key, path): self.copy(item, join_key(path, str(key)), depth + 1)
                    for key, item in value.items()
                }
            case _:
                self._note(path, f"a value of type {type(value).__name__}", "text, number, list or table")
                return None

    def _key(self, key: object, path: str) -> str:
        if not isinstance(key, str):
            self._note(join_key(path, str(key)), f"the key {describe(key)}", "text as key: put it in quotes")
        return str(key)

    def _note(self, path: str, found: str, allowed: str) -> None:
        self.problems.append(Problem(path or _ROOT, found, allowed))
