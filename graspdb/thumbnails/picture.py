"""Pictures of grasps: where they are seen from, what is drawn, its colours."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from graspdb.thumbnails.raster import NOTHING, Raster
from graspdb.thumbnails.shapes import GraspShape
from graspdb.view.palette import FEATURE, HAND, HULL, OBJECT, TOUCHING, rgb, scale_colours
from graspdb_schemas.vocabulary import SITES

Floats = NDArray[np.float64]

_DARKER_HAND: Final = "#cf9f78"
"""Spheres that do not touch, set off against the segments."""

_OBJECT, _FEATURE, _HAND, _SPHERE, _TOUCHING = range(1, 6)

_COLOURS: Final = 255 * np.array(
    [(0, 0, 0), *(rgb(colour) for colour in (OBJECT, FEATURE, HAND, _DARKER_HAND, TOUCHING))]
)
"""Colour of each material, told apart without red-green vision: by lightness as well as by hue."""

_HULL: Final = 255 * rgb(HULL)
_HULL_OPACITY: Final = 0.32
_LIGHT: Final = np.array((-0.45, 0.6, 0.66))
_FINER: Final = 2
"""Pixels drawn, along a side, for each of the picture: smooth edges."""


def _tipped(about_up: float, forward: float) -> Floats:
    """Return what turns axes of a picture about its vertical, then tips it forward [degree]."""
    (c, d), (s, t) = (f(np.radians((about_up, forward))) for f in (np.cos, np.sin))
    turned = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return np.asarray(np.array([[1, 0, 0], [0, d, -t], [0, t, d]]) @ turned)


_TIPPED: Final = _tipped(-32.0, 24.0)
"""How the hand is turned from its radial view, to be seen from a little behind and above."""

_LEVELS: Final = 64
"""Colours of a scale."""

_AROUND: Final = 0.05
"""How much of the object is shown beyond the hand [m]."""

_OUTLINE: Final = 0.004
"""Steps in depth from here on have an outline [m]."""

_UNKNOWN_HAND: Final = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], dtype=float)
"""Axes of the picture where the hand is not known: the object's own."""

_FILLED: Final = 0.94
"""Share of the picture's side that what is shown takes."""

_SPACING: Final = 0.0022
"""Radius of the discs that points of an object are drawn as, a little more than their spacing [m]."""

_SLIMMER: Final = 0.85
"""Thickness of segments beside that of the spheres at their ends."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture.

    Attributes
    ----------
    pixels : ndarray of uint8, shape (size, size, 4)
        Red, green, blue, opacity; the ground is transparent, for light and dark pages.
    """

    pixels: NDArray[np.uint8]

    def webp(self) -> bytes:
        """Return the picture as a WebP file."""
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(self.pixels).save(file, "WEBP", quality=82, method=2)
        return file.getvalue()


def draw(shape: GraspShape, size: int = 160) -> Picture:
    """Draw a grasp as it is at its snapshot: object, feature green, hand, touching spheres red, hull grey.

    It is seen from the hand's radial side and a little from above, so that grasps of one kind look alike
    whatever way the object lay.

    Parameters
    ----------
    shape : GraspShape
        The grasp.
    size : int
        Pixels along a side.
    """
    camera = _camera(shape)
    scale, middle = _frame(shape, camera, size * _FINER)

    def seen(points: Floats) -> Floats:
        return (points @ camera.T - middle) * scale + [0.5 * size * _FINER, 0.5 * size * _FINER, 0.0]

    raster = Raster.empty(size * _FINER)
    _add_object(raster, shape, seen(shape.object.points), shape.object.normals @ camera.T, scale)
    _add_hand(raster, shape, seen, scale)
    colour = _shaded(raster, _OUTLINE * scale, _COLOURS)
    if len(shape.hull):
        _cover(colour, raster.depth, seen(shape.hull))
    return Picture(_reduced(colour))


def draw_shaded(points: Floats, normals: Floats, shares: Floats, turn: float, size: int = 220) -> Picture:
    """Draw the surface of an object in the colours of a scale.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Its cloud [m], object frame; z is up in the picture.
    shares : ndarray, shape (n,)
        Where on the scale each point is, from 0 to 1.
    turn : float
        How far it is turned about z [rad].
    size : int
        Pixels along a side.
    """
    c, s = np.cos(turn), np.sin(turn)
    camera = _TIPPED @ _UNKNOWN_HAND @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    seen = points @ camera.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = _FILLED * size * _FINER / max(float((high - low)[:2].max()), 1e-3)
    placed = (seen - 0.5 * (low + high)) * scale + [0.5 * size * _FINER, 0.5 * size * _FINER, 0.0]
    levels = scale_colours(np.linspace(0, 1, _LEVELS))
    material = 1 + np.round((_LEVELS - 1) * np.clip(shares, 0, 1)).astype(np.int64)
    raster = Raster.empty(size * _FINER)
    raster.add_discs(placed, normals @ camera.T, max(_SPACING * scale, 0.75), material)
    return Picture(_reduced(_shaded(raster, _OUTLINE * scale, 255 * np.vstack([np.zeros(3), levels]))))


