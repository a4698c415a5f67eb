"""A closed surface through an object's cloud: the database keeps points with normals, and no mesh."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.objects.open3d_library import load_open3d

Floats = NDArray[np.floating[Any]]

LEAST_POINTS: Final = 30
"""Points that a surface needs at least."""

CELL: Final = 0.7
"""Cells of the octree, over the cloud's spacing."""

DEPTHS: Final = (5, 9)
"""Least and greatest depth of the octree."""

MARGIN: Final = 1.1
"""Side of the octree over the largest side of the cloud's box."""

SMALLEST_PIECE: Final = 0.02
"""Pieces of the surface with less than this share of its largest one's faces are left out."""


@dataclass(frozen=True, eq=False)
class ClosedSurface:
    """A surface that encloses a volume.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3)
        Corners [m].
    faces : ndarray of int, shape (m, 3)
        Triangles, counter-clockwise seen from outside.
    """

    vertices: Floats
    faces: NDArray[np.int32]

    @property
    def volume(self) -> float:
        """Enclosed volume [m3], the sum of the signed tetrahedra from the origin to each triangle."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def closed_surface(
    points: Floats, normals: Floats, spacing: float, faces: int | None = None
) -> ClosedSurface | None:
    """Return a closed surface through a cloud, or None where the cloud is too small for one.

    Screened Poisson reconstruction (Kazhdan and Hoppe, ACM Trans. Graph. 32(3), 2013) by Open3D, in one
    thread, since with several its result differs from run to run. It rounds edges within about a spacing.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Points [m] and outward unit normals.
    spacing : float
        Distance of neighbouring points [m].
    faces : int, optional
        Number of triangles to come down to, at most.
    """
    known = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
    if known.sum() < LEAST_POINTS:
        return None
    open3d = load_open3d()
    vector = open3d.utility.Vector3dVector
    cloud = open3d.geometry.PointCloud(vector(points[known]))
    cloud.normals = vector(normals[known])
    side = MARGIN * float(np.ptp(points[known], axis=0).max())
    depth = int(np.clip(np.ceil(np.log2(side / (CELL * spacing))), *DEPTHS))
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        mesh, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
            cloud, depth=depth, scale=MARGIN, linear_fit=True, n_threads=1
        )
        _leave_out_crumbs(mesh)
        if faces is not None and len(mesh.triangles) > faces:
            mesh = mesh.simplify_quadric_decimation(faces)
    if not len(mesh.triangles):
        return None
    return ClosedSurface(np.asarray(mesh.vertices), np.asarray(mesh.triangles, dtype=np.int32))


def _leave_out_crumbs(mesh: Any) -> None:
    """Take the small pieces out that reconstruction leaves inside walls and beside thin parts."""
    pieces, counts, _ = mesh.cluster_connected_triangles()
    small = np.asarray(counts) < SMALLEST_PIECE * np.max(counts)
    mesh.remove_triangles_by_mask(small[np.asarray(pieces)])
    mesh.remove_unreferenced_vertices()
