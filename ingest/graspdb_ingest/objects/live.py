"""The object as a live cloud: the paper's P_i(t), from a depth camera, in place of markers on the object."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.files import read_geometry
from graspdb_ingest.objects.pose import ObjectTrack
from graspdb_ingest.objects.registration import Registration, first_pose, no_pose, register
from graspdb_ingest.parameters import RegistrationParameters
from graspdb_ingest.readers.text import read_lines
from graspdb_ingest.rigid import Array, continuous_signs, quaternions_from_rotations
from graspdb_schemas.errors import ObjectError, RecordingError

_FORM: Final = "Give it the columns time [s] and file, separated by commas, a row for each cloud."
CAMERA: Final = ("camera_x", "camera_y", "camera_z")
"""Columns that say where the camera stood."""


@dataclass(frozen=True)
class CloudFile:
    """A cloud of a trial.

    Attributes
    ----------
    time : float
        When it was taken [s].
    path : Path
        Its file.
    camera : tuple of float, or None
        Where the camera stood, lab frame, in the unit of the cloud; None where that is not known.
    """

    time: float
    path: Path
    camera: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class CloudTrack:
    """An object followed in clouds.

    Attributes
    ----------
    track : ObjectTrack
        Its pose in every frame of the recording; NaN where no cloud tells it.
    fitness : ndarray, shape (n_frames,)
        Fitness of the registrations that a frame's pose stands on; NaN without one.
    notes : tuple of str
        How many clouds tell no pose, and why the first of them does not.
    """

    track: ObjectTrack
    fitness: Array
    notes: tuple[str, ...]


def read_cloud_times(path: Path) -> tuple[CloudFile, ...]:
    """Read the list of a trial's clouds: a CSV file with the columns ``time`` and ``file``.

    Columns ``camera_x``, ``camera_y`` and ``camera_z`` may say where the camera stood.

    Raises
    ------
    RecordingError
        If columns are missing, a time or a place of the camera is no number, a time is not later than the
        one before, or a file is not a plain name of a file beside the list.
    """
    text = read_lines(path)
    titles = [title.strip().strip('"').lower() for title in text.lines[0].split(",")] if text.lines else []
    if not {"time", "file"} <= set(titles):
        raise RecordingError(path, "it has no columns time and file", _FORM)
    given = [name for name in CAMERA if name in titles]
    if 0 < len(given) < len(CAMERA):
        raise RecordingError(path, f"it has {' and '.join(given)} alone", f"Give it {', '.join(CAMERA)}.")
    found: list[CloudFile] = []
    for number, line in enumerate(text.lines[1:], start=2):
        if not line.strip(", \t"):
            continue
        cells = dict(zip(titles, (cell.strip().strip('"') for cell in line.split(",")), strict=False))
        entry = _entry(path, number, cells.get("time", ""), cells.get("file", ""))
        found.append(replace(entry, camera=_camera(path, number, cells)) if given else entry)
        if len(found) > 1 and found[-1].time <= found[-2].time:
            raise RecordingError(path, f"line {number}: the time does not increase", _FORM)
    if not found:
        raise RecordingError(path, "it lists no cloud", _FORM)
    return tuple(found)


def _camera(path: Path, number: int, cells: Mapping[str, str]) -> tuple[float, float, float]:
    x, y, z = (_finite(cells.get(name, "")) for name in CAMERA)
    if x is None or y is None or z is None:
        raise RecordingError(path, f"line {number}: the camera's place is not three numbers", _FORM)
    return x, y, z


def _finite(text: str) -> float | None:
    """Return a text as a finite number, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _entry(path: Path, number: int, time: str, name: str) -> CloudFile:
    seconds = _finite(time)
    if seconds is None:
        raise RecordingError(path, f"line {number}: the time {time!r} is not a number", _FORM)
    file = path.parent / name
    if not name or Path(name).name != name or not file.resolve().is_relative_to(path.parent.resolve()):
        raise RecordingError(path, f"line {number}: {name!r} is no name of a file beside it", _FORM)
    if not file.is_file():
        raise RecordingError(
            path, f"line {number}: {name!r} does not exist", "Put the clouds beside the list."
        )
    return CloudFile(seconds, file)


