"""Grasps chosen by what is known of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from graspdb.database import Database
from graspdb_queries.quoting import identifier, literal
from graspdb_schemas.vocabulary import DIGITS

PAGE: Final = 24
"""Grasps on a page."""

CHOICES: Final = ("session", "subject", "object", "task", "side", "grasp_type")
"""Columns of which one value may be chosen."""

_MOST_CHOICES: Final = 500
"""Values that a column is offered with."""

_SHOWN: Final = """
    grasp, subject, object, side, task, repetition, digits, grasp_type, snapshot_kind, hull_volume,
    quality['epsilon'] AS epsilon
"""


@dataclass(frozen=True)
class Filter:
    """What grasps have to be like.

    Attributes
    ----------
    chosen : mapping of str to str
        Value of each of `CHOICES` that is asked for.
    digits : tuple of str
        Digits that have to be in contact.
    where : str
        A boolean SQL expression over the columns of `grasps`; empty if none.
    """

    chosen: Mapping[str, str]
    digits: tuple[str, ...]
    where: str

    def sql(self) -> str:
        """Return the whole filter as one SQL expression; TRUE where nothing is asked for."""
        parts = [f"{identifier(name)} = {literal(value)}" for name, value in self.chosen.items()]
        if self.digits:
            parts.append(f"list_has_all(digits, [{', '.join(map(literal, self.digits))}])")
        if self.where:
            # On lines of its own, for it may end in a comment.
            parts.append(f"(\n{self.where}\n)" if parts else self.where)
        return " AND ".join(parts) or "TRUE"


@dataclass(frozen=True)
class Page:
    """Some of the grasps that pass a filter.

    Attributes
    ----------
    total : int
        How many pass.
    number, last : int
        Which page this is, from 1, and which is the last.
    rows : tuple of mapping
        Grasps of this page.
    """

    total: int
    number: int
    last: int
    rows: tuple[dict[str, Any], ...]


def asked(arguments: Mapping[str, str], digits: list[str]) -> Filter:
    """Return the filter that a form asks for."""
    chosen = {name: arguments[name] for name in CHOICES if arguments.get(name)}
    known = tuple(digit for digit in DIGITS if digit in digits)
    return Filter(chosen, known, arguments.get("where", "").strip())


def find(database: Database, wanted: Filter, number: int) -> Page:
    """Return a page of the grasps that pass a filter.

    Raises
    ------
    QueryError
        The filter's expression cannot be used.
    """
    if wanted.where:
        database.check_filter(wanted.where)
    condition = f"(\n{wanted.sql()}\n)"
    total = database.sql(f"SELECT count(*) FROM grasps WHERE {condition}").rows()[0][0]
    last = max(1, -(-total // PAGE))
    number = min(max(number, 1), last)
    rows = database.sql(
        f"SELECT {_SHOWN} FROM grasps WHERE {condition} "
        f"ORDER BY session, object, subject, repetition, grasp LIMIT {PAGE} OFFSET {PAGE * (number - 1)}"
    ).table.to_pylist()
    return Page(total, number, last, tuple(rows))


def choices(database: Database) -> dict[str, list[str]]:
    """Return the values that each of `CHOICES` has, in order."""
    return {
        name: [
            row[0]
            for row in database.sql(
                f"SELECT DISTINCT {identifier(name)} AS value FROM grasps WHERE value IS NOT NULL "
                f"ORDER BY value LIMIT {_MOST_CHOICES}"
            ).rows()
        ]
        for name in CHOICES
    }
