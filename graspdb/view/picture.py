"""Still pictures of grasps, by ray casting: no display, no graphics driver, the same pixels every time."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.view import palette
from graspdb.view.camera import Camera, cameras_around
from graspdb.view.scene import Scene
from graspdb.view.shapes import Floats, Triangles, capsule, joined, sphere
from graspdb_ingest.objects.open3d_library import load_open3d

Pixels = NDArray[np.uint8]
Image = NDArray[np.floating[Any]]
"""Numbers at each pixel."""

SAMPLES: Final = 2
"""Rays across a pixel, and down it."""

HAND_OPACITY: Final = 0.5
COVERED: Final = 0.35
"""What a feature or a touching sphere is worth seeing behind the hand, over its worth in plain sight."""

HULL_OPACITY: Final = 0.16
OUTLINE_STEP: Final = 0.006
"""A step in depth that is drawn as an outline [m]."""


@dataclass(frozen=True)
class Shown:
    """What a picture shows.

    Attributes
    ----------
    hand, hull, feature, contacts : bool
        Segments of the hand; the enclosing space; the feature in its colour; contact points.
    contact_map : bool
        The gaps of the object's points as colours, in place of the feature.
    """

    hand: bool = True
    hull: bool = True
    feature: bool = True
    contacts: bool = True
    contact_map: bool = False


EVERYTHING: Final = Shown()


def picture(
    scene: Scene,
    width: int = 480,
    height: int = 480,
    *,
    shown: Shown = EVERYTHING,
    camera: Camera | None = None,
) -> Pixels:
    """Return a picture of a grasp on transparent ground.

    Parameters
    ----------
    scene : Scene
        The grasp.
    width, height : int
        Size in pixels.
    shown : Shown
        What is drawn.
    camera : Camera, optional
        Where it is seen from; else from where most of feature and contacts is seen.

    Returns
    -------
    ndarray of uint8, shape (height, width, 4)
        Red, green, blue and opacity.
    """
    camera = camera or best_camera(scene)
    rays = camera.rays(SAMPLES * width, SAMPLES * height).astype(np.float32)
    light = _light(camera)
    colour, depth = _layer(joined(_solid(scene, shown)), rays, light)
    layers = [(*_layer(joined(_hand(scene)), rays, light), HAND_OPACITY)] if shown.hand else []
    if shown.hull and len(scene.grasp.hull_faces):
        layers.append((*_layer(_hull(scene), rays, light), HULL_OPACITY))
    image = np.concatenate([colour, np.isfinite(depth)[..., None]], axis=-1, dtype=np.float32)
    _outline(image, depth, 0.55)
    for over, distance, opacity in sorted(layers, key=lambda layer: layer[2], reverse=True):
        _blend(image, over, np.where(distance < depth, opacity, 0.0))
        _outline(image, np.where(distance < depth, distance, np.inf), 0.3 + 0.3 * opacity)
    return _reduced(image)


def surface_picture(scene: Scene, colours: Floats, camera: Camera, width: int, height: int) -> Pixels:
    """Return a picture of the object alone with a colour for each of its points, shape (n, 3)."""
    rays = camera.rays(SAMPLES * width, SAMPLES * height).astype(np.float32)
    surface = scene.surface
    shape = Triangles(surface.points, surface.normals, colours, surface.faces)
    colour, depth = _layer(shape, rays, _light(camera))
    image = np.concatenate([colour, np.isfinite(depth)[..., None]], axis=-1, dtype=np.float32)
    _outline(image, depth, 0.55)
    return _reduced(image)


def best_camera(scene: Scene) -> Camera:
    """Return the camera that sees most of the touching spheres and of the feature past the hand."""
    parts = _solid(scene, Shown(contacts=False))
    solid, hand = _cast(joined(parts)), _cast(joined(_hand(scene)))
    wanted = np.concatenate([np.full(len(part.faces), weight) for part, weight in _weighted(scene, parts)])
    cameras = cameras_around(scene)
    best, most = cameras[0], -1.0
    for camera in cameras:
        rays = camera.rays(48, 48).astype(np.float32)
        hit, over = solid.cast_rays(rays), hand.cast_rays(rays)
        faces = hit["primitive_ids"].numpy()
        seen = np.isfinite(hit["t_hit"].numpy())
        covered = over["t_hit"].numpy() < hit["t_hit"].numpy()
        values = np.where(seen, wanted[np.where(seen, faces, 0)], 0.0) * np.where(covered, COVERED, 1.0)
        value = float(values.sum()) + 0.1 * float(np.isfinite(over["t_hit"].numpy()).sum())
        if value > most:
            best, most = camera, value
    return best


def png(pixels: Pixels) -> bytes:
    """Return a picture as the bytes of a PNG file."""
    from io import BytesIO

    import PIL.Image

    file = BytesIO()
    PIL.Image.fromarray(pixels).save(file, "png", optimize=True)
    return file.getvalue()


def _solid(scene: Scene, shown: Shown) -> list[Triangles]:
    """Return the object, the spheres that touch, and the contact points."""
    surface = scene.surface
    parts = [Triangles(surface.points, surface.normals, object_colours(scene, shown), surface.faces)]
    touching = [i for i in np.flatnonzero(scene.touching) if np.isfinite(scene.nodes[i]).all()]
    parts += [sphere(scene.nodes[i], scene.radii[i], palette.rgb(palette.TOUCHING)) for i in touching]
    if shown.contacts:
        parts += _contacts(scene)
    return parts


def _weighted(scene: Scene, parts: list[Triangles]) -> list[tuple[Triangles, float | Floats]]:
    """Return how much each triangle of the solid parts is worth seeing."""
    feature = np.zeros(len(scene.surface.points))
    feature[scene.feature] = 1.0
    faces = feature[scene.surface.faces].mean(axis=1) if len(scene.surface.faces) else np.empty(0)
    return [(parts[0], faces), *((part, 2.0) for part in parts[1:])]


def object_colours(scene: Scene, shown: Shown = EVERYTHING) -> Floats:
    """Return the colour of each of the object's points, shape (n, 3), from 0 to 1."""
    colours = np.tile(palette.rgb(palette.OBJECT), (len(scene.surface.points), 1))
    if shown.contact_map and scene.contact_map is not None:
        colours[:] = palette.scale_colours(np.zeros(1))
        near = palette.nearness(scene.contact_map.gaps)
        colours[scene.contact_map.points] = palette.scale_colours(near)
    elif shown.feature:
        colours[scene.feature] = palette.rgb(palette.FEATURE)
    return colours


