"""Normals of a bare cloud: local planes, with signs that agree and point outward."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

from graspdb_ingest.rigid import Array

NEIGHBOURS: Final = 16


def estimate_normals(points: Array) -> Array:
    """Estimate outward normals of points that lie on a surface.

    The direction is that of the plane through the nearest points; signs are carried from neighbour to
    neighbour over the tree of least bending (Hoppe et al. 1992, Computer Graphics 26, 71). Each connected
    part then points away from the cloud's centre, more than towards it.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points [m], at least four.

    Returns
    -------
    ndarray, shape (n, 3)
        Unit normals.
    """
    nearest = np.asarray(cKDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)))[1], dtype=np.int64)
    around = points[nearest] - points[nearest].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][..., 0]
    signs, parts = _carry_signs(points, normals, nearest)
    normals = normals * signs[:, None]
    flow = np.bincount(parts, np.einsum("ni,ni->n", normals, points - points.mean(axis=0)))
    return np.asarray(normals * np.where(flow < 0, -1.0, 1.0)[parts][:, None])


def point_areas(points: Array) -> Array:
    """Estimate the area that each point of a cloud stands for, from the distance of its neighbours.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points [m].

    Returns
    -------
    ndarray, shape (n,)
        Areas [m2]: that of the disc that reaches to the last of a point's neighbours, shared among them.
    """
    k = min(NEIGHBOURS, len(points) - 1)
    reach = np.asarray(cKDTree(points).query(points, k=[k + 1])[0])[:, 0]
    return np.asarray(np.pi * reach**2 / (k + 0.5))  # the last one, on the rim, counts half


def _carry_signs(
    points: Array, normals: Array, nearest: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int64]]:
    """Return a sign for each normal so that neighbours agree, and the connected part of each point."""
    n = len(normals)
    rows = np.repeat(np.arange(n), nearest.shape[1] - 1)
    columns = nearest[:, 1:].ravel()
    agreement = np.einsum("ei,ei->e", normals[rows], normals[columns])
    step = points[columns] - points[rows]
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    # A step along a normal leads through a thin wall to its other side, where normals agree but for sign.
    through = np.maximum(*(np.abs(np.einsum("ei,ei->e", step, normals[end])) for end in (rows, columns)))
    cost = 1.001 - np.abs(agreement) + through  # above zero, which a sparse graph takes for no edge
    graph = csr_array(coo_array((cost, (rows, columns)), shape=(n, n)))
    tree = csr_array(minimum_spanning_tree(graph.maximum(graph.T)))
    parts = np.asarray(connected_components(tree, directed=False)[1], dtype=np.int64)
    signs = np.ones(n)
    for root in np.unique(parts, return_index=True)[1]:
        order, before = breadth_first_order(tree, root, directed=False)
        turns = np.einsum("ei,ei->e", normals[order[1:]], normals[before[order[1:]]]) < 0
        for point, turn in zip(order[1:], turns, strict=True):
            signs[point] = -signs[before[point]] if turn else signs[before[point]]
    return signs, parts
