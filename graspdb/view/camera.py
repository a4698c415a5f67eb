"""Where a grasp is looked at from."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.view.scene import ELBOW, Scene

Floats = NDArray[np.float64]

FIELD_OF_VIEW: Final = np.deg2rad(26.0)
"""Vertical angle that is seen [rad]: a long lens, which distorts little."""

ELEVATIONS: Final = np.deg2rad([12.0, 32.0, 55.0])
AZIMUTHS: Final = np.deg2rad(np.arange(0, 360, 20))


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera in the object frame.

    Attributes
    ----------
    eye, target, up : ndarray, shape (3,)
        Where it is, what it looks at [m], and what is up in the picture.
    """

    eye: Floats
    target: Floats
    up: Floats

    def rays(self, width: int, height: int) -> Floats:
        """Return origin and unit direction of the ray through each pixel, shape (height, width, 6)."""
        forward = _unit(self.target - self.eye)
        right = _unit(np.cross(forward, self.up))
        above = np.cross(right, forward)
        tangent = np.tan(FIELD_OF_VIEW / 2)
        x = (2 * (np.arange(width) + 0.5) / width - 1) * tangent * width / height
        y = (1 - 2 * (np.arange(height) + 0.5) / height) * tangent
        directions = forward + x[None, :, None] * right + y[:, None, None] * above
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return np.concatenate([np.broadcast_to(self.eye, directions.shape), directions], axis=-1)


def frame_of(scene: Scene, object_alone: bool = False) -> tuple[Floats, float]:
    """Return centre and radius [m] of a sphere round the object, and round the hand without the forearm."""
    hand = scene.nodes[np.arange(len(scene.nodes)) != ELBOW][: 0 if object_alone else None]
    points = np.concatenate([scene.surface.points, hand])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return np.zeros(3), 0.1
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.linalg.norm(points - centre, axis=1).max()) + 0.01


def cameras_around(scene: Scene, object_alone: bool = False) -> list[Camera]:
    """Return cameras that see all of a grasp, from all round, level to steep, with the lab's vertical up."""
    centre, radius = frame_of(scene, object_alone)
    distance = radius / np.sin(FIELD_OF_VIEW / 2)
    return [
        Camera(centre + distance * direction, centre, scene.up) for direction in directions_around(scene.up)
    ]


def directions_around(up: Floats) -> Floats:
    """Return directions to look from, all round and from level to steep, shape (n, 3)."""
    first = _unit(np.cross(up, np.eye(3)[np.argmin(np.abs(up))]))
    second = np.cross(up, first)
    return np.array(
        [
            np.cos(e) * (np.cos(a) * first + np.sin(a) * second) + np.sin(e) * up
            for e in ELEVATIONS
            for a in AZIMUTHS
        ]
    )


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
