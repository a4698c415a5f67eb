"""A grasp as a scene of meshes: binary glTF, which browsers, Blender and game engines open."""

from importlib import import_module
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb.export.closed_surface import ClosedSurface
from graspdb.export.held import HeldObject
from graspdb.export.items import Floats
from graspdb.view.scene import CAPSULE_SHARE, ELBOW, SEGMENTS_DRAWN

trimesh: Any = import_module("trimesh")  # its functions have types in part alone
Geometry: TypeAlias = Any
Rgba = tuple[int, int, int, int]

OBJECT: Final[Rgba] = (190, 196, 205, 255)
HAND: Final[Rgba] = (224, 178, 150, 255)
FREE: Final[Rgba] = (120, 150, 200, 255)
TOUCHING: Final[Rgba] = (200, 40, 40, 255)
HULL: Final[Rgba] = (130, 130, 130, 90)
FEATURE: Final[Rgba] = (30, 140, 60, 255)
CONTACT: Final[Rgba] = (20, 20, 20, 255)

CONTACT_RADIUS: Final = 0.0015
"""Radius of a drawn contact point, and of the rod along its normal [m]."""

NORMAL_LENGTH: Final = 0.02
"""Length of a drawn normal [m]."""


def write_glb(path: Path, held: HeldObject, surface: ClosedSurface | None) -> None:
    """Write a grasp as binary glTF: metres, y up as glTF has it, a node for each kind of thing.

    Nodes: object, hand, sites_touching, sites_free, hull, feature (points), contacts. Meshes have the
    coordinates of the object frame; the nodes' rotation brings the vertical to y.

    Parameters
    ----------
    path : Path
        The file.
    held : HeldObject
        The grasp.
    surface : ClosedSurface or None
        Surface of the object; without it, its points are shown.
    """
    scene = trimesh.Scene()
    upright = np.eye(4)
    upright[:3, :3] = Rotation.align_vectors([[0.0, 1.0, 0.0]], [_up(held)])[0].as_matrix()
    parts = {
        "object": _cloud(held.cloud.points, OBJECT)
        if surface is None
        else _mesh(trimesh.Trimesh(surface.vertices, surface.faces, process=False), OBJECT),
        "hand": _joined(_bones(held), HAND),
        "sites_touching": _joined(_spheres(held, held.touching), TOUCHING),
        "sites_free": _joined(_spheres(held, ~held.touching), FREE),
        "hull": _hull(held),
        "feature": _cloud(held.grasp.feature_cloud, FEATURE),
        "contacts": _joined(_contacts(held), CONTACT),
    }
    for name, part in parts.items():
        if part is not None:
            scene.add_geometry(part, node_name=name, geom_name=name, transform=upright)
    scene.metadata["grasp"] = held.grasp.id
    path.write_bytes(scene.export(file_type="glb"))


def _up(held: HeldObject) -> Floats:
    """Return the vertical in the object frame; its z axis where the lab is not known."""
    if held.up is None or held.world_from_object is None:
        return np.array([0.0, 0.0, 1.0])
    return np.asarray(held.world_from_object[:3, :3].T @ held.up)


def _bones(held: HeldObject) -> list[Geometry]:
    nodes = np.vstack([held.grasp.sites, held.wrist[None]])
    bones = []
    for segment in SEGMENTS_DRAWN:
        ends = [segment.start, segment.end]
        if ELBOW in ends or not np.isfinite(nodes[ends]).all():
            continue
        radius = CAPSULE_SHARE * float(held.radii[segment.end])
        if np.isfinite(radius) and np.linalg.norm(np.diff(nodes[ends], axis=0)) > 0:
            bones.append(_rod(nodes[segment.start], nodes[segment.end], radius))
    return bones


def _spheres(held: HeldObject, which: np.ndarray) -> list[Geometry]:
    known = which & np.isfinite(held.grasp.sites).all(axis=1) & np.isfinite(held.radii)
    return [_ball(held.grasp.sites[i], float(held.radii[i])) for i in np.flatnonzero(known)]


def _contacts(held: HeldObject) -> list[Geometry]:
    grasp, drawn = held.grasp, []
    for point, normal in zip(grasp.contact_points, grasp.contact_normals, strict=True):
        if np.isfinite(point).all() and np.isfinite(normal).all():
            drawn += [
                _ball(point, 2 * CONTACT_RADIUS),
                _rod(point, point + NORMAL_LENGTH * normal, CONTACT_RADIUS),
            ]
    return drawn


def _hull(held: HeldObject) -> Geometry | None:
    grasp = held.grasp
    if not len(grasp.hull_faces):
        return None
    return _mesh(trimesh.Trimesh(grasp.hull_vertices, grasp.hull_faces, process=False), HULL)


def _rod(start: Floats, end: Floats, radius: float) -> Geometry:
    """Return a capsule between two points."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    rod = trimesh.creation.capsule(height=length, radius=radius, count=[12, 12])
    pose = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis / length)
    pose[:3, 3] = (start + end) / 2
    middle = np.eye(4)
    middle[2, 3] = -rod.bounds.mean(axis=0)[2]
    rod.apply_transform(pose @ middle)
    return rod


def _ball(center: Floats, radius: float) -> Geometry:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    ball.apply_translation(center)
    return ball


def _joined(meshes: list[Geometry], color: Rgba) -> Geometry | None:
    return _mesh(trimesh.util.concatenate(meshes), color) if meshes else None


def _mesh(mesh: Geometry, color: Rgba) -> Geometry:
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=color,
        metallicFactor=0.0,
        roughnessFactor=0.8,
        alphaMode="OPAQUE" if color[3] == 255 else "BLEND",
        doubleSided=True,
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def _cloud(points: Floats, color: Rgba) -> Geometry | None:
    return trimesh.PointCloud(points, colors=np.tile(color, (len(points), 1))) if len(points) else None
