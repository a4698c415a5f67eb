"""The functions of ``macros.sql``, and those that give the names of sites, digits and joint angles.

Each is a DuckDB macro: made of expressions alone, so it reads nothing. An argument that is null, or a
vector with a null in it, makes the answer null; a name that is no site, digit or joint angle is an error.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Final

from graspdb_queries.quoting import literal
from graspdb_schemas.vocabulary import DIGITS, JOINT_ANGLES, SITES

_MACRO: Final = re.compile(
    r"((?:^-- [^\n]+\n)+)(CREATE MACRO (\w+)\(([^)]*)\) AS\s.+?);$", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Macro:
    """A function that queries may call.

    Attributes
    ----------
    name : str
        Its name.
    arguments : tuple of str
        Names of its arguments.
    doc : str
        What it gives, with unit.
    example : str
        An expression with it that runs as it stands.
    sql : str
        The statement that creates it.
    """

    name: str
    arguments: tuple[str, ...]
    doc: str
    example: str
    sql: str

    @property
    def call(self) -> str:
        """Name and arguments, as one writes them."""
        return f"{self.name}({', '.join(self.arguments)})"


@cache
def macros() -> tuple[Macro, ...]:
    """Return all functions, each after those that it needs."""
    text = (resources.files("graspdb_queries") / "macros.sql").read_text(encoding="utf-8")
    return (
        _names("site_names", SITES, "Names of the 20 sites, in the order of every list of sites."),
        _names("digit_names", DIGITS, "Names of the five digits, thumb first."),
        _names(
            "joint_names",
            JOINT_ANGLES,
            "Names of the 23 joint angles, in their order in q from its 8th number.",
        ),
        *(_read(*match.groups()) for match in _MACRO.finditer(text)),
    )


def macros_sql() -> Iterator[str]:
    """Yield the statements that create and document the functions."""
    for macro in macros():
        yield macro.sql
        yield f"COMMENT ON MACRO {macro.name} IS {literal(macro.doc)}"


def _names(name: str, names: Sequence[str], doc: str) -> Macro:
    listed = ", ".join(literal(entry) for entry in names)
    return Macro(name, (), doc, f"{name}()", f"CREATE MACRO {name}() AS [{listed}]")


def _read(comment: str, sql: str, name: str, arguments: str) -> Macro:
    *doc, example = (line.removeprefix("-- ") for line in comment.splitlines())
    return Macro(name, tuple(arguments.split(", ")), " ".join(doc), example, sql)
