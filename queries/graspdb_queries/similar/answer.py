"""What a search for similar grasps comes to, and why."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb_queries.result import Result
from graspdb_queries.similar.score import ScorePart, explained, part_columns, plain

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hit:
    """A grasp like the one asked for.

    Attributes
    ----------
    rank : int
        1 for the most similar.
    grasp, session, subject, object, side : str
        The grasp, and what it belongs to.
    cost : float
        Sum of the costs of the parts: zero for the query itself, more the less similar.
    parts : tuple of ScorePart
        What the cost consists of.
    hit_from_query : ndarray, shape (4, 4), or None
        Rigid transform that lays the query onto the hit, object frames [m]; None where shapes were not
        aligned.
    symmetric, one_way, trimmed : float or None
        Chamfer distances of the aligned surfaces [m]; see `Chamfer`.
    shared_sites, only_query, only_hit : tuple of str
        Sites in contact in both, in the query alone, in the hit alone.
    """

    rank: int
    grasp: str
    session: str
    subject: str | None
    object: str
    side: str
    cost: float
    parts: tuple[ScorePart, ...]
    hit_from_query: Floats | None
    symmetric: float | None
    one_way: float | None
    trimmed: float | None
    shared_sites: tuple[str, ...]
    only_query: tuple[str, ...]
    only_hit: tuple[str, ...]

    def explain(self) -> str:
        """Return the parts of the cost as one line."""
        return explained(self.parts)


@dataclass(frozen=True, eq=False)
class Similar:
    """The answer to 'grasps like this one'.

    Attributes
    ----------
    query : str
        Key of the grasp, or name of the file.
    by : str
        feature, posture, contact or all.
    mode : str
        shape or held.
    where : str or None
        The filter.
    searched : int
        Grasps that were searched.
    left_out : int
        Grasps that pass the filter and could not be compared: empty features, descriptors of another kind,
        postures not known.
    learned_from : int
        Features that the metric of descriptors follows from; zero where there were too few.
    hits : tuple of Hit
        Most similar first; of equal ones in the order of their keys.
    """

    query: str
    by: str
    mode: str
    where: str | None
    searched: int
    left_out: int
    learned_from: int
    hits: tuple[Hit, ...]

    def table(self) -> Result:
        """Return the hits as a table: a row each, a column for each part of the cost, distances in mm."""
        columns: dict[str, list[object]] = {
            "rank": [hit.rank for hit in self.hits],
            "grasp": [hit.grasp for hit in self.hits],
            "subject": [hit.subject for hit in self.hits],
            "object": [hit.object for hit in self.hits],
            "cost": [hit.cost for hit in self.hits],
        }
        columns |= part_columns(self.hits)
        for name in ("symmetric", "one_way", "trimmed"):
            columns[f"{name}_mm"] = [
                None if (value := getattr(hit, name)) is None else 1e3 * value for hit in self.hits
            ]
        columns["shared_sites"] = [" ".join(hit.shared_sites) for hit in self.hits]
        return Result(pa.table(columns))

    def _repr_html_(self) -> str:
        """Return the hits as a table, for a notebook."""
        return self.table()._repr_html_()

    def as_json(self) -> dict[str, object]:
        """Return the answer as plain values, for JSON."""
        described = {key: getattr(self, key) for key in ("query", "by", "mode", "where", "searched")}
        return described | {
            "left_out": self.left_out,
            "learned_from": self.learned_from,
            "hits": [plain(hit) for hit in self.hits],
        }
