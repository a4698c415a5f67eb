"""An object's surface as an even point cloud: the paper's p_i (section II.B)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.parameters import CloudParameters
from graspdb_schemas.errors import ParameterError

Array = NDArray[np.float64]

LEAST_DISTANCE: Final = 0.92
"""Least distance of two points over the spacing asked for; their mean distance is then the spacing."""
CANDIDATES: Final = 10
"""Random points drawn for each point that is kept, about."""
MOST_POINTS: Final = 500_000
TURN: Final = 0.6
"""Weight of the normal in the distance of two candidates: the two sides of a thin wall stay apart."""
NEIGHBOURS: Final = 12
"""Neighbours from which the normal and the area of a bare cloud's point are estimated."""


@dataclass(frozen=True, eq=False)
class ObjectCloud:
    """Points spread evenly over an object's surface, in the object frame.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Positions p_i [m].
    normals : ndarray, shape (n, 3)
        Outward unit normals.
    areas : ndarray, shape (n,)
        Surface area that each point stands for [m2]; they sum to the surface's area.
    spacing : float
        Mean distance of a point to its nearest neighbour that was asked for [m].
    """

    points: Array
    normals: Array
    areas: Array
    spacing: float

    def __getstate__(self) -> dict[str, Any]:
        """Leave the search tree behind; it is built again where it is needed."""
        return {name: self.__dict__[name] for name in ("points", "normals", "areas", "spacing")}

    @cached_property
    def tree(self) -> cKDTree:
        """Search tree over the points."""
        return cKDTree(self.points)


def sample_cloud(surface: Surface, parameters: CloudParameters) -> ObjectCloud:
    """Spread points evenly over a surface.

    A mesh is covered with random candidates, of which every one is kept that is not too near to
    one kept before (dart throwing); each kept point stands for the area of the candidates nearest
    to it. A bare cloud is thinned in the same way. Equal surface, parameters and seed give equal
    points, bit for bit.

    Parameters
    ----------
    surface : Surface
        The mesh or cloud.
    parameters : CloudParameters
        Spacing and seed.

    Raises
    ------
    ParameterError
        If the spacing is not positive, or so small that the cloud would have too many points.
    """
    spacing = parameters.spacing
    if not spacing > 0:
        raise ParameterError("cloud.spacing", spacing, "a positive length in metres")
    if surface.faces is None:
        return _thinned(surface, spacing)
    area = float(surface.area or 0.0)
    if area / spacing**2 > MOST_POINTS:
        least = np.sqrt(area / MOST_POINTS)
        raise ParameterError(
            "cloud.spacing", spacing, f"at least {least:.2g} m for a surface of {area:.3g} m2"
        )
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    count = max(4 * NEIGHBOURS, int(CANDIDATES * area / spacing**2))
    candidates, faces = trimesh.sample.sample_surface(mesh, count, seed=parameters.seed)[:2]
    candidates, normals = np.asarray(candidates, dtype=float), np.asarray(mesh.face_normals)[faces]
    placed = np.hstack([candidates, TURN * LEAST_DISTANCE * spacing * normals])
    kept = _apart(placed, LEAST_DISTANCE * spacing)
    owners = cKDTree(placed[kept]).query(placed)[1]
    areas = np.bincount(owners, minlength=int(kept.sum())).astype(np.float64)
    areas *= area / len(candidates)
    return ObjectCloud(candidates[kept], normals[kept], areas, spacing)


def _thinned(surface: Surface, spacing: float) -> ObjectCloud:
    """Return a bare cloud without points nearer than the least distance, with estimated areas."""
    kept = _apart(surface.vertices, LEAST_DISTANCE * spacing)
    points = surface.vertices[kept]
    normals = _estimated_normals(points) if surface.normals is None else surface.normals[kept]
    count = min(NEIGHBOURS, len(points))
    reach = np.asarray(cKDTree(points).query(points, k=[count])[0])[:, 0]
    areas = np.pi * reach**2 / (count - 0.5)  # the disc to the last neighbour holds it half
    return ObjectCloud(points, normals, areas, spacing)


def _apart(points: Array, distance: float) -> NDArray[np.bool_]:
    """Keep each point, in order, that is not nearer than a distance to one kept before; a mask."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    later = np.ascontiguousarray(pairs[:, 1])
    starts = np.searchsorted(pairs[:, 0], np.arange(len(points) + 1))
    kept = np.ones(len(points), dtype=bool)
    for i, (start, end) in enumerate(zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)):
        if end > start and kept[i]:
            kept[later[start:end]] = False
    return kept


def _estimated_normals(points: Array) -> Array:
    """Return normals from each point's neighbours, turned outwards consistently."""
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    count = min(NEIGHBOURS, len(points) - 1)
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(count))
    cloud.orient_normals_consistent_tangent_plane(count)
    normals = np.array(cloud.normals)
    outward = np.sum(normals * (points - points.mean(axis=0)))
    return normals if outward >= 0 else -normals
