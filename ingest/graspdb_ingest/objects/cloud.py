"""An object's surface as a cloud of evenly spaced points: the p_i of equation 1."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree

from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.normals import estimate_normals, point_areas
from graspdb_ingest.objects.open3d_library import load_open3d
from graspdb_ingest.objects.scatter import scatter, thin
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ParameterError

LEAST_TO_MEAN: Final = 0.9
"""Least distance of neighbours over their mean distance, in a cloud spread by dart throwing."""

MOST_POINTS: Final = 1_000_000


LEAF = 32
"""Points in a leaf of the search tree; with fewer, a sphere far from the object takes twice as long."""


@dataclass(frozen=True, eq=False)
class ObjectCloud:
    """Points spread evenly over an object's surface, in the object frame.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Positions [m]; exact in single precision, so that what is stored is what was computed with.
    normals : ndarray, shape (n, 3)
        Outward unit normals.
    areas : ndarray, shape (n,)
        Surface area that each point stands for [m2].
    spacing : float
        Mean distance of a point to its nearest neighbour that was asked for [m].
    """

    points: Array
    normals: Array
    areas: Array
    spacing: float

    @cached_property
    def tree(self) -> cKDTree:
        """The points as a k-d tree, built once."""
        return cKDTree(self.points, leafsize=LEAF)

    @cached_property
    def neighbours(self) -> Any:
        """The points in Open3D's search for nearest neighbours, which takes half the time of `tree`."""
        search = load_open3d().core.nns.NearestNeighborSearch(self.tensor(self.points))
        search.knn_index()
        return search

    @staticmethod
    def tensor(positions: Array) -> Any:
        """Return positions as Open3D's search takes them."""
        return load_open3d().core.Tensor(np.ascontiguousarray(positions, dtype=np.float64))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out Open3D's search, which is built anew where it is needed."""
        return {name: value for name, value in self.__dict__.items() if name != "neighbours"}


def sample_cloud(surface: Surface, parameters: CloudParameters | None = None) -> ObjectCloud:
    """Spread points evenly over a surface.

    On a mesh no two points of one side are nearer than 0.9 of the spacing, and their mean distance to the
    nearest neighbour is the spacing; both sides of a thin wall get all their points. A bare cloud is
    thinned to the same spacing where it is denser; normals that its file does not give are estimated.

    Parameters
    ----------
    surface : Surface
        Mesh or cloud [m].
    parameters : CloudParameters, optional
        Spacing and seed; the same ones give the same cloud, bit for bit.

    Returns
    -------
    ObjectCloud
        The cloud. The areas sum to the area of a mesh.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number, or would take more than a million points.
    """
    parameters = parameters or CloudParameters()
    spacing = parameters.spacing
    if not (np.isfinite(spacing) and spacing > 0):
        raise ParameterError("cloud.spacing", spacing, "a positive distance in metres")
    distance = LEAST_TO_MEAN * spacing
    if surface.faces is None or surface.area is None:
        return _thinned(surface, distance, parameters)
    least = float(np.sqrt(surface.area / MOST_POINTS))
    if spacing < least:
        allowed = f"at least {least:.2g} m for a surface of {surface.area:.2g} m2"
        raise ParameterError("cloud.spacing", spacing, allowed)
    spread = scatter(surface.vertices, surface.faces, distance, parameters.seed)
    return ObjectCloud(_single(spread.points), spread.normals, spread.areas, spacing)


def _thinned(surface: Surface, distance: float, parameters: CloudParameters) -> ObjectCloud:
    """Return a bare cloud with points left out until it is as even as one spread over a mesh."""
    rng = np.random.default_rng(parameters.seed)
    # One point of each voxel first: pairs within the distance would be too many in a dense cloud.
    voxels = np.floor(surface.vertices / (distance / 2)).astype(np.int64)
    order = rng.permutation(len(voxels))
    first = np.sort(order[np.unique(voxels[order], axis=0, return_index=True)[1]])
    points = surface.vertices[first]
    # Normals from the denser points tell the sides of thin walls apart.
    normals = estimate_normals(points) if surface.normals is None else surface.normals[first]
    kept = thin(points, normals, distance, rng)
    chosen = _single(points[kept])
    if len(chosen) < 4:
        allowed = f"a distance [m] that leaves more than {len(chosen)} points of the cloud"
        raise ParameterError("cloud.spacing", parameters.spacing, allowed)
    return ObjectCloud(chosen, normals[kept], point_areas(chosen), parameters.spacing)


def _single(points: Array) -> Array:
    return points.astype(np.float32).astype(np.float64)
