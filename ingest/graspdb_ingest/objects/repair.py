"""Small repairs that leave a mesh's shape alone: doubled faces, and faces turned the wrong way."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import cKDTree

from graspdb_ingest.rigid import Array

Indices = NDArray[np.int64]

WELD_DISTANCE: Final = 1e-6
"""Vertices nearer than this are one [m]: far below any shape, above the rounding of single precision."""
APART: Final = 0.005
"""Pieces further than this from all others are no part of an object that a hand holds [m]."""
MOST_PIECES: Final = 1000
"""A mesh in more pieces than this is a soup of triangles, none of which is more astray than others."""


@dataclass(frozen=True, eq=False)
class MendedMesh:
    """A mesh with each face once and facing outward, as far as that can be said.

    Attributes
    ----------
    mesh : trimesh.Trimesh
        Vertices welded by position; each face has three different ones and is there once.
    warnings : tuple of str
        What was found and done.
    """

    mesh: trimesh.Trimesh
    warnings: tuple[str, ...]


def mend(vertices: Array, faces: Indices, whole: bool = True) -> MendedMesh:
    """Weld vertices, drop faces that add no surface, and turn faces outward.

    Parameters
    ----------
    vertices : ndarray, shape (v, 3)
        Finite vertices [m].
    faces : ndarray of int, shape (f, 3)
        Triangles.
    whole : bool
        Whether they are all of an object; of a part that is not closed nobody can say which side is out.

    Returns
    -------
    MendedMesh
        The mesh, which may have no faces left, and what was done to it.
    """
    warnings: list[str] = []
    faces, n_degenerate, n_duplicate = _distinct_faces(vertices, _weld(vertices)[faces])
    warnings += [
        f"{_count(n, 'face')} {what}"
        for n, what in ((n_degenerate, "without area"), (n_duplicate, "doubled: left out"))
        if n
    ]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.remove_unreferenced_vertices()
    if len(mesh.faces) and not mesh.is_winding_consistent:
        flips = _inconsistent(mesh)
        _flip(mesh, flips)
        warnings.append(f"{_count(int(flips.sum()), 'face')} turned to agree with the neighbours")
    if len(mesh.faces) and (whole or mesh.is_watertight):
        inside_out = _inside_out(mesh)
        _flip(mesh, inside_out)
        if n := int(inside_out.sum()):
            which = "all faces" if inside_out.all() else _count(n, "face")
            warnings.append(f"{which} inside out: turned outward")
    return MendedMesh(mesh, tuple(warnings))


def stray_pieces(mesh: trimesh.Trimesh) -> list[str]:
    """Return a warning about pieces of a mesh that lie apart from the rest of it, if there are any.

    Pieces whose boxes come within `APART` of each other belong together, as the parts of an assembly do; the
    group with the largest area is the object.
    """
    first, second = np.asarray(mesh.face_adjacency).T
    n_faces = len(mesh.faces)
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(n_faces, n_faces))
    n, labels = connected_components(graph, directed=False)
    if not 1 < n <= MOST_PIECES:
        return []
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, labels, mesh.triangles.min(axis=1))
    np.maximum.at(high, labels, mesh.triangles.max(axis=1))
    between = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=2)
    groups = connected_components(csr_array(between < APART), directed=False)[1]
    areas = np.bincount(groups, np.bincount(labels, mesh.area_faces, minlength=n))
    stray = groups != areas.argmax()
    if not stray.any():
        return []
    share, off = areas.sum() - areas.max(), between[stray][:, ~stray].min(axis=1).max()
    found = f"{_count(int(stray.sum()), 'piece')} up to {1e3 * off:.0f} mm from the rest"
    return [f"{found}, with {share / areas.sum():.1%} of the area: taken for parts of the object"]


def _count(n: int, thing: str) -> str:
    return f"{n} {thing}" if n == 1 else f"{n} {thing}s"


def _weld(vertices: Array) -> Indices:
    """Return for each vertex the first of those that lie where it lies."""
    pairs = cKDTree(vertices).query_pairs(WELD_DISTANCE, output_type="ndarray")
    n = len(vertices)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    first = np.unique(labels, return_index=True)[1]
    return np.asarray(first[labels], dtype=np.int64)


def _distinct_faces(vertices: Array, faces: Indices) -> tuple[Indices, int, int]:
    """Return faces of three different vertices, each once, and how many faces have no area or a double.

    Slivers of three different vertices on a line stay: they have no area, but close the mesh.
    """
    edges = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    doubled_areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    sizes = np.einsum("fij,fij->f", edges, edges)
    n_degenerate = int(np.count_nonzero(doubled_areas <= 1e-9 * sizes))
    ordered = np.sort(faces, axis=1)
    triangles = np.flatnonzero((np.diff(ordered, axis=1) > 0).all(axis=1))
    once = np.sort(np.unique(ordered[triangles], axis=0, return_index=True)[1])
    return faces[triangles[once]], n_degenerate, len(triangles) - len(once)


def _flip(mesh: trimesh.Trimesh, which: NDArray[np.bool_]) -> None:
    faces = np.array(mesh.faces)
    faces[which] = faces[which, ::-1]
    mesh.faces = faces


def _inconsistent(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Return the faces to flip so that neighbours run along their common edge in opposite directions.

    In each connected part the faces that are fewer are flipped.
    """
    n = len(mesh.faces)
    pairs = np.asarray(mesh.face_adjacency)
    edges = np.asarray(mesh.face_adjacency_edges)
    opposed = _runs_forward(mesh.faces, pairs[:, 0], edges) != _runs_forward(mesh.faces, pairs[:, 1], edges)
    pairs, first = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True)
    relation = np.where(opposed[first], 1, 2)
    labels = _parts(mesh)
    roots = np.unique(labels, return_index=True)[1]
    # One more node that touches one face of each part lets a single search reach them all.
    rows = np.concatenate((pairs[:, 0], np.full(len(roots), n)))
    columns = np.concatenate((pairs[:, 1], roots))
    values = np.concatenate((relation, np.ones(len(roots), dtype=int)))
    graph = csr_array(coo_array((values, (rows, columns)), shape=(n + 1, n + 1)))
    graph = csr_array(graph + graph.T)
    order, before = breadth_first_order(graph, n, directed=False)
    turns = np.asarray(graph[before[order[1:]], order[1:]]).ravel() == 2
    flips = np.zeros(n + 1, dtype=bool)
    for face, turn in zip(order[1:], turns, strict=True):
        flips[face] = flips[before[face]] ^ turn
    flips = flips[:n]
    most = np.bincount(labels, weights=flips) * 2 > np.bincount(labels)
    return np.asarray(flips ^ most[labels])


