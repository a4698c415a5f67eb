"""The surface of a posed hand as a closed mesh."""

from typing import Final

import numpy as np
import trimesh

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.surface.hand_surface import HandSurface
from graspdb_ingest.surface.rounded import rounded_distances
from graspdb_schemas.errors import ParameterError

PADDING: Final = 2
"""Cells of the grid around each shape."""


def closed_mesh(surface: HandSurface, spacing: float = 0.002) -> trimesh.Trimesh:
    """Return the mesh that wraps around a posed hand's shapes.

    It is the surface of zero distance on a grid, its vertices moved onto the shapes.

    Parameters
    ----------
    surface : HandSurface
        A single posed hand; finite.
    spacing : float
        Size of the grid's cells [m].

    Returns
    -------
    trimesh.Trimesh
        A watertight mesh [m], faces counter-clockwise seen from outside; in one piece where the shapes are.

    Raises
    ------
    ParameterError
        If the spacing is not positive, or the hand is not known.
    """
    if not spacing > 0:
        raise ParameterError("spacing", spacing, "a positive distance in metres")
    if not np.isfinite(surface.centres).all():
        raise ParameterError("key points", "some that are not finite", "finite positions")
    margin = surface.radii[:, None] + (PADDING + 1) * spacing
    origin = (surface.centres - margin).min(axis=0)
    shape = np.ceil(((surface.centres + margin).max(axis=0) - origin) / spacing).astype(int) + 1
    field = _field(surface, origin, shape, spacing)
    open3d = load_open3d()
    # Open3D takes the volume as [z, y, x].
    volume = open3d.core.Tensor(np.ascontiguousarray(field.transpose(2, 1, 0), dtype=np.float32))
    found = open3d.t.geometry.TriangleMesh.create_isosurfaces(volume)
    vertices = origin + spacing * found.vertex.positions.numpy().astype(np.float64)
    mesh = trimesh.Trimesh(_onto(surface, vertices), found.triangle.indices.numpy(), process=True)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def _field(surface: HandSurface, origin: Floats, shape: Floats, spacing: float) -> Floats:
    """Return the distance at each point of a grid, or a few cells where every shape is further away."""
    field = np.full(tuple(shape), PADDING * spacing)
    for corners in surface.shapes:
        margin = surface.radii[corners][:, None] + PADDING * spacing
        low = np.floor(((surface.centres[corners] - margin).min(axis=0) - origin) / spacing).astype(int)
        high = np.ceil(((surface.centres[corners] + margin).max(axis=0) - origin) / spacing).astype(int) + 1
        box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        axes = [origin[i] + spacing * np.arange(low[i], high[i]) for i in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        distance = rounded_distances(points, surface.centres, surface.radii, corners[None]).distance
        field[box] = np.minimum(field[box], distance.reshape(field[box].shape))
    return field


def _onto(surface: HandSurface, vertices: Floats) -> Floats:
    """Return vertices moved onto the surface along the direction to the nearest sphere's centre."""
    found = surface.distances(vertices)
    centres, radii = surface.sphere_at(found.shape, found.weights)
    arms = vertices - centres
    return np.asarray(centres + arms * (radii / np.linalg.norm(arms, axis=1))[:, None])
