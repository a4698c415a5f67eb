"""The hand of a grasp in a database, as key points and radii in the object's frame."""

import numpy as np

from graspdb.database import Database
from graspdb_ingest.surface import HandPoints, key_points
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import Side

_HAND: str = """
    SELECT hands.radii
    FROM hands JOIN trials USING (session, subject)
    WHERE trials.trial = $trial AND hands.side = $side AND list_contains(trials.context, hands.ingest_id)
"""


def hand_of_grasp(database: Database, key: str) -> HandPoints:
    """Return the hand of a grasp at its snapshot.

    Raises
    ------
    QueryError
        If there is no such grasp, or its hand's radii are not stored.
    """
    grasp = database.grasp(key)
    rows = database.sql(_HAND, trial=grasp.trial, side=grasp.side).rows()
    if not rows or not rows[0][0]:
        raise QueryError(
            f"the radii of the hand of grasp {key!r} are not stored", "Ingest its session again."
        )
    wrist = grasp.object_from_hand[:3, 3]
    return HandPoints(key_points(wrist, grasp.sites), np.array(rows[0][0]), Side(grasp.side))