def _runs_forward(faces: Indices, which: Indices, edges: Indices) -> NDArray[np.bool_]:
    """Return whether a face runs along an edge from the edge's first vertex to its second."""
    triangles = np.asarray(faces)[which]
    start = (triangles == edges[:, :1]).argmax(axis=1)
    following = triangles[np.arange(len(triangles)), (start + 1) % 3]
    return np.asarray(following == edges[:, 1])


def _parts(mesh: trimesh.Trimesh) -> Indices:
    """Return for each face the number of its connected part."""
    n = len(mesh.faces)
    pairs = np.asarray(mesh.face_adjacency)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _inside_out(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Return the faces that face inward.

    A closed part faces inward if its signed volume is negative, unless it lies in another part and is the
    wall of a cavity. Open parts are judged together, by the flow of their normals out of their centre.
    """
    labels = _parts(mesh)
    n_parts = labels.max() + 1
    neighbours = np.bincount(np.asarray(mesh.face_adjacency).ravel(), minlength=len(labels))
    closed = np.bincount(labels, weights=neighbours != 3, minlength=n_parts) == 0
    arms = mesh.triangles_center - mesh.centroid
    volumes = np.bincount(labels, np.einsum("ij,ij->i", mesh.triangles_cross, arms), n_parts) / 6
    turned = np.zeros(n_parts, dtype=bool)
    outer = closed[labels] & (volumes > 0)[labels]
    for part in np.flatnonzero(closed & (volumes < 0)):
        corner = mesh.triangles[labels == part][0, 0]
        turned[part] = _winding_number(mesh.triangles[outer], corner) < 0.5
    if not closed.all():
        openly = ~closed[labels]
        reach = np.linalg.norm(mesh.triangles_cross, axis=1) * np.linalg.norm(arms, axis=1)
        # A flat or wavy sheet has no outside; only a clear majority turns one round.
        turned[~closed] = volumes[~closed].sum() < -0.1 * reach[openly].sum() / 6
    return np.asarray(turned[labels])


def _winding_number(triangles: Array, point: Array) -> float:
    """Return how often closed triangles (n, 3, 3) wind around a point: their solid angles over 4 pi.

    The solid angle of a triangle is that of Van Oosterom and Strackee (1983), IEEE Trans. Biomed. Eng. 30.
    """
    a, b, c = np.swapaxes(triangles - point, 0, 1)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    bc, ca, ab = (np.einsum("ij,ij->i", u, v) for u, v in ((b, c), (c, a), (a, b)))
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angles.sum() / (4 * np.pi))
