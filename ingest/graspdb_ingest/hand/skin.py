"""Skin under markers: how markers slide on their segments when joints flex.

A marker over a joint moves along the segment in proportion to the angle, as the skin is drawn over
the joint (Zhang, Lee and Braido, J. Biomech. 36, 2003, 1097-1102). The slopes are found by calibration and
kept in the hand's MJCF as numbers of the names ``skin_reference`` and ``skin_<marker>``.
"""

from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]

REFERENCE: Final = "skin_reference"
PREFIX: Final = "skin_"


@dataclass(frozen=True)
class Skin:
    """Displacement of markers in their segments' x and y, linear in the joint angles.

    Attributes
    ----------
    reference : ndarray, shape (n_hinges,)
        Angles at which markers lie at the places that the model gives [rad].
    slopes : ndarray, shape (n_markers, 2, n_hinges)
        Displacement along and across the segment for each radian [m/rad].
    """

    reference: Floats
    slopes: Floats

    def displacement(self, angles: Floats, rotations: Floats) -> Floats:
        """Return the markers' displacement in the lab frame [m], shape (..., n_markers, 3).

        Parameters
        ----------
        angles : ndarray, shape (..., n_hinges)
            Joint angles [rad].
        rotations : ndarray, shape (..., n_markers, 3, 3)
            world_from_segment of each marker's segment.
        """
        local = np.tensordot(angles - self.reference, self.slopes, axes=(-1, 2))
        return np.asarray((rotations[..., :2] @ local[..., None])[..., 0])

    def jacobian(self, rotations: Floats) -> Floats:
        """Return d(displacement) / d(joint angle), shape (n_markers, 3, n_hinges); rotations as above."""
        return np.asarray(rotations[..., :2] @ self.slopes)


def read_skin(model: mujoco.MjModel, markers: tuple[str, ...]) -> Skin | None:
    """Return the skin that a hand's MJCF describes, None where it has none."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, REFERENCE) < 0:
        return None
    reference = np.array(model.numeric(REFERENCE).data)
    slopes = np.zeros((len(markers), 2, len(reference)))
    for i, marker in enumerate(markers):
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, PREFIX + marker) >= 0:
            slopes[i] = np.array(model.numeric(PREFIX + marker).data).reshape(2, -1)
    return Skin(reference, slopes)


def write_skin(spec: mujoco.MjSpec, markers: tuple[str, ...], skin: Skin) -> None:
    """Put a skin into a hand's MJCF in the place of any that is there."""
    mine = {REFERENCE, *(PREFIX + marker for marker in markers)}
    for number in [number for number in spec.numerics if number.name in mine]:
        spec.delete(number)
    spec.add_numeric(name=REFERENCE, data=skin.reference, size=len(skin.reference))
    for marker, slopes in zip(markers, skin.slopes, strict=True):
        if slopes.any():
            spec.add_numeric(name=PREFIX + marker, data=slopes.ravel(), size=slopes.size)
