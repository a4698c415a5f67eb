"""Key points as a file has them, before units and order are made ours."""

from collections.abc import Mapping
from dataclasses import dataclass

from graspdb_ingest.hand.model import Floats
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True, eq=False)
class Postures:
    """Key points of one subject's hands with at most one object, as a file has them.

    Attributes
    ----------
    key_points : mapping of Side or None to ndarray, shape (n, 21, 3)
        By hand, None where the file does not say which; in the file's unit and order.
    poses : ndarray, shape (n, 4, 4), or None
        Poses of the object, lengths in the file's unit.
    name, object, subject, task, units, order : str or None
        What the file says.
    rate : float or None
        Frames per second [Hz].
    up : tuple of float or None
        Unit vector against gravity.
    identifiers : tuple of str
        What the data set calls each frame; empty if it does not.
    """

    key_points: Mapping[Side | None, Floats]
    poses: Floats | None = None
    name: str = ""
    object: str | None = None
    subject: str | None = None
    task: str | None = None
    units: str | None = None
    order: str | None = None
    rate: float | None = None
    up: tuple[float, float, float] | None = None
    identifiers: tuple[str, ...] = ()

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(next(iter(self.key_points.values())))
