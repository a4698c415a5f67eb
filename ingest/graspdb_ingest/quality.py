"""Grasp quality: how well the contacts of a grasp can hold the object.

The paper names these indices as the next use of its contact sites (its references 13 and 14). Contacts
are hard points with friction, forces are per newton of total normal force, torques are about the center
of mass and divided by the object's radius about it, so no index changes with the object's size.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.mechanics import Mechanics
from graspdb_ingest.wrench import grasp_matrix, primitive_wrenches, wrench_space


@dataclass(frozen=True)
class GraspQuality:
    """Quality indices of a grasp; all are dimensionless.

    Attributes
    ----------
    force_closure : bool
        Whether the contacts resist every force and torque, if they press hard enough.
    epsilon : float
        Largest-minimum resisted wrench (Ferrari and Canny, 1992); zero without force closure.
    wrench_volume : float
        Volume of the hull of the wrenches that are resisted.
    isotropy : float
        Least over largest singular value of the grasp matrix: 1 if it resists all directions alike.
    least_singular_value : float
        Least singular value of the grasp matrix: how far the grasp is from a singular one.
    """

    force_closure: bool
    epsilon: float
    wrench_volume: float
    isotropy: float
    least_singular_value: float

    def indices(self) -> Mapping[str, float]:
        """Return the numbers by name, as the table `grasps` keeps them."""
        names = ("epsilon", "wrench_volume", "isotropy", "least_singular_value")
        return {name: getattr(self, name) for name in names}


def grasp_quality(positions: Floats, normals: Floats, mechanics: Mechanics, edges: int) -> GraspQuality:
    """Return the quality of a grasp from its contacts.

    Parameters
    ----------
    positions, normals : ndarray, shape (k, 3)
        Contact points in the object frame [m], and outward unit normals there. A contact with a position
        or normal that is not finite is left out.
    mechanics : Mechanics
        The object's friction, center of mass and radius about it.
    edges : int
        Edges of the pyramid inscribed in each friction cone.

    Returns
    -------
    GraspQuality
        Zero and no force closure where the contacts cannot span all forces and torques, as one, two or
        collinear hard points never do.
    """
    known = np.isfinite(positions).all(axis=1) & np.isfinite(normals).all(axis=1)
    if not known.any():
        return GraspQuality(False, 0.0, 0.0, 0.0, 0.0)
    matrix = grasp_matrix(positions[known], normals[known], mechanics.center_of_mass, mechanics.radius)
    singular = np.linalg.svd(matrix, compute_uv=False)
    least = float(singular[5]) if len(singular) == 6 else 0.0
    isotropy = least / float(singular[0])
    space = wrench_space(primitive_wrenches(matrix, mechanics.friction, edges))
    tiny = isotropy < 1e-9
    return GraspQuality(
        space.force_closure,
        space.epsilon,
        space.volume,
        0.0 if tiny else isotropy,
        0.0 if tiny else least,
    )
