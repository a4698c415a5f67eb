"""Key points of the UmeTrack hand model (Han et al. 2022, SIGGRAPH Asia, "UmeTrack"), as HOT3D stores it.

A hand profile has 20 hinges, four a digit from thumb to little finger, and 21 landmarks, all of a left hand
at rest with its wrist at the origin; the right hand is its mirror image. Of the landmarks 20 are our key
points. The one that is not among them, the base of the thumb, is where the thumb's first hinge is.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.fields import numbers, read_json
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import DIGITS, KEY_POINTS, Side

N_HINGES: Final = 20
N_FRAMES: Final = 17
"""Root, wrist, and three segments a digit, which skin the landmarks."""

LANDMARKS: Final = (
    *(f"{digit}_tip" for digit in DIGITS),
    "wrist",
    "thumb_mcp",
    "thumb_ip",
    *(f"{digit}_{joint}" for digit in DIGITS[1:] for joint in ("mcp", "pip", "dip")),
)
"""Key points in the order of the profile's landmarks; the last one, the middle of the palm, is left out."""


@dataclass(frozen=True, eq=False)
class UmeTrackHand:
    """One person's hand.

    Attributes
    ----------
    axes : ndarray, shape (20, 3)
        Axes of the hinges, as a left hand has them at rest.
    places : ndarray, shape (20, 3)
        Points on the axes [m].
    landmarks : ndarray, shape (20, 3)
        Landmarks at rest [m], in the order of `LANDMARKS`.
    weights : ndarray, shape (20, 17)
        Share that each segment has in a landmark.
    """

    axes: Array
    places: Array
    landmarks: Array
    weights: Array

    def key_points(self, angles: Floats, world_from_wrist: Floats, side: Side) -> Floats:
        """Return the key points, in the order of `KEY_POINTS`, shape (n, 21, 3) [m].

        Parameters
        ----------
        angles : ndarray, shape (n, 20)
            Angles of the hinges [rad].
        world_from_wrist : ndarray, shape (n, 4, 4)
            Pose of the wrist.
        side : Side
            Which hand; a right one is the left one with x negated.
        """
        wrist = world_from_wrist @ np.diag([1.0 if side is Side.LEFT else -1.0, 1.0, 1.0, 1.0])
        frames = self._frames(angles, wrist)
        resting = np.concatenate([self.landmarks, np.ones((len(self.landmarks), 1))], axis=1)
        skinned = np.einsum("lf,nfab,lb->nla", self.weights, frames, resting, optimize=True)[..., :3]
        base = wrist[:, :3, :3] @ self.places[0] + wrist[:, :3, 3]
        points = np.empty((len(angles), len(KEY_POINTS), 3))
        points[:, [KEY_POINTS.index(name) for name in LANDMARKS]] = skinned
        points[:, KEY_POINTS.index("thumb_cmc")] = base
        return points

    def _frames(self, angles: Floats, wrist: Floats) -> Floats:
        """Return the poses of all segments, shape (n, 17, 4, 4)."""
        n = len(angles)
        vectors = (self.axes * angles[..., None]).reshape(-1, 3)
        turns = Rotation.from_rotvec(vectors).as_matrix().reshape(n, N_HINGES, 3, 3)
        hinges = np.tile(np.eye(4), (n, N_HINGES, 1, 1))
        hinges[..., :3, :3] = turns
        hinges[..., :3, 3] = self.places - np.einsum("nhab,hb->nha", turns, self.places)
        frames = np.empty((n, N_FRAMES, 4, 4))
        frames[:, :2] = wrist[:, None]
        for digit in range(len(DIGITS)):
            # The first two hinges move the first segment together.
            pose = wrist @ hinges[:, 4 * digit]
            for segment in range(3):
                pose = pose @ hinges[:, 4 * digit + segment + 1]
                frames[:, 2 + 3 * digit + segment] = pose
        return frames


def read_profile(path: Path) -> UmeTrackHand:
    """Read a hand profile, whose lengths are millimetres.

    Raises
    ------
    ImportSourceError
        If it is missing, cut off or of another layout.
    """
    content = read_json(path)
    axes = numbers(content, "hand_model.joint_rotation_axes", ((22, 3), (N_HINGES, 3)), path)[:N_HINGES]
    places = numbers(content, "hand_model.joint_rest_positions", ((22, 3), (N_HINGES, 3)), path)[:N_HINGES]
    landmarks = numbers(content, "hand_model.landmark_rest_positions", (21, 3), path)[: len(LANDMARKS)]
    shares = numbers(content, "hand_model.landmark_rest_bone_weights", (21, None), path)[: len(LANDMARKS)]
    said = numbers(content, "hand_model.landmark_rest_bone_indices", (21, shares.shape[1]), path)
    bones = said[: len(LANDMARKS)].astype(np.int64)
    if bones.min() < 0 or bones.max() >= N_FRAMES:
        raise ImportSourceError(path, f"a landmark is on segment {bones.max()}", f"There are {N_FRAMES}.")
    weights = np.zeros((len(LANDMARKS), N_FRAMES))
    np.add.at(weights, (np.arange(len(LANDMARKS))[:, None], bones), shares)
    millimetre = 1e-3
    return UmeTrackHand(
        axes=np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True), dtype=np.float64),
        places=np.asarray(millimetre * places, dtype=np.float64),
        landmarks=np.asarray(millimetre * landmarks, dtype=np.float64),
        weights=weights,
    )
