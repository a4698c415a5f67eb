"""Static grasps as arrays of fixed shape, for models that generate grasps."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.even import even_choice
from graspdb.export.held import HeldObject
from graspdb.export.items import Floats
from graspdb.export.registry import Feature
from graspdb_schemas.vocabulary import JOINT_ANGLES, N_Q, N_SITES

OBJECT_POINTS: Final = 2048
"""Points of an object's cloud that a sample has."""

FEATURE_POINTS: Final = 256
"""Points of the graspable feature that a sample has."""

QUALITIES: Final = ("epsilon", "wrench_volume", "isotropy", "least_singular_value")

ARRAYS: Final = (
    Feature("object_from_hand", "float32", "(4, 4)", "m", "pose of the hand segment in the object frame"),
    Feature("joint_angles", "float32", "(23,)", "rad", "hinges of the hand; NaN where they are not known"),
    Feature("sites", "float32", "(20, 3)", "m", "centres of the 20 spheres, object frame"),
    Feature("radii", "float32", "(20,)", "m", "their radii"),
    Feature("gap", "float32", "(20,)", "m", "signed distance of each site to the object"),
    Feature("touching", "bool", "(20,)", "", "whether each site touches"),
    Feature("contact_points", "float32", "(20, 3)", "m", "contact point by site; NaN where none touches"),
    Feature("contact_normals", "float32", "(20, 3)", "", "outward surface normal there"),
    Feature("contact_map", "float32", "(2048,)", "m",
            "signed distance of each point of object_cloud to the hand; NaN far from it"),
    Feature("feature_cloud", "float32", "(256, 3)", "m",
            "points of the graspable feature, evenly; some again where it has fewer, NaN where none"),
    Feature("feature_normals", "float32", "(256, 3)", "", "their outward unit normals"),
    Feature("feature_size", "int32", "()", "", "points that the feature really has"),
    Feature("hull_volume", "float32", "()", "m3", "volume of the hand enclosing space"),
    Feature("quality", "float32", "(4,)", "", ", ".join(QUALITIES)),
)  # fmt: skip
"""What a sample holds, beside its texts."""

OBJECT_ARRAYS: Final = (
    Feature(
        "objects/*.npz: object_cloud", "float32", "(2048, 3)", "m", "points, spread evenly, object frame"
    ),
    Feature("objects/*.npz: object_normals", "float32", "(2048, 3)", "", "their outward unit normals"),
    Feature("objects/*.npz: object_points", "int32", "(2048,)", "", "their numbers in object_points"),
    Feature("objects/*.ply", "float32", "(v, 3)", "m", "mesh: closed surface through the whole cloud"),
)
"""What is kept of each object."""

TEXTS: Final = (
    Feature("grasp", "string", "()", "", "key of the grasp"),
    Feature("trial", "string", "()", "", "key of its trial"),
    Feature("session", "string", "()", "", "its session"),
    Feature("subject", "string", "()", "", "whose hand"),
    Feature("object", "string", "()", "", "name of the object"),
    Feature("side", "string", "()", "", "right or left"),
    Feature("grasp_type", "string", "()", "", "type of the GRASP taxonomy; empty where none is likely"),
    Feature("mesh", "string", "()", "", "the object's mesh in this export; empty where it has none"),
    Feature("cloud", "string", "()", "", "the object's cloud in this export"),
)
"""Its texts."""


def texts(held: HeldObject, mesh: str, cloud: str) -> dict[str, str]:
    """Return the texts of a sample, by the names of `TEXTS`."""
    grasp = held.grasp
    return {
        "grasp": grasp.id,
        **{name: getattr(grasp, name) for name in ("trial", "session", "subject", "object", "side")},
        "grasp_type": held.grasp_type or "",
        "mesh": mesh,
        "cloud": cloud,
    }


def arrays(held: HeldObject, object_points: NDArray[np.int64]) -> dict[str, np.ndarray]:
    """Return the arrays of a sample, by the names of `ARRAYS` and with their types.

    Parameters
    ----------
    held : HeldObject
        The grasp.
    object_points : ndarray of int, shape (2048,)
        Points of the cloud that `object_cloud` has.
    """
    grasp = held.grasp
    feature = _feature(grasp.feature_cloud, grasp.feature_normals)
    values = {
        "object_from_hand": grasp.object_from_hand,
        "joint_angles": grasp.q[7:] if len(grasp.q) == N_Q else np.full(len(JOINT_ANGLES), np.nan),
        "sites": grasp.sites,
        "radii": held.radii,
        "gap": grasp.gap,
        "touching": held.touching,
        "contact_points": _by_site(held, grasp.contact_points),
        "contact_normals": _by_site(held, grasp.contact_normals),
        "contact_map": held.point_gaps()[object_points],
        "feature_cloud": feature[0],
        "feature_normals": feature[1],
        "feature_size": len(grasp.feature_points),
        "hull_volume": np.nan if grasp.hull_volume is None else grasp.hull_volume,
        "quality": [grasp.quality.get(name, np.nan) for name in QUALITIES],
    }
    return {array.name: np.asarray(values[array.name], dtype=array.kind) for array in ARRAYS}


def object_choice(points: Floats) -> NDArray[np.int64]:
    """Return which points of an object's cloud `object_cloud` has, shape (2048,)."""
    return even_choice(points, OBJECT_POINTS)


def _feature(points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    if not len(points):
        none = np.full((FEATURE_POINTS, 3), np.nan)
        return none, none
    chosen = even_choice(points, FEATURE_POINTS)
    return points[chosen], normals[chosen]


def _by_site(held: HeldObject, vectors: Floats) -> Floats:
    whole = np.full((N_SITES, 3), np.nan)
    whole[held.contact_site_numbers] = vectors
    return whole
