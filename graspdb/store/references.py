"""What has to hold between the tables of a database, as SQL that finds where it does not."""

from collections.abc import Iterator, Mapping
from typing import Final

from graspdb_queries.engine import Engine
from graspdb_queries.source import TableSource
from graspdb_schemas.tables import TRIAL_TABLES

_SHOWN: Final = 3
"""Offenders that a problem names."""

_OBJECT: Final = (
    "trials t USING (trial) JOIN objects o ON o.session = t.session AND o.object = t.object "
    "AND list_contains(t.context, o.ingest_id)"
)

_CHECKS: Final[tuple[tuple[str, str, str], ...]] = (
    ("trials", "there more than once", "SELECT trial FROM trials GROUP BY trial HAVING count(*) > 1"),
    (
        "trials",
        "without a row of their session",
        "SELECT trial FROM trials WHERE session NOT IN (SELECT session FROM sessions)",
    ),
    (
        "trials",
        "without the row of their subject",
        """
        SELECT trial FROM trials t WHERE subject IS NOT NULL AND NOT EXISTS (
            FROM subjects s WHERE s.session = t.session AND s.subject = t.subject
            AND list_contains(t.context, s.ingest_id)
        )
        """,
    ),
    (
        "trials",
        "with another number of grasps than n_grasps",
        """
        SELECT trial FROM trials
        LEFT JOIN (SELECT trial, count(*) AS n FROM grasps GROUP BY trial) USING (trial)
        WHERE n_grasps <> coalesce(n, 0)
        """,
    ),
    (
        "grasps",
        "of another session, subject or object than their trial",
        """
        SELECT grasp FROM grasps g JOIN trials t USING (trial)
        WHERE g.session <> t.session OR g.subject <> t.subject OR g.object <> t.object
        """,
    ),
    ("grasps", "there more than once", "SELECT grasp FROM grasps GROUP BY grasp HAVING count(*) > 1"),
    (
        "grasps",
        "without exactly one row of their object",
        f"""
        SELECT grasp FROM grasps
        LEFT JOIN (SELECT grasp, count(*) AS n FROM grasps JOIN {_OBJECT} GROUP BY grasp) USING (grasp)
        WHERE n IS DISTINCT FROM 1
        """,
    ),
    (
        "objects",
        "with another number of points than n_points",
        """
        SELECT o.object FROM objects o LEFT JOIN (
            SELECT ingest_id, count(*) AS n, count(DISTINCT point) AS different, max(point) AS last
            FROM object_points GROUP BY ingest_id
        ) p USING (ingest_id)
        WHERE o.n_points <> coalesce(n, 0) OR n <> different OR last <> n - 1
        """,
    ),
    *(
        (
            name,
            "of a grasp that there is not",
            f"SELECT DISTINCT grasp FROM {name} WHERE grasp NOT IN (SELECT grasp FROM grasps)",
        )
        for name in ("contacts", "features", "contact_maps", "contact_events")
    ),
    *(
        (
            name,
            "at a point that the object has not",
            f"""
            SELECT DISTINCT trial FROM {name} x JOIN {_OBJECT}
            WHERE {point} NOT BETWEEN 0 AND o.n_points - 1
            """,
        )
        for name, points in (
            ("contacts", ("x.point",)),
            ("features", ("list_min(x.points)", "list_max(x.points)")),
            ("contact_maps", ("list_min(x.points)", "list_max(x.points)")),
            ("measured_maps", ("list_min(x.points)", "list_max(x.points)")),
        )
        for point in points
    ),
    *(
        (
            name,
            "at a frame that the trial has not",
            f"""
            SELECT DISTINCT trial FROM {name} x JOIN trials t USING (trial)
            WHERE x.{frame} NOT BETWEEN 0 AND t.n_frames - 1
            """,
        )
        for name, frame in (("markers", "frame"), ("frames", "frame"), ("grasps", "snapshot_frame"))
    ),
    *(
        (
            name,
            "under the ingest of another trial",
            f"SELECT DISTINCT x.trial FROM {name} x JOIN trials t USING (ingest_id) WHERE x.trial <> t.trial",
        )
        for name in TRIAL_TABLES
    ),
)
"""Table, what its rows may not be, and a query for the keys of those that are."""


def broken_references(sources: Mapping[str, TableSource]) -> Iterator[tuple[str, str]]:
    """Yield each table with a problem between it and others, and what it is."""
    with Engine(sources) as engine:
        for table, what, query in _CHECKS:
            found = [str(row[0]) for row in engine.sql(query).rows()]
            if found:
                more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
                yield table, f"{what}: {', '.join(found[:_SHOWN])}{more}"