def _hand(scene: Scene) -> list[Triangles]:
    colour = palette.rgb(palette.HAND)
    parts = [capsule(start, end, r0, r1, colour) for _, start, end, r0, r1 in scene.capsules()]
    free = [i for i in np.flatnonzero(~scene.touching) if np.isfinite(scene.nodes[i]).all()]
    return parts + [sphere(scene.nodes[i], scene.radii[i], colour) for i in free]


def _contacts(scene: Scene) -> list[Triangles]:
    """Return contact points as beads, and their normals as needles."""
    blue = palette.rgb(palette.CONTACT)
    known = np.isfinite(scene.grasp.contact_points).all(axis=1)
    points, normals = scene.grasp.contact_points[known], scene.grasp.contact_normals[known]
    needles = [
        capsule(p, p + 0.018 * n, 0.0009, 0.0005, blue)
        for p, n in zip(points, normals, strict=True)
        if np.isfinite(n).all()
    ]
    return [sphere(point, 0.0028, blue) for point in points] + needles


def _hull(scene: Scene) -> Triangles:
    vertices, faces = scene.grasp.hull_vertices, scene.grasp.hull_faces
    away = vertices - vertices.mean(axis=0)
    normals = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    return Triangles(vertices, normals, np.tile(palette.rgb(palette.HULL), (len(vertices), 1)), faces)


def _light(camera: Camera) -> Floats:
    """Return the direction to the light: over the camera's left shoulder."""
    back = camera.eye - camera.target
    back = back / np.linalg.norm(back)
    left = np.cross(back, camera.up)
    direction = back + 0.55 * camera.up + 0.35 * left / max(float(np.linalg.norm(left)), 1e-9)
    return np.asarray(direction / np.linalg.norm(direction))


