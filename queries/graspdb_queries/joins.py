"""Views that join grasps to the very rows of objects and hands that they stand on.

While trials stand on several versions of an object or a hand, its name alone does not say which one a
grasp was made on; the column `context` of `trials` does.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import pyarrow as pa

from graspdb_queries.quoting import identifier
from graspdb_schemas.describe import DescribedTable, describe
from graspdb_schemas.tables import GRASPS, HANDS, OBJECTS

_CONTEXT: Final = "(SELECT trial, unnest(context) AS context_id FROM trials)"

_OBJECT_ID: Final = pa.field(
    "object_ingest_id",
    pa.string(),
    metadata={"unit": "", "doc": "ingest_id of that row, and of the object's rows in object_points"},
)
_CLOUD: Final = pa.field(
    "cloud",
    pa.string(),
    metadata={"unit": "", "doc": "the same for objects whose clouds are the same point by point"},
)


@dataclass(frozen=True)
class View:
    """A view beside the tables.

    Attributes
    ----------
    name : str
        Its name.
    doc : str
        What one row stands for.
    schema : pyarrow.Schema
        Its columns, documented as those of tables are.
    sql : str
        The statement that creates it, once the tables are there.
    """

    name: str
    doc: str
    schema: pa.Schema
    sql: str


@cache
def views() -> dict[str, View]:
    """Return the views by name."""
    return {view.name: view for view in (_grasp_objects(), _grasp_hands())}


def describe_views() -> tuple[DescribedTable, ...]:
    """Return the description of every view."""
    return tuple(describe(view.name, view.doc, view.schema) for view in views().values())


def _grasp_objects() -> View:
    grasp, own = list(_of(GRASPS, "grasp", "trial", "session", "subject")), list(_rest(OBJECTS, ("session",)))
    # The cloud is scattered by a seeded generator: the same file and the same spacing give the same points.
    cloud = "coalesce(md5(concat_ws('/', o.mesh_sha256, o.cloud_spacing, o.n_points, o.area)), o.ingest_id)"
    select = ", ".join([*_names("g", grasp), *_names("o", own)])
    return View(
        "grasp_objects",
        "one row a grasp: the very row of objects that it stands on",
        pa.schema([*grasp, *own, _CLOUD, _OBJECT_ID]),
        f"CREATE VIEW grasp_objects AS SELECT {select}, {cloud} AS cloud, o.ingest_id AS object_ingest_id "
        f"FROM grasps g JOIN {_CONTEXT} c ON c.trial = g.trial "
        "JOIN objects o ON o.ingest_id = c.context_id AND o.object = g.object",
    )


def _grasp_hands() -> View:
    grasp, own = list(_of(GRASPS, "grasp", "trial", "session")), list(_rest(HANDS, ("session",)))
    select = ", ".join([*_names("g", grasp), *_names("h", own)])
    return View(
        "grasp_hands",
        "one row a grasp: the very row of hands that it stands on",
        pa.schema([*grasp, *own]),
        f"CREATE VIEW grasp_hands AS SELECT {select} "
        f"FROM grasps g JOIN {_CONTEXT} c ON c.trial = g.trial "
        "JOIN hands h ON h.ingest_id = c.context_id AND h.side = g.side",
    )


def _of(schema: pa.Schema, *names: str) -> Iterator[pa.Field]:
    yield from (schema.field(name) for name in names)


def _rest(schema: pa.Schema, left_out: Sequence[str]) -> Iterator[pa.Field]:
    yield from (field for field in schema if field.name not in (*left_out, "ingest_id"))


def _names(table: str, fields: Sequence[pa.Field]) -> list[str]:
    return [f"{table}.{identifier(field.name)}" for field in fields]
