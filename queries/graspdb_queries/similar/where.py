"""A filter: one boolean SQL expression over the columns of grasps."""

import duckdb

from graspdb_queries.engine import Engine
from graspdb_schemas.errors import QueryError

_ALLOWED = "A filter is one boolean expression over the columns of grasps, such as subject <> 's1'."


def filtered_grasps(engine: Engine, where: str) -> list[str]:
    """Return the keys of the grasps for which a filter is true.

    Raises
    ------
    QueryError
        The filter is not one expression, not boolean, wrong, or tries to leave the database.
    """
    check_filter(engine, where)
    found = engine.sql(f"SELECT grasp FROM grasps WHERE (\n{where}\n)").table["grasp"]
    return list(found.to_pylist())


def check_filter(engine: Engine, where: str) -> None:
    """Raise QueryError unless a text is one boolean expression over the columns of grasps."""
    try:
        # Parsed by itself: parentheses that close more than they open, a second statement and the like
        # fail here, before the text becomes part of a query.
        duckdb.SQLExpression(where)
    except (duckdb.Error, UnicodeEncodeError) as error:
        first = str(error).splitlines()[0]
        raise QueryError(f"--where {where!r} is not one expression: {first}", _ALLOWED) from error
    described = engine.sql(f"DESCRIBE SELECT (\n{where}\n) AS filter FROM grasps").rows()
    kind = described[0][1] if len(described) == 1 else "several columns"
    if kind != "BOOLEAN":
        raise QueryError(f"--where {where!r} is {kind}, not BOOLEAN", _ALLOWED)