def _cast(triangles: Triangles) -> Any:
    open3d = load_open3d()
    casting = open3d.t.geometry.RaycastingScene(nthreads=1)
    if len(triangles.faces):
        core = open3d.core
        casting.add_triangles(
            core.Tensor(np.ascontiguousarray(triangles.vertices, dtype=np.float32)),
            core.Tensor(np.ascontiguousarray(triangles.faces, dtype=np.uint32)),
        )
    return casting


def _layer(triangles: Triangles, rays: NDArray[np.float32], light: Floats) -> tuple[Image, Image]:
    """Return colour (h, w, 3) and depth (h, w) [m] of what rays meet first; infinite where nothing."""
    depth = np.full(rays.shape[:2], np.inf)
    colour = np.zeros((*rays.shape[:2], 3), dtype=np.float32)
    if not len(triangles.faces):
        return colour, depth
    hit = _cast(triangles).cast_rays(rays)
    depth = hit["t_hit"].numpy()
    met = np.isfinite(depth)
    corners = triangles.faces[hit["primitive_ids"].numpy()[met]]
    u, v = hit["primitive_uvs"].numpy()[met].T
    weights = np.stack([1 - u - v, u, v], axis=-1)
    normals = np.einsum("nk,nki->ni", weights, triangles.normals.astype(np.float32)[corners])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    toward = -rays[met, 3:]
    # Surfaces are seen from either side: a thin wall's inner side faces away.
    normals = np.where(np.sum(normals * toward, axis=1, keepdims=True) < 0, -normals, normals)
    base = np.einsum("nk,nki->ni", weights, triangles.colours.astype(np.float32)[corners])
    colour[met] = _shaded(base, normals, toward, light.astype(np.float32))
    return colour, depth


def _shaded(base: Image, normals: Image, toward: Image, light: Image) -> Image:
    """Shade by a soft light, a faint one from the other side, and a small highlight."""
    facing = np.sum(normals * light, axis=1, keepdims=True)
    half = light + toward
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    gleam = np.maximum(np.sum(normals * half, axis=1, keepdims=True), 0) ** 40
    shade = 0.52 + 0.5 * np.maximum(facing, 0) - 0.12 * np.maximum(-facing, 0)
    edge = 1 - np.sum(normals * toward, axis=1, keepdims=True)
    return np.asarray(np.clip(base * shade * (1 - 0.35 * edge**3) + 0.14 * gleam, 0, 1))


def _blend(image: Image, over: Image, opacity: Image) -> None:
    """Lay colours over an image in place."""
    covered = opacity > 0
    alpha, under = opacity[covered, None], image[covered, 3:]
    total = alpha + under * (1 - alpha)
    mixed = over[covered] * alpha + image[covered, :3] * under * (1 - alpha)
    image[covered] = np.concatenate([mixed / total, total], axis=-1)


def _outline(image: Image, depth: Image, strength: float) -> None:
    """Darken, in place, the nearer side of steps in depth."""
    filled = np.where(np.isfinite(depth), depth, 1e3)
    edge = np.zeros(filled.shape, dtype=bool)
    across, down = np.diff(filled, axis=1), np.diff(filled, axis=0)
    edge[:, :-1] |= across > OUTLINE_STEP
    edge[:, 1:] |= across < -OUTLINE_STEP
    edge[:-1] |= down > OUTLINE_STEP
    edge[1:] |= down < -OUTLINE_STEP
    _blend(image, np.broadcast_to(palette.rgb(palette.INK), (*edge.shape, 3)), np.where(edge, strength, 0.0))


def _reduced(image: Image) -> Pixels:
    """Return the mean over the samples of each pixel, colours weighted by opacity."""
    height, width = image.shape[0] // SAMPLES, image.shape[1] // SAMPLES
    blocks = image.reshape(height, SAMPLES, width, SAMPLES, 4)
    alpha = blocks[..., 3:].sum(axis=(1, 3))
    colour = (blocks[..., :3] * blocks[..., 3:]).sum(axis=(1, 3)) / np.where(alpha > 0, alpha, 1)
    reduced = np.concatenate([colour, alpha / SAMPLES**2], axis=-1)
    return np.asarray(np.round(255 * reduced), dtype=np.uint8)
