"""Key points of the MANO hand model (Romero, Tzionas, Black 2017, ACM Trans. Graph. 36(6), 245).

Public data sets store a hand as MANO's parameters: rotations of 15 joints, or their principal components,
orientation, translation, shape. The model's files are licensed to each user by themselves, so the user
passes them. What is needed of the model are 16 joints and five tips, so that is all that is computed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_pickle
from graspdb_schemas.errors import ImportSourceError, ParameterError
from graspdb_schemas.vocabulary import Side

N_JOINTS: Final = 16
N_POSE: Final = 3 * (N_JOINTS - 1)
N_SHAPE: Final = 10
N_VERTICES: Final = 778

TIP_VERTICES: Final = (744, 320, 443, 554, 671)
"""Vertices at the tips of thumb, index, middle, ring and little finger.

The numbers are those of the package smplx (github.com/vchoutas/smplx, vertex_ids.py), with which GRAB, ARCTIC
and HOT3D compute their joints; other packages take a vertex next to it.
"""

LARGEST: Final = 1e3
"""What nothing in a model comes to: lengths are metres, directions less, weights shares."""

FILES: Final[Mapping[Side, str]] = {Side.RIGHT: "MANO_RIGHT.pkl", Side.LEFT: "MANO_LEFT.pkl"}
"""Names of the model's files."""

_REMEDY: Final = (
    "Register at mano.is.tue.mpg.de, download the model (mano_v1_2.zip) and pass the folder with "
    "MANO_RIGHT.pkl and MANO_LEFT.pkl by --mano."
)


@dataclass(frozen=True, eq=False)
class ManoModel:
    """What key points need of a MANO model.

    Attributes
    ----------
    side : Side
        Which hand.
    template : ndarray, shape (778, 3)
        Vertices of the mean hand [m].
    shape_directions : ndarray, shape (778, 3, 10)
        Movement of the vertices with each shape parameter [m].
    pose_directions : ndarray, shape (778, 3, 135)
        Movement of the vertices with each entry of the 15 joints' rotations less the identity [m].
    regressor : ndarray, shape (16, 778)
        Joints from vertices.
    weights : ndarray, shape (778, 16)
        Share that each joint's segment has in a vertex.
    parents : tuple of int
        Parent of each joint; that of the first, the wrist, counts for nothing.
    mean_pose : ndarray, shape (45,)
        Rotation vectors of the mean hand's joints [rad].
    components : ndarray, shape (45, 45)
        Principal components of the pose, one a row.
    """

    side: Side
    template: Floats
    shape_directions: Floats
    pose_directions: Floats
    regressor: Floats
    weights: Floats
    parents: tuple[int, ...]
    mean_pose: Floats
    components: Floats

    def full_pose(self, pose: Floats, *, components: bool, flat_hand_mean: bool) -> Floats:
        """Return the rotation vectors of the 15 joints [rad], shape (n, 45).

        Parameters
        ----------
        pose : ndarray, shape (n, k)
            Coefficients of the first k principal components, or the 45 numbers of the rotation vectors.
        components : bool
            Whether they are coefficients.
        flat_hand_mean : bool
            Whether a pose of zeros is the flat hand; else it is the mean hand.

        Raises
        ------
        ParameterError
            If there are more coefficients than components, or not 45 rotation numbers.
        """
        if pose.ndim != 2 or pose.shape[1] > N_POSE or (pose.shape[1] < N_POSE and not components):
            raise ParameterError("MANO pose", pose.shape, f"(n, {N_POSE}), or fewer principal components")
        vectors = pose @ self.components[: pose.shape[1]] if components else pose
        return np.asarray(vectors if flat_hand_mean else vectors + self.mean_pose)

    def with_template(self, template: Floats) -> "ManoModel":
        """Return the model with the vertices, shape (778, 3) [m], of one person's hand for the mean hand.

        Raises
        ------
        ParameterError
            If there are not 778 vertices.
        """
        if template.shape != self.template.shape:
            raise ParameterError("MANO template", template.shape, str(self.template.shape))
        return replace(self, template=template)

    def key_points(self, pose: Floats, orientation: Floats, translation: Floats, shape: Floats) -> Floats:
        """Return the joints and tips in MANO's order [m], shape (n, 21, 3).

        Joints follow from the shaped hand by the regressor, their places by forward kinematics, and the tips
        by linear blend skinning of the vertices there (equations 2 to 4 of Loper et al. 2015, ACM Trans.
        Graph. 34(6), 248, on whose body model MANO is built).

        Parameters
        ----------
        pose : ndarray, shape (n, 45)
            Rotation vectors of the 15 joints, each in its parent's frame [rad].
        orientation : ndarray, shape (n, 3)
            Rotation vector of the whole hand about its wrist [rad].
        translation : ndarray, shape (n, 3)
            What is added to all points [m].
        shape : ndarray, shape (n, 10) or (10,)
            Shape parameters.
        """
        n = len(pose)
        vectors = np.concatenate([orientation, pose], axis=1).reshape(-1, 3)
        rotations = Rotation.from_rotvec(vectors).as_matrix().reshape(n, N_JOINTS, 3, 3)
        betas = np.broadcast_to(shape, (n, N_SHAPE))
        joints = self.regressor @ self.template + np.einsum(
            "jv,vcb,nb->njc", self.regressor, self.shape_directions, betas, optimize=True
        )
        turned, placed = self._chain(rotations, joints)
        tips = list(TIP_VERTICES)
        bent = (rotations[:, 1:] - np.eye(3)).reshape(n, -1)
        resting = (
            self.template[tips]
            + np.einsum("vcb,nb->nvc", self.shape_directions[tips], betas)
            + np.einsum("vcp,np->nvc", self.pose_directions[tips], bent)
        )
        from_joints = resting[:, :, None] - joints[:, None]
        carried = np.einsum("njcd,nvjd->nvjc", turned, from_joints) + placed[:, None]
        skinned = np.einsum("vj,nvjc->nvc", self.weights[tips], carried)
        return np.asarray(np.concatenate([placed, skinned], axis=1) + translation[:, None])

    def _chain(self, rotations: Floats, joints: Floats) -> tuple[Floats, Floats]:
        """Return the rotations (n, 16, 3, 3) and places (n, 16, 3) of the joints in the hand's frame."""
        turned, placed = rotations.copy(), joints.copy()
        for j, parent in enumerate(self.parents[1:], start=1):
            turned[:, j] = turned[:, parent] @ rotations[:, j]
            bone = joints[:, j] - joints[:, parent]
            placed[:, j] = placed[:, parent] + np.einsum("ncd,nd->nc", turned[:, parent], bone)
        return turned, placed


