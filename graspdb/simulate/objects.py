"""The paper's objects: a bottle, a mug, a milk jug and an inverted T with two force panels.

Every object stands on the plane z = 0 of its own frame with its axis along z; a handle lies on
the side of positive x. Sizes vary a little from one random generator to the next.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline

from graspdb.simulate.arrays import Floats
from graspdb.simulate.shapes import box, revolve, rounded, superellipse_loft, tube
from graspdb.simulate.surface import Surface


@dataclass(frozen=True)
class SimulatedObject:
    """A body with a closed surface, markers and named measures.

    Attributes
    ----------
    name : str
        Name in the session, and its category.
    parts : tuple of trimesh.Trimesh
        Watertight parts [m]; a handle runs a little way into the wall that carries it.
    mass : float
        Mass [kg].
    markers : ndarray, shape (4, 3)
        Markers on the surface, where no grasp touches [m].
    measures : dict of str to float
        The lengths that grasps are planned with [m].
    """

    name: str
    parts: tuple[trimesh.Trimesh, ...]
    mass: float
    markers: Floats
    measures: dict[str, float]

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """All parts as one mesh."""
        faces, vertices, count = [], [], 0
        for part in self.parts:
            faces.append(np.asarray(part.faces) + count)
            vertices.append(np.asarray(part.vertices))
            count += len(part.vertices)
        return trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)

    @cached_property
    def surface(self) -> Surface:
        """Signed distances to it."""
        return Surface(self.parts)

    @property
    def marker_labels(self) -> tuple[str, ...]:
        """Labels of its markers."""
        return tuple(f"{self.name}_{i + 1}" for i in range(len(self.markers)))


def make_bottle(rng: np.random.Generator) -> SimulatedObject:
    """Return a bottle with a shoulder, a neck and a cap."""
    body = rng.uniform(0.031, 0.035)
    cap = rng.uniform(0.0145, 0.0165)
    shoulder, neck, cap_low = 0.135, 0.170, 0.186
    height = cap_low + rng.uniform(0.022, 0.026)
    corners = np.array(
        [
            [0.004, 0.0],
            [body, 0.0],
            [body, shoulder],
            [cap - 0.003, neck],
            [cap - 0.003, cap_low],
            [cap, cap_low],
            [cap, height],
            [0.002, height],
        ]
    )
    profile = rounded(corners, [0.006, 0.03, 0.02, 0.0005, 0.0005, 0.0015])
    measures = {"radius": body, "shoulder": shoulder, "neck": cap - 0.003, "cap": cap}
    measures |= {"cap_low": cap_low, "neck_low": neck, "height": height}
    markers = np.array([*_ring(body, 0.012, (60, 180, 300)), [0.0, 0.0, height]])
    return SimulatedObject("bottle", (revolve(profile),), rng.uniform(0.35, 0.55), markers, measures)


def make_mug(rng: np.random.Generator) -> SimulatedObject:
    """Return a mug with its handle on the side of positive x."""
    outer, wall, bottom = rng.uniform(0.039, 0.042), 0.004, 0.006
    height = rng.uniform(0.094, 0.102)
    corners = np.array(
        [
            [0.004, 0.0],
            [outer, 0.0],
            [outer, height],
            [outer - wall, height],
            [outer - wall, bottom],
            [0.004, bottom],
        ]
    )
    profile = rounded(corners, [0.004, 0.0019, 0.0019, 0.006])
    reach = outer + rng.uniform(0.035, 0.039)
    inside = outer - 0.4 * wall
    low, high = 0.018, height - 0.014
    middle = (low + high) / 2
    path = np.array(
        [
            [inside, 0, high],
            [outer + 0.014, 0, high + 0.001],
            [reach, 0, high - 0.016],
            [reach + 0.001, 0, middle],
            [reach - 0.008, 0, low + 0.014],
            [outer + 0.010, 0, low],
            [inside, 0, low - 0.001],
        ]
    )
    handle = tube(_smooth(path), 0.0045, 0.0065)
    measures = {"radius": outer, "wall": wall, "height": height, "handle": reach, "handle_middle": middle}
    measures |= {"handle_depth": 0.0045, "handle_low": low, "handle_high": high}
    markers = _ring(outer, 0.010, (45, 135, 225, 315))
    return SimulatedObject("mug", (revolve(profile), handle), rng.uniform(0.3, 0.4), markers, measures)


def make_jug(rng: np.random.Generator) -> SimulatedObject:
    """Return a milk jug: nearly square, with a shoulder, a cap, and a handle on the side of positive x."""
    half = rng.uniform(0.041, 0.045)
    shoulder, neck = 0.150, 0.186
    cap = rng.uniform(0.018, 0.020)
    height = neck + rng.uniform(0.022, 0.025)
    corners = np.array(
        [[0.006, 0], [half, 0], [half, shoulder], [cap - 0.002, neck - 0.004], [cap - 0.002, neck]]
    )
    body = rounded(corners, [0.008, 0.03, 0.006])
    square = np.interp(body[:, 1], [0, shoulder - 0.01, neck - 0.006], [4.5, 4.5, 2.0])
    body = np.column_stack([body, square])
    rim = rounded(np.array([[cap, neck], [cap, height], [0.002, height]]), [0.0015])
    cap_profile = np.column_stack([rim, np.full(len(rim), 2.0)])
    low, high = 0.060, 0.166
    reach = half + rng.uniform(0.040, 0.044)
    inside = half - 0.004
    path = np.array(
        [
            [cap + 0.006, 0, high - 0.001],
            [half - 0.008, 0, high + 0.004],
            [reach - 0.012, 0, high - 0.003],
            [reach, 0, high - 0.026],
            [reach - 0.002, 0, (low + high) / 2],
            [reach - 0.012, 0, low + 0.016],
            [half + 0.010, 0, low + 0.002],
            [inside, 0, low],
        ]
    )
    handle = tube(_smooth(path), 0.0075, 0.0085)
    measures = {"radius": half, "shoulder": shoulder, "cap": cap, "cap_low": neck, "height": height}
    measures |= {"handle": reach, "handle_depth": 0.0075, "handle_low": low, "handle_high": high}
    corner = 2 ** (-1 / 4.5) * half
    around = np.array([[corner, corner], [-corner, corner], [-corner, -corner]])
    parts = (superellipse_loft(np.concatenate([body, cap_profile])), handle)
    markers = np.array([*np.column_stack([around, np.full(3, 0.016)]), [0.0, 0.0, height]])
    markers = Surface(parts).nearest(markers).point
    return SimulatedObject("jug", parts, rng.uniform(0.7, 1.0), markers, measures)


def make_inverted_t(rng: np.random.Generator) -> SimulatedObject:
    """Return the first experiment's object: a base and an upright with a long force panel on either side.

    The panels face positive and negative y.
    """
    half_grip = rng.uniform(0.029, 0.031)
    panel_low, panel_high, half_width = 0.035, 0.155, 0.020
    base, stem = 0.028, half_grip - 0.012
    parts = (
        box([-0.030, -0.085, 0.0], [0.030, 0.085, base]),
        box([-0.012, -stem, base - 0.002], [0.012, stem, panel_high + 0.005]),
        box([-half_width, stem - 0.002, panel_low], [half_width, half_grip, panel_high]),
        box([-half_width, -half_grip, panel_low], [half_width, -stem + 0.002, panel_high]),
    )
    markers = np.array(
        [[0.022, 0.078, base], [-0.022, 0.078, base], [0.022, -0.078, base], [0.0, 0.0, panel_high + 0.005]]
    )
    measures = {"half_grip": half_grip, "panel_low": panel_low, "panel_high": panel_high}
    measures |= {"half_width": half_width, "height": panel_high + 0.005}
    return SimulatedObject("inverted_t", parts, rng.uniform(0.4, 0.5), markers, measures)


OBJECTS: Final = {"bottle": make_bottle, "mug": make_mug, "jug": make_jug}
"""The second experiment's objects."""


def _ring(radius: float, height: float, degrees: tuple[float, ...]) -> Floats:
    angle = np.deg2rad(degrees)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(len(degrees), height)])


def _smooth(points: Floats, step: float = 0.003) -> Floats:
    """Return a smooth curve through points, by chord length."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.asarray(CubicSpline(along, points)(np.linspace(0, along[-1], int(along[-1] / step))))
