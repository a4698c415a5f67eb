"""How alike two grasps are, and how one is laid over the other."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from graspdb.database import Database
from graspdb.view.scene import Floats
from graspdb_queries.quoting import literal
from graspdb_queries.similar.answer import Hit
from graspdb_schemas.errors import ParameterError, QueryError


@dataclass(frozen=True, eq=False)
class Likeness:
    """What the search for similar grasps says of two.

    Attributes
    ----------
    hit : Hit or None
        The second as an answer to the first, compared in every respect; None where they cannot be compared.
    reason : str
        Why they cannot; empty where they can.
    """

    hit: Hit | None
    reason: str = ""

    @property
    def first_from_second(self) -> Floats:
        """Where the second's object lies in the first's object frame, shape (4, 4): feature over feature."""
        if self.hit is None or self.hit.hit_from_query is None:
            return np.eye(4)
        return np.asarray(np.linalg.inv(self.hit.hit_from_query))

    @property
    def summary(self) -> str:
        """One line."""
        if self.hit is None:
            return f"not compared: {self.reason}"
        return f"cost {self.hit.cost:.2f}, {len(self.hit.shared_sites)} sites touch in both"

    def as_shown(self) -> dict[str, Any]:
        """Return cost, its parts and what else is known, as text for a page."""
        if self.hit is None:
            return {"cost": "not known", "parts": [], "facts": [("why", self.reason)]}
        hit = self.hit
        most = max((part.cost for part in hit.parts), default=0.0) or 1.0
        distances = (("surfaces apart", hit.symmetric), ("closest part", hit.trimmed))
        sites = (
            ("touch in both", hit.shared_sites),
            ("in the first", hit.only_query),
            ("in the second", hit.only_hit),
        )
        return {
            "cost": f"{hit.cost:.2f}",
            "parts": [
                {
                    "name": part.name,
                    "share": round(100 * part.cost / most, 1),
                    "cost": f"{part.cost:.2f}",
                    "detail": part.explain(),
                }
                for part in hit.parts
            ],
            "facts": [
                *((name, f"{1e3 * value:.1f} mm") for name, value in distances if value is not None),
                *((name, ", ".join(found)) for name, found in sites if found),
            ],
        }


def likeness_of(database: Database, first: str, second: str) -> Likeness:
    """Compare two grasps in every respect: feature, posture and contacts.

    Raises
    ------
    QueryError
        There is no such grasp.
    ParameterError
        They are one.
    """
    if first == second:
        raise ParameterError("second grasp", second, "another one than the first")
    for key in (first, second):
        database.grasp(key)
    try:
        found = database.similar(first, k=1, by="all", where=f"grasp = {literal(second)}")
    except QueryError as error:
        return Likeness(None, error.found)
    if not found.hits:
        return Likeness(None, "a feature or a posture is missing, or descriptors are of different kinds")
    return Likeness(found.hits[0])
