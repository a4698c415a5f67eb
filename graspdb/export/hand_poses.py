"""Where the hand segment, and with it the wrist, is in each frame."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.items import Episode, Floats
from graspdb_ingest.rigid import fit_rigid
from graspdb_schemas.vocabulary import DIGITS, N_SITES, Side

if TYPE_CHECKING:
    from graspdb.database import Database

PALM: Final = tuple(4 * i for i in range(len(DIGITS)))
"""Sites that the hand segment carries, as indices of `SITES`."""

_HANDS: Final = """
    SELECT g.grasp, g.sites_object, g.object_from_hand, h.mjcf
    FROM grasps g LEFT JOIN grasp_hands h USING (grasp)
    WHERE g.grasp IN (SELECT unnest($grasps))
"""


def hand_poses(database: "Database", episodes: Sequence[Episode]) -> Iterator[Floats]:
    """Yield world_from_hand of each episode, shape (n_frames, 4, 4), NaN where it is not known.

    A tracked hand tells it by its joint angles. Of an imported one the five sites that the palm carries
    tell it: as rigid as they are, they have the same places in the hand segment as at its first grasp.

    Parameters
    ----------
    database : Database
        The database, for hands and grasps.
    episodes : sequence of Episode
        Hands of trials.
    """
    wanted = [episode.grasps[0] for episode in episodes]
    rows = database.sql(_HANDS, grasps=wanted).table.to_pylist()
    by_grasp = {row["grasp"]: row for row in rows}
    for episode in episodes:
        row = by_grasp[episode.grasps[0]]
        tracked = row["mjcf"] is not None and episode.q.shape[1] > 0
        poses = _of_model(row["mjcf"], episode) if tracked else None
        yield _of_palm(row, episode.sites) if poses is None else poses


def _of_model(mjcf: str, episode: Episode) -> Floats | None:
    """Return the poses by joint angles; None where the model has no segment of that name."""
    from graspdb_ingest.hand import HandModel

    model = HandModel(Side(episode.side), mjcf, ())
    if "hand" not in model.segments:
        return None
    poses = np.full((episode.n_frames, 4, 4), np.nan)
    known = np.isfinite(episode.q).all(axis=1)
    segment = model.segments.index("hand")
    pose = model.forward(episode.q[known])
    poses[known] = _matrices(pose.rotations[:, segment], pose.positions[:, segment])
    return poses


def _of_palm(row: dict[str, Any], sites: Floats) -> Floats:
    poses = np.full((len(sites), 4, 4), np.nan)
    known = np.isfinite(sites).all(axis=(1, 2))
    if row["sites_object"] is None or row["object_from_hand"] is None or not known.any():
        return poses
    object_from_hand = np.array(row["object_from_hand"], dtype=float)
    at_grasp = np.array(row["sites_object"], dtype=float).reshape(N_SITES, 3)
    in_hand = (at_grasp - object_from_hand[:3, 3]) @ object_from_hand[:3, :3]
    palm = sites[known][:, list(PALM)]
    fit = fit_rigid(in_hand[list(PALM)], palm, np.ones(palm.shape[:2]))
    poses[known] = _matrices(fit.rotations, fit.positions)
    return poses


def _matrices(rotations: NDArray[Any], positions: NDArray[Any]) -> Floats:
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, positions
    return poses
