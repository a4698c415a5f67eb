"""What an object's mechanics need: friction, center of mass, and the size of torques about it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.rigid import Array

CenterSource = Literal["manifest", "volume", "area"]


@dataclass(frozen=True, eq=False)
class Mechanics:
    """An object as grasp quality sees it.

    Attributes
    ----------
    friction : float
        Coefficient of friction between skin and object.
    friction_given : bool
        Whether the manifest gave it.
    center_of_mass : ndarray, shape (3,)
        In the object frame [m].
    center_source : {'manifest', 'volume', 'area'}
        Given by the manifest; centroid of the volume of a closed mesh, which it is if the object is of one
        material; centroid of the surface, which it is for a thin shell.
    radius : float
        Largest distance of a point of the surface from the center of mass [m].
    warnings : tuple of str
        What of the manifest could not be used.
    """

    friction: float
    friction_given: bool
    center_of_mass: Array
    center_source: CenterSource
    radius: float
    warnings: tuple[str, ...] = ()


def object_mechanics(
    surface: Surface,
    cloud: ObjectCloud,
    default_friction: float,
    friction: float | None = None,
    center_of_mass: tuple[float, float, float] | None = None,
) -> Mechanics:
    """Return the mechanics of an object.

    Parameters
    ----------
    surface, cloud : Surface, ObjectCloud
        The object.
    default_friction : float
        Coefficient of friction where none is given.
    friction : float, optional
        Coefficient that the manifest gives.
    center_of_mass : tuple of float, optional
        Center that the manifest gives, object frame [m]. Outside the convex hull of the surface no body
        has it: then it is not used, with a warning.
    """
    warnings: list[str] = []
    center, source = _centroid(surface, cloud)
    if center_of_mass is not None:
        given = np.array(center_of_mass, dtype=np.float64)
        outside = _outside_hull(given, cloud.points)
        if outside > cloud.spacing:
            warnings.append(
                f"center_of_mass lies {1e3 * outside:.0f} mm outside the object: the centroid is used instead"
            )
        else:
            center, source = given, "manifest"
    radius = float(np.linalg.norm(cloud.points - center, axis=1).max())
    given_friction = friction is not None
    used = friction if friction is not None else default_friction
    return Mechanics(used, given_friction, center, source, radius, tuple(warnings))


def _centroid(surface: Surface, cloud: ObjectCloud) -> tuple[Array, CenterSource]:
    if surface.watertight and surface.faces is not None:
        mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
        return np.array(mesh.center_mass, dtype=np.float64), "volume"
    return np.asarray(np.average(cloud.points, axis=0, weights=cloud.areas)), "area"


def _outside_hull(point: Array, points: Array) -> float:
    """Return how far a point is beyond the furthest of the faces of the points' hull [m]."""
    equations = ConvexHull(points, qhull_options="QJ").equations
    return float(max(0.0, np.max(equations[:, :3] @ point + equations[:, 3])))
