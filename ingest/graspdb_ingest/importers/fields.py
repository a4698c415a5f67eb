"""What a data set's files hold, with names, shapes and kinds checked, and looks into folders."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_bytes
from graspdb_ingest.importers.base import ClipSource, ImportOptions
from graspdb_ingest.importers.meshes import find_mesh
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.errors import ImportSourceError, ParameterError
from graspdb_schemas.units import METRES_PER, metres_per

AGAIN: Final = "Download it again; the download may have been cut off."
LARGEST: Final = 1e12
"""What no length, angle or count of a data set comes to."""

MOST_MISSING: Final = 100
"""Frames that may be missing for each that is there."""

Shape = tuple[int | None, ...]


def numbers(content: object, key: str, shapes: Shape | tuple[Shape, ...], path: Path) -> Floats:
    """Return the array of numbers under a key of a mapping, to be changed at will.

    Parameters
    ----------
    content : object
        What was read; anything but a mapping is refused.
    key : str
        Its key, with dots between those of nested mappings.
    shapes : tuple, or tuple of tuples
        The shape, or those allowed, with None for any length.
    path : Path
        Where it comes from, for messages.

    Raises
    ------
    ImportSourceError
        If it is missing, of another shape, or not of finite numbers.
    """
    value = _as_array(entry(content, key, path))
    allowed = shapes if shapes and isinstance(shapes[0], tuple) else (shapes,)
    if value.dtype.kind not in "biuf" or not any(_fits(value.shape, shape) for shape in allowed):
        found = f"{key} has shape {value.shape} and type {value.dtype}"
        wanted = " or ".join(str(shape).replace("None", "n") for shape in allowed)
        raise ImportSourceError(path, found, f"It should be numbers of shape {wanted}. {AGAIN}")
    if not (np.abs(value.astype(np.float64)) < LARGEST).all():
        raise ImportSourceError(path, f"{key} has values that are no finite measures", AGAIN)
    return np.array(value, dtype=np.float64)


def entry(content: object, key: str, path: Path) -> Any:
    """Return what stands under a key of a mapping, with dots between those of nested mappings.

    Raises
    ------
    ImportSourceError
        If there is none; the message says which keys there are.
    """
    value = content
    for part in key.split("."):
        if not isinstance(value, Mapping) or part not in value:
            there = ", ".join(map(str, list(value)[:12])) if isinstance(value, Mapping) else "no keys at all"
            raise ImportSourceError(path, f"it has no {key}; there is {there or 'nothing'}", AGAIN)
        value = value[part]
    return value


def word(content: object, key: str, path: Path) -> str:
    """Return the text under a key.

    Raises
    ------
    ImportSourceError
        If it is missing or not a text.
    """
    value = entry(content, key, path)
    value = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(value, str):
        raise ImportSourceError(path, f"{key} is {value!r:.60}, not a text", AGAIN)
    return value


def whole(content: object, key: str, path: Path) -> int:
    """Return the whole number, not negative, under a key.

    Raises
    ------
    ImportSourceError
        If it is missing or not one.
    """
    value = entry(content, key, path)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ImportSourceError(path, f"{key} is {value!r:.60}, not a whole number", AGAIN)
    return value


def read_yaml(path: Path) -> object:
    """Return what a YAML file holds: texts, numbers, lists, mappings.

    Raises
    ------
    ImportSourceError
        If it is missing or not YAML.
    """
    try:
        return yaml.load(read_bytes(path), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except (yaml.YAMLError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise ImportSourceError(path, f"it is no whole YAML file ({reason})", AGAIN) from error


def read_json(path: Path) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    ImportSourceError
        If it is missing or not JSON.
    """
    return _json(read_bytes(path), path, "it is no whole JSON file")


def read_json_lines(path: Path) -> Iterator[Any]:
    """Yield what each line of a file of JSON lines holds.

    Raises
    ------
    ImportSourceError
        If it is missing, or a line is not JSON; the message says which.
    """
    for number, line in enumerate(read_bytes(path).splitlines(), start=1):
        if line.strip():
            yield _json(line, path, f"line {number} is no whole JSON")


def rigid(rotations: Floats, positions: Floats) -> Floats:
    """Return transforms, shape (n, 4, 4), from rotations (n, 3, 3) and positions (n, 3) [m]."""
    poses = np.tile(np.eye(4), (len(rotations), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, positions
    return poses


def rotations_by(quaternions: Floats, path: Path) -> Floats:
    """Return the rotation matrices, shape (n, 3, 3), of quaternions (w, x, y, z), shape (n, 4).

    Raises
    ------
    ImportSourceError
        If one is zero.
    """
    if (np.linalg.norm(quaternions, axis=1) < 1e-6).any():
        raise ImportSourceError(path, "a quaternion in it is zero", AGAIN)
    return rotations_from_quaternions(np.asarray(quaternions, dtype=np.float64))


def rotations_of(vectors: Floats) -> Floats:
    """Return the rotation matrices, shape (n, 3, 3), of rotation vectors, shape (n, 3) [rad]."""
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def matches(path: Path, *patterns: str) -> bool:
    """Whether a folder has a file that fits one of the patterns; never raises."""
    try:
        return path.is_dir() and any(next(path.glob(pattern), None) is not None for pattern in patterns)
    except OSError:
        return False


def find_ycb_mesh(name: str, data: Path, options: ImportOptions) -> Path:
    """Return the mesh of an object of the YCB-Video models, in which each has a folder of its own.

    Parameters
    ----------
    name : str
        The object, such as ``025_mug``.
    data : Path
        Folder of the data set, in which ``models`` is looked for unless the user names another.
    options : ImportOptions
        `objects` is the folder of the models, or the one that holds ``models``.

    Raises
    ------
    ImportSourceError
        If there is none.
    """
    root = options.objects or data
    for place in (root / name, root / "models" / name):
        if (place / "textured_simple.obj").is_file():
            return place / "textured_simple.obj"
    return find_mesh(name, data, options)


def mesh_of(source: ClipSource) -> Path:
    """Return the mesh of a clip that `find` gave an object."""
    if source.object is None:
        raise ImportSourceError(source.files[0], "its clip has no object", AGAIN)
    return source.object.file


def n_frames_of(frames: Sequence[int], path: Path) -> int:
    """Return how many frames a clip has by the ascending numbers of those that are there.

    Raises
    ------
    ImportSourceError
        If far more are missing than there are, as where a file has been given a name of its own.
    """
    n_frames = frames[-1] - frames[0] + 1
    if n_frames > MOST_MISSING * len(frames):
        found = f"its {len(frames)} frames are numbered {frames[0]} to {frames[-1]}"
        raise ImportSourceError(path, found, "Remove the files that do not belong to the sequence.")
    return n_frames


def metres_in(options: ImportOptions) -> float:
    """Return the factor to metres of lengths that are metres in the data set unless the user says otherwise.

    Raises
    ------
    ParameterError
        If the user names no unit of length.
    """
    unit = options.units or "m"
    scale = metres_per(unit)
    if scale is None:
        raise ParameterError("units", unit, ", ".join(METRES_PER))
    return scale


def _as_array(value: object) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except ValueError:  # lists of different lengths
        return np.empty(0, dtype=object)


def _fits(shape: tuple[int, ...], wanted: Any) -> bool:
    return len(shape) == len(wanted) and all(w is None or n == w for n, w in zip(shape, wanted, strict=True))


def _json(data: bytes, path: Path, found: str) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ImportSourceError(path, f"{found} ({error})", AGAIN) from error