def _camera(shape: GraspShape) -> Floats:
    """Return the axes of the picture, shape (3, 3): to the right, up, to the eye."""
    index, middle, little = (
        shape.sites[SITES.index(f"{digit}_mcp")] for digit in ("index", "middle", "little")
    )
    radial = index - little
    dorsal = np.cross(middle - shape.wrist, radial) * (-1 if shape.side == "left" else 1)
    eye = radial - dorsal * (radial @ dorsal) / max(dorsal @ dorsal, np.finfo(float).tiny)
    base = np.stack([np.cross(dorsal, eye), dorsal, eye])
    length = np.linalg.norm(base, axis=1, keepdims=True)
    base = base / length if np.isfinite(length).all() and length.all() else _UNKNOWN_HAND
    return np.asarray(_TIPPED @ base)


def _frame(shape: GraspShape, camera: Floats, size: int) -> tuple[float, Floats]:
    """Return pixels a metre, and what is shown in the middle, shape (3,), in the camera's axes [m]."""
    ends, radii = shape.bones()
    hand = (ends.reshape(-1, 3) @ camera.T)[:, :2]
    low, high = hand.min(axis=0, initial=np.inf), hand.max(axis=0, initial=-np.inf)
    reach = radii.max(initial=0.0)
    body = (shape.object.points @ camera.T)[:, :2]
    body = body[np.isfinite(body).all(axis=1)]
    if len(body):
        near = (
            (body >= low - _AROUND).all(axis=1) & (body <= high + _AROUND).all(axis=1)
            if len(hand)
            else slice(None)
        )
        low = np.minimum(low - reach, body[near].min(axis=0, initial=np.inf))
        high = np.maximum(high + reach, body[near].max(axis=0, initial=-np.inf))
    if not np.isfinite([low, high]).all():
        return 1.0, np.zeros(3)
    extent = max(float((high - low).max()), 1e-3)
    return _FILLED * size / extent, np.append(0.5 * (low + high), 0.0)


def _add_object(raster: Raster, shape: GraspShape, points: Floats, normals: Floats, scale: float) -> None:
    material = np.full(len(points), _OBJECT)
    material[shape.feature] = _FEATURE
    shown = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
    raster.add_discs(points[shown], normals[shown], max(_SPACING * scale, 0.75), material[shown])


def _add_hand(raster: Raster, shape: GraspShape, seen: Callable[[Floats], Floats], scale: float) -> None:
    ends, radii = shape.bones()
    for pair, thickness in zip(ends, _SLIMMER * radii.min(axis=1), strict=True):
        raster.add_cylinder(seen(pair), scale * thickness, _HAND)
    if np.isfinite(shape.wrist).all():
        raster.add_sphere(seen(shape.wrist), scale * float(shape.radii.max()), _HAND)
    for i in np.flatnonzero(np.isfinite(shape.sites).all(axis=1)):
        material = _TOUCHING if shape.touching[i] else _SPHERE
        raster.add_sphere(seen(shape.sites[i]), scale * float(shape.radii[i]), material)


def _shaded(raster: Raster, outline: float, colours: Floats) -> Floats:
    """Return colours, shape (size, size, 4), 0 to 255, with a dark line where depth steps by `outline`."""
    light = _LIGHT / np.linalg.norm(_LIGHT)
    brightness = 0.62 + 0.42 * np.maximum(raster.normal @ light, 0.0)
    there = raster.material != NOTHING
    colour = colours[raster.material] * brightness[..., None]
    depth = np.where(there, raster.depth, -1e6)
    step = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        for shift in (1, -1):
            step |= np.roll(depth, shift, axis) < depth - outline
    colour[step & there] *= 0.45
    return np.dstack([np.minimum(colour, 255), 255.0 * there])


def _cover(colour: Floats, depth: Floats, hull: Floats) -> None:
    """Lay the enclosing space over a picture, translucent where it is nearer than what is seen."""
    try:
        planes = ConvexHull(hull).equations
    except QhullError:
        return
    low = np.maximum(np.floor(hull[:, :2].min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(hull[:, :2].max(axis=0)).astype(int), len(depth))
    if (high <= low).any():
        return
    x, y = np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    near, far = np.full((len(y), len(x)), np.inf), np.full((len(y), len(x)), -np.inf)
    for a, b, c, d in planes:
        bound = -(a * x + (b * y)[:, None] + d) / (c if abs(c) > 1e-9 else np.copysign(1e-9, c))
        if c > 0:
            np.minimum(near, bound, out=near)
        else:
            np.maximum(far, bound, out=far)
    cover = np.where((near > far) & (near > depth[window]), _HULL_OPACITY, 0.0)
    part = colour[window]
    opacity = cover * 255 + part[..., 3] * (1 - cover)
    mixed = _HULL * (cover * 255)[..., None] + part[..., :3] * (part[..., 3] * (1 - cover))[..., None]
    part[..., :3] = mixed / np.maximum(opacity, 1e-9)[..., None]
    part[..., 3] = opacity


def _reduced(colour: Floats) -> NDArray[np.uint8]:
    """Return the picture from finer pixels, y down; colours count by their opacity."""
    size = len(colour) // _FINER
    opacity = colour[..., 3:]
    fine = np.dstack([colour[..., :3] * opacity, opacity]).reshape(size, _FINER, size, _FINER, 4)
    coarse = fine.mean(axis=(1, 3))
    coarse[..., :3] /= np.maximum(coarse[..., 3:], 1e-9)
    return np.asarray(np.round(coarse[::-1]), dtype=np.uint8)