def follow_clouds(
    clouds: tuple[CloudFile, ...],
    scale: float,
    model: ObjectCloud,
    times: Array,
    parameters: RegistrationParameters,
) -> CloudTrack:
    """Register an object's model to clouds, one after the other, and tell its pose in every frame.

    Each registration begins at the pose of the cloud before; the first, and one after clouds that told
    none, at the cloud's principal axes. A frame between two clouds gets the pose between theirs, if both
    tell one and they are no further apart than `maximum_gap`; else it has none.

    Parameters
    ----------
    clouds : tuple of CloudFile
        The clouds in order of time, in the lab frame.
    scale : float
        Factor from their lengths to metres.
    model : ObjectCloud
        The object.
    times : ndarray, shape (n_frames,)
        Times of the recording's frames [s].
    parameters : RegistrationParameters
        When a cloud tells a pose.
    """
    poses: list[Registration] = []
    last: Registration | None = None
    for cloud in clouds:
        pose = _registered(cloud, scale, model, last, parameters)
        last = pose if pose.reason is None else last
        poses.append(pose)
    track, fitness = poses_in_frames(np.array([cloud.time for cloud in clouds]), poses, times, parameters)
    return CloudTrack(track, fitness, notes_of(clouds, poses))


def _registered(
    cloud: CloudFile,
    scale: float,
    model: ObjectCloud,
    last: Registration | None,
    parameters: RegistrationParameters,
) -> Registration:
    try:
        points = scale * read_geometry(cloud.path).vertices
    except ObjectError as error:
        return no_pose(str(error))
    if last is not None:
        near = register(model, points, last.rotation, last.position, parameters)
        if near.reason is None:
            return near
    return first_pose(model, points, parameters)


def poses_in_frames(
    cloud_times: Array, poses: Sequence[Registration], times: Array, parameters: RegistrationParameters
) -> tuple[ObjectTrack, Array]:
    """Return pose and fitness in every frame, between the clouds before and after it."""
    n = len(times)
    rotations, positions = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan)
    residuals, fitness = np.full(n, np.nan), np.full(n, np.nan)
    for i in range(len(poses) - 1):
        one, two = poses[i], poses[i + 1]
        start, stop = cloud_times[i], cloud_times[i + 1]
        frames = np.flatnonzero((times >= start) & (times <= stop))
        told = one.reason is None and two.reason is None and stop - start <= parameters.maximum_gap
        if not told or not len(frames):
            continue
        share = ((times[frames] - start) / (stop - start))[:, None]
        both = Rotation.from_matrix(np.stack([one.rotation, two.rotation]))
        rotations[frames] = Slerp([0.0, 1.0], both)(share[:, 0]).as_matrix()
        positions[frames] = (1 - share) * one.position + share * two.position
        residuals[frames] = max(one.residual, two.residual)
        fitness[frames] = min(one.fitness, two.fitness)
    quaternions = continuous_signs(quaternions_from_rotations(rotations))
    none = np.zeros(n, dtype=np.int64)
    track = ObjectTrack(positions, rotations, quaternions, residuals, none, np.zeros((n, 0), dtype=bool))
    return track, fitness


def notes_of(clouds: Sequence[CloudFile], poses: Sequence[Registration]) -> tuple[str, ...]:
    """Return how many clouds tell no pose, and why the first of them does not."""
    bad = [(cloud, pose) for cloud, pose in zip(clouds, poses, strict=True) if pose.reason is not None]
    if not bad:
        return ()
    cloud, pose = bad[0]
    return (f"{len(bad)} of {len(clouds)} clouds tell no pose; {cloud.path.name}: {pose.reason}",)
