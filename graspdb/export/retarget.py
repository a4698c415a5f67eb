"""Key points of a hand carried over to a robot hand's joints, by dex-retargeting."""

from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspdb.export.errors import ExportError
from graspdb.export.items import Floats
from graspdb_ingest.rigid import quaternions_from_rotations
from graspdb_schemas.errors import MissingLibraryError

HAND_FROM_MANO: Final = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""MANO's wrist axes, which dex-retargeting expects, in the hand segment's: x palmar, z distal, y stays."""


class RobotHand:
    """A robot hand that follows a person's.

    Parameters
    ----------
    config : str
        A configuration of dex-retargeting (YAML) whose ``urdf_path`` lies beside it or is absolute;
        ``{side}`` in its name stands for right or left.

    Raises
    ------
    MissingLibraryError
        dex-retargeting or torch is not installed.
    """

    def __init__(self, config: str) -> None:
        self._config = config
        self._libraries = _libraries()
        self._built: dict[str, Any] = {}

    def joint_names(self, side: str) -> tuple[str, ...]:
        """Return the names of the joints, in the order of `follow`.

        Raises
        ------
        ExportError
            The configuration, or the robot that it names, cannot be used.
        """
        return tuple(self._retargeting(side).joint_names)

    def follow(self, key_points: Floats, world_from_wrist: Floats, side: str) -> Floats:
        """Return the robot's joints in every frame, shape (n, n_joints) [rad, m].

        A robot with a free base (``add_dummy_free_joint``) follows in the lab frame, where its fingertips
        come to lie at the person's; another in the frame of the wrist.

        Parameters
        ----------
        key_points : ndarray, shape (n, 21, 3)
            Wrist and sites [m]; the joints of frames with NaN are NaN.
        world_from_wrist : ndarray, shape (n, 4, 4)
            Pose of the hand segment.
        side : str
            right or left.

        Raises
        ------
        ExportError
            The configuration, or the robot that it names, cannot be used.
        """
        retargeting = self._retargeting(side)
        retargeting.reset()
        joints = np.full((len(key_points), len(retargeting.joint_names)), np.nan)
        known = np.isfinite(key_points).all(axis=(1, 2)) & np.isfinite(world_from_wrist).all(axis=(1, 2))
        mano = world_from_wrist[:, :3, :3].astype(float) @ HAND_FROM_MANO
        floating = _is_floating(retargeting)
        indices = np.asarray(retargeting.optimizer.target_link_human_indices)
        frames = np.flatnonzero(known)
        if floating and len(frames):
            self._start(retargeting, key_points[frames[0], 0], mano[frames[0]], side)
        for frame in frames:
            points = key_points[frame].astype(float)
            if not floating:
                points = (points - points[0]) @ mano[frame]
            wanted = points[indices] if indices.ndim == 1 else points[indices[1]] - points[indices[0]]
            joints[frame] = retargeting.retarget(wanted)
        return joints

    def _start(self, retargeting: Any, wrist: Floats, mano: Floats, side: str) -> None:
        """Place the base where the first frame has the wrist."""
        kind = self._libraries["dex_retargeting.constants"].HandType[side]
        quaternion = quaternions_from_rotations(mano[None])[0]
        retargeting.warm_start(wrist.astype(float), quaternion, kind, is_mano_convention=True)

    def _retargeting(self, side: str) -> Any:
        if side not in self._built:
            path = Path(self._config.replace("{side}", side))
            library = self._libraries["dex_retargeting.retargeting_config"].RetargetingConfig
            try:
                library.set_default_urdf_dir(str(path.resolve().parent))
                self._built[side] = library.load_from_file(path).build()
            except Exception as error:  # the library raises whatever its parsers and its URDF reader do
                raise ExportError(
                    path,
                    f"dex-retargeting cannot use it: {type(error).__name__}: {error}",
                    "Name a configuration of dex-retargeting with the robot's URDF beside it.",
                ) from error
        return self._built[side]


def _is_floating(retargeting: Any) -> bool:
    return any(name.startswith("dummy_") for name in retargeting.optimizer.target_joint_names)


def _libraries() -> dict[str, Any]:
    names = ("dex_retargeting.constants", "dex_retargeting.retargeting_config")
    try:
        import_module("torch")  # which dex-retargeting needs and does not ask for
        return {name: import_module(name) for name in names}
    except ImportError as error:
        raise MissingLibraryError(
            "dex-retargeting", str(error), "Install it: pip install 'graspdb[retarget]'"
        ) from error
