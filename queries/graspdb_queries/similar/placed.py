"""Where people would grasp a new object: grasps of a database laid onto it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_queries.result import Result
from graspdb_queries.similar.score import ScorePart, explained, part_columns, plain

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedGrasp:
    """A grasp of the database on a new object.

    Attributes
    ----------
    rank : int
        1 for the best.
    place : int
        Number of the place: grasps that enclose mostly the same points of the new object share it.
    grasp, session, subject, object, side : str
        The grasp, and what it belongs to.
    cost : float
        Sum of the costs of the parts.
    parts : tuple of ScorePart
        What the cost consists of.
    new_from_object : ndarray, shape (4, 4)
        Rigid transform from the frame of the grasp's object to that of the new one [m].
    points : ndarray, shape (n, 3)
        Points of the new object in the space that the hand encloses there [m].
    sites : ndarray, shape (20, 3)
        Sphere centres of the hand in the frame of the new object [m].
    contacts : ndarray, shape (k, 3)
        Contact points in the frame of the new object [m].
    q : ndarray, shape (30,), or None
        Configuration of the hand in the grasp; None where it is not known. The wrist's pose in it is that of
        the recording.
    one_way, trimmed : float
        Mean distance of the feature's points to the new object, of all and of the nearest 70 % [m].
    contacts_on : float
        Share of the contact points that lie on the new object.
    penetration : float
        How much deeper the deepest sphere lies in the new object than in its own [m].
    """

    rank: int
    place: int
    grasp: str
    session: str
    subject: str | None
    object: str
    side: str
    cost: float
    parts: tuple[ScorePart, ...]
    new_from_object: Floats
    points: Floats
    sites: Floats
    contacts: Floats
    q: Floats | None
    one_way: float
    trimmed: float
    contacts_on: float
    penetration: float

    @property
    def centre(self) -> Floats:
        """Middle of the points that the hand encloses, shape (3,) [m]."""
        return np.asarray(self.points.mean(axis=0))

    def explain(self) -> str:
        """Return the parts of the cost as one line."""
        return explained(self.parts)


@dataclass(frozen=True, eq=False)
class GraspsOn:
    """The answer to 'where would people grasp this?'.

    Attributes
    ----------
    object : str
        Name of the file.
    where : str or None
        The filter.
    searched : int
        Grasps that were searched.
    left_out : int
        Grasps that pass the filter and have no feature that can be compared.
    places : int
        Places of the object that were tried.
    refused : int
        Grasps that fitted nowhere without the hand reaching into the object.
    hits : tuple of PlacedGrasp
        Best first, each grasp at its best place; equal ones in the order of their keys.
    """

    object: str
    where: str | None
    searched: int
    left_out: int
    places: int
    refused: int
    hits: tuple[PlacedGrasp, ...]

    def table(self) -> Result:
        """Return the hits as a table: a row each, lengths in mm."""
        hits = self.hits
        columns: dict[str, list[Any]] = {
            name: [getattr(hit, name) for hit in hits]
            for name in ("rank", "place", "grasp", "subject", "object", "cost")
        }
        for axis, name in enumerate("xyz"):
            columns[f"{name}_mm"] = [1e3 * float(hit.centre[axis]) for hit in hits]
        columns |= part_columns(hits)
        columns["one_way_mm"] = [1e3 * hit.one_way for hit in hits]
        columns["contacts_on"] = [hit.contacts_on for hit in hits]
        columns["penetration_mm"] = [1e3 * hit.penetration for hit in hits]
        return Result(pa.table(columns))

    def _repr_html_(self) -> str:
        """Return the hits as a table, for a notebook."""
        return self.table()._repr_html_()

    def as_json(self) -> dict[str, Any]:
        """Return the answer as plain values, for JSON."""
        values = {name: value for name, value in vars(self).items() if name != "hits"}
        return values | {"hits": [plain(hit) for hit in self.hits]}