def find_mano(given: Path | None, side: Side, data: Path) -> Path:
    """Return the file of the MANO model of one hand.

    Parameters
    ----------
    given : Path or None
        The folder, or the file, that the user named.
    side : Side
        The hand.
    data : Path
        What needs it, for the message.

    Raises
    ------
    ImportSourceError
        If there is no such file; it says what is missing, where to get it and how to pass it.
    """
    name = FILES[side]
    if given is None:
        raise ImportSourceError(
            data, f"its {side} hands are parameters of MANO, and {name} is not given", _REMEDY
        )
    places = (given, given.parent / name) if given.is_file() else (given / name, given / "models" / name)
    for place in places:
        if place.is_file() and (place.name == name or not _is_other(place, side)):
            return place
    raise ImportSourceError(given, f"{name}, for {data}, is not there", _REMEDY)


def read_mano(path: Path, side: Side) -> ManoModel:
    """Read a MANO model file without chumpy and without running anything in it.

    Raises
    ------
    ImportSourceError
        If it is not such a file.
    """
    content = read_pickle(path)
    if not isinstance(content, dict):
        raise ImportSourceError(path, "it does not hold a MANO model", _REMEDY)
    return ManoModel(
        side=side,
        template=_numbers(content, "v_template", (N_VERTICES, 3), path),
        shape_directions=_numbers(content, "shapedirs", (N_VERTICES, 3, N_SHAPE), path),
        pose_directions=_numbers(content, "posedirs", (N_VERTICES, 3, 9 * (N_JOINTS - 1)), path),
        regressor=_numbers(content, "J_regressor", (N_JOINTS, N_VERTICES), path),
        weights=_numbers(content, "weights", (N_VERTICES, N_JOINTS), path),
        parents=_parents(content, path),
        mean_pose=_numbers(content, "hands_mean", (N_POSE,), path),
        components=_numbers(content, "hands_components", (N_POSE, N_POSE), path),
    )


def mend_left_shape(left: ManoModel, right: ManoModel) -> ManoModel:
    """Return the left model with the x axis of its shape directions turned over, if it was not already.

    In the published left model they are those of the right hand, though the hand itself is mirrored
    (github.com/vchoutas/smplx, issue 48). Data sets differ in whether they were fitted with or without that.
    """
    same = np.abs(left.shape_directions[:, 0] - right.shape_directions[:, 0]).sum() < 1.0
    return replace(left, shape_directions=left.shape_directions * [[-1.0], [1.0], [1.0]]) if same else left


def _is_other(path: Path, side: Side) -> bool:
    other = Side.LEFT if side is Side.RIGHT else Side.RIGHT
    return other in path.name.lower()


def _numbers(content: Mapping[object, object], key: str, shape: tuple[int, ...], path: Path) -> Floats:
    value = content.get(key)
    found = value.shape if isinstance(value, np.ndarray) else "nothing" if value is None else "no array"
    if not isinstance(value, np.ndarray) or value.shape != shape or value.dtype.kind not in "fiu":
        raise ImportSourceError(path, f"{key} is {found}, not numbers of shape {shape}", _REMEDY)
    if not (np.abs(value) < LARGEST).all():
        raise ImportSourceError(path, f"{key} has values that are none of a hand model's", _REMEDY)
    return np.asarray(value, dtype=np.float64)


def _parents(content: Mapping[object, object], path: Path) -> tuple[int, ...]:
    table = content.get("kintree_table")
    if not isinstance(table, np.ndarray) or table.shape != (2, N_JOINTS):
        raise ImportSourceError(path, f"kintree_table is not of shape (2, {N_JOINTS})", _REMEDY)
    parents = [int(parent) for parent in table[0]]
    if any(not 0 <= parent < j for j, parent in enumerate(parents[1:], start=1)):
        raise ImportSourceError(path, "the joints of kintree_table are no tree", _REMEDY)
    return (0, *parents[1:])
