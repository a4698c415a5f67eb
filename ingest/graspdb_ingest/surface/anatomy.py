"""Where a hand's parts face: directions of palm and segments from its 21 key points.

Every hand surface is built from key points, radii and the side alone, for that is all that public
data sets give; a tracked hand has them, too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.model import Floats
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import KEY_POINTS, N_SITES, SITES, Side

WRIST: Final = 0
N_KEY_POINTS: Final = len(KEY_POINTS)
THUMB_AT_REST: Final = (35.0, 25.0, -65.0)
"""A flat hand's thumb, turned about the palm's dorsal, radial and distal axes as in the hand model [deg]."""
BEND_WEIGHT: Final = 3.0
"""How much more a bent digit's own plane says of its flexion axis than the palm does, per sine of bend."""


@dataclass(frozen=True, eq=False)
class HandPoints:
    """Hands as key points, sphere radii and a side: all that a surface is built from.

    Attributes
    ----------
    key_points : ndarray, shape (..., 21, 3)
        Wrist and 20 sites [m]; the leading axes are frames, if any.
    radii : ndarray, shape (20,)
        Sphere radii r_k [m].
    side : Side
        Right or left.

    Raises
    ------
    ParameterError
        If a shape is wrong, or a radius is not a positive number.
    """

    key_points: Floats
    radii: Floats
    side: Side

    def __post_init__(self) -> None:
        if self.key_points.shape[-2:] != (N_KEY_POINTS, 3):
            raise ParameterError("key points", self.key_points.shape, "an array of shape (..., 21, 3)")
        if self.radii.shape != (N_SITES,):
            raise ParameterError("radii", self.radii.shape, f"an array of shape ({N_SITES},)")
        bad = [SITES[i] for i in np.flatnonzero(~(self.radii > 0))]
        if bad:
            value = float(self.radii[SITES.index(bad[0])])
            raise ParameterError(f"radius of {bad[0]}", value, "a positive length in metres")

    @property
    def wrist(self) -> Floats:
        """The wrist's centre [m], shape (..., 3)."""
        return self.key_points[..., WRIST, :]

    @property
    def sites(self) -> Floats:
        """Sphere centres [m], shape (..., 20, 3)."""
        return self.key_points[..., 1:, :]

    def site(self, name: str) -> Floats:
        """Return one sphere's centre [m], shape (..., 3)."""
        return self.sites[..., SITES.index(name), :]

    def radius(self, name: str) -> float:
        """Return one sphere's radius [m]."""
        return float(self.radii[SITES.index(name)])

    def frame(self, index: int) -> "HandPoints":
        """Return the hand of one frame."""
        return HandPoints(self.key_points[index], self.radii, self.side)

    @cached_property
    def palm_axes(self) -> Floats:
        """Distal, radial and dorsal direction of the palm as rows, shape (..., 3, 3)."""
        distal = unit(self.site("middle_mcp") - self.wrist)
        radial = unit(_across(self.site("index_mcp") - self.site("little_mcp"), distal))
        return np.stack([distal, radial, self._chirality * np.cross(distal, radial)], axis=-2)

    @cached_property
    def digit_axes(self) -> Floats:
        """Distal, radial and dorsal direction of each digit's three bones, shape (..., 5, 3, 3, 3).

        The bones are those between its four sites. A bent digit shows its flexion axis by its own
        plane; a straight one is taken to flex as the palm has it (the thumb as it stands at rest,
        turned the shortest way into place).
        """
        chains = self.sites.reshape(*self.sites.shape[:-2], 5, 4, 3)
        bones = unit(np.diff(chains, axis=-2))
        bend = self._chirality * np.cross(bones[..., :-1, :], bones[..., 1:, :]).sum(axis=-2)
        usual = self._usual_radial(bones[..., 0, :])
        agrees = np.sum(bend * usual, axis=-1, keepdims=True) > 0
        lateral = (usual + np.where(agrees, BEND_WEIGHT * bend, 0.0))[..., None, :]
        radial = unit(_across(lateral, bones))
        return np.stack([bones, radial, self._chirality * np.cross(bones, radial)], axis=-2)

    @property
    def _chirality(self) -> float:
        return 1.0 if self.side is Side.RIGHT else -1.0

    def _usual_radial(self, first: Floats) -> Floats:
        """Return the radial direction of straight digits, shape (..., 5, 3), from their first bones."""
        palm = self.palm_axes
        usual = np.repeat(palm[..., None, 1, :], 5, axis=-2)
        rest = Rotation.from_euler("ZYX", THUMB_AT_REST, degrees=True).as_matrix()
        # Columns of `rest` are the thumb's axes in the palm's, for either side: both are mirrored.
        axes = np.einsum("ji,...jk->...ik", rest, palm)
        usual[..., 0, :] = _carried(axes[..., 0, :], first[..., 0, :], axes[..., 1, :])
        return usual


def unit(vectors: Floats) -> Floats:
    """Return vectors divided by their lengths; NaN for those without one."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(vectors / length)


def _across(vectors: Floats, axis: Floats) -> Floats:
    """Return the parts of vectors at right angles to unit axes."""
    return np.asarray(vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis)


def _carried(start: Floats, end: Floats, vector: Floats) -> Floats:
    """Return vectors turned by the least rotation that takes one unit direction to another."""
    cosine = np.sum(start * end, axis=-1, keepdims=True)
    cross = np.cross(start, end)
    along = np.sum(cross * vector, axis=-1, keepdims=True) * cross / np.maximum(1 + cosine, 1e-9)
    return np.asarray(cosine * vector + np.cross(cross, vector) + along)
