"""What formats write: one hand in the frames of a trial, and one grasp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspdb.grasp import Grasp as Grasp

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Episode:
    """One hand in all frames of a trial in which it grasps; lab frame, as the database has it.

    What is not known is NaN; nothing is filled in.

    Attributes
    ----------
    trial, side, session, subject, object : str
        Which hand, where.
    task : str
        In words: what is done with which object, by which kind of grasp.
    grasps : tuple of str
        Keys of the selected grasps, in order of time.
    split : str
        Side of the split: train or valid; empty without a split.
    rate : float
        Frames per second as recorded [Hz].
    time : ndarray, shape (n,)
        Time of each frame [s].
    q : ndarray, shape (n, n_q)
        Configuration of the hand [m, 1, rad]; n_q is 30 for graspdb's own hand model.
    sites : ndarray, shape (n, 20, 3)
        Centres of the spheres [m].
    object_position : ndarray, shape (n, 3)
        Origin of the object frame [m].
    object_quaternion : ndarray, shape (n, 4)
        world_from_object rotation (w, x, y, z).
    touching : ndarray, shape (n, 20)
        1 where a site touches, 0 where it does not.
    """

    trial: str
    side: str
    session: str
    subject: str
    object: str
    task: str
    grasps: tuple[str, ...]
    split: str
    rate: float
    time: Floats
    q: Floats
    sites: Floats
    object_position: Floats
    object_quaternion: Floats
    touching: Floats

    @property
    def key(self) -> str:
        """Name of the episode: <trial>/<side>."""
        return f"{self.trial}/{self.side}"

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.time)
