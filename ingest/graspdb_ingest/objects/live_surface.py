"""An object known by live clouds alone: each cloud is its surface at that time, the paper's P_i(t).

There is no model, so the clouds themselves tell the object's motion: each is registered, from the pose
before, to what all earlier ones have shown. That serves the pose alone; contacts and features are of the
cloud itself. Between two clouds the nearer one moves with the object. The object frame has the axes of the
lab frame at the first cloud, and its origin in that cloud's middle.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.live import CloudFile, notes_of, poses_in_frames
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.objects.pose import ObjectTrack
from graspdb_ingest.objects.registration import Registration, mean_distance, no_pose, register
from graspdb_ingest.parameters import CloudParameters, RegistrationParameters
from graspdb_ingest.rigid import Array
from graspdb_schemas.errors import ObjectError

NO_CLOUD: Final = -1
NEW_POINT: Final = 2.0
"""A point further than this many spacings from all that was seen before is a new part of the object."""
CLEARLY: Final = 0.9
"""A pose that follows from steady movement counts if it brings the points nearer than this many times."""
LEAST_NEW: Final = 0.02
"""Share of a cloud's points that have to be new for them to be added: fewer are noise at an edge."""


@dataclass(frozen=True, eq=False)
class LiveCloud:
    """An object's surface as one cloud shows it.

    Attributes
    ----------
    cloud : ObjectCloud
        Its points, thinned evenly, in the object frame.
    sha256 : str
        Of its file.
    warnings : tuple of str
        What was found wrong with it and put up with.
    """

    cloud: ObjectCloud
    sha256: str
    warnings: tuple[str, ...]

    @property
    def surface(self) -> Surface:
        """The points as a surface without faces."""
        points, normals = self.cloud.points, self.cloud.normals
        extents = np.ptp(points, axis=0)
        return Surface(points, None, normals, None, None, extents, False, self.sha256, self.warnings)

    @property
    def distance(self) -> ObjectDistance:
        """How far the cloud is, by equation 2."""
        return ObjectDistance(self.surface, self.cloud)


@dataclass(frozen=True, eq=False)
class LiveSurface:
    """An object that live clouds show, without any other model.

    Attributes
    ----------
    clouds : tuple of LiveCloud
        The clouds that can be used, in order of time.
    of_frame : ndarray of int, shape (n_frames,)
        The cloud that is the object's surface in each frame; -1 where there is none.
    track : ObjectTrack
        The object's pose in every frame, from the clouds' own motion; NaN where they do not tell it.
    fitness : ndarray, shape (n_frames,)
        Fitness of the registrations that a frame's pose stands on; NaN without one.
    notes : tuple of str
        What is wrong with clouds that are not used.
    """

    clouds: tuple[LiveCloud, ...]
    of_frame: NDArray[np.int64]
    track: ObjectTrack
    fitness: Array
    notes: tuple[str, ...]


def follow_surface(
    clouds: tuple[CloudFile, ...],
    scale: float,
    times: Array,
    sampling: CloudParameters,
    parameters: RegistrationParameters,
) -> LiveSurface:
    """Take live clouds as an object's surface, and follow it from one to the next.

    A frame has the cloud that is nearest in time, moved with the object, if the clouds before and after it
    tell the object's motion and are no further apart than `maximum_gap`; else the object is not known.

    Parameters
    ----------
    clouds : tuple of CloudFile
        The clouds in order of time, in the lab frame, of the object alone.
    scale : float
        Factor from their lengths to metres.
    times : ndarray, shape (n_frames,)
        Times of the recording's frames [s].
    sampling : CloudParameters
        Spacing that the clouds are thinned to.
    parameters : RegistrationParameters
        When two clouds tell a motion.
    """
    shape: ObjectCloud | None = None
    used: list[LiveCloud] = []
    poses: list[Registration] = []
    places = []
    for file in clouds:
        try:
            read = _read(file, scale, sampling)
        except ObjectError as error:
            poses.append(no_pose(str(error)))
            places.append(NO_CLOUD)
            continue
        pose = _followed(read.cloud, shape, [p for p in poses if p.reason is None], parameters)
        poses.append(pose)
        places.append(len(used) if pose.reason is None else NO_CLOUD)
        if pose.reason is None:
            own = _in_object_frame(read.cloud, pose)
            used.append(replace(read, cloud=own))
            shape = _grown(shape, own)
    cloud_times = np.array([file.time for file in clouds])
    track, fitness = poses_in_frames(cloud_times, poses, times, parameters)
    known = np.flatnonzero(np.array(places) != NO_CLOUD)
    of_frame = np.full(len(times), NO_CLOUD, dtype=np.int64)
    if len(known):
        of_frame[:] = np.array(places)[known[_nearest(cloud_times[known], times)]]
        of_frame[~track.known] = NO_CLOUD
    return LiveSurface(tuple(used), of_frame, track, fitness, notes_of(clouds, poses))


def _read(file: CloudFile, scale: float, sampling: CloudParameters) -> LiveCloud:
    """Read a cloud, thinned, in the lab frame."""
    surface = load_surface(file.path, scale, "units")
    cloud = sample_cloud(surface, sampling)
    if file.camera is not None:
        # What a camera sees faces it.
        arms = scale * np.array(file.camera) - cloud.points
        away = np.einsum("ni,ni->n", cloud.normals, arms) < 0
        cloud = replace(cloud, normals=np.where(away[:, None], -cloud.normals, cloud.normals))
    return LiveCloud(cloud, surface.sha256, surface.warnings)


def _followed(
    cloud: ObjectCloud,
    shape: ObjectCloud | None,
    known: list[Registration],
    parameters: RegistrationParameters,
) -> Registration:
    """Return the pose of a cloud, from what earlier ones have shown; the first one defines the frame."""
    if shape is None:
        return Registration(np.eye(3), cloud.points.mean(axis=0), 1.0, 0.0)
    last = known[-1]
    near = register(shape, cloud.points, last.rotation, last.position, parameters, cloud.normals)
    if len(known) == 1:
        return near
    # It may have gone on as it went before: where faces slide along themselves only this tells.
    turn = last.rotation @ known[-2].rotation.T @ last.rotation
    going = register(
        shape, cloud.points, turn, 2 * last.position - known[-2].position, parameters, cloud.normals
    )
    if near.reason is None and going.reason is None:
        off = mean_distance(shape, cloud.points, near)
        return going if mean_distance(shape, cloud.points, going) < CLEARLY * off else near
    return near if going.reason is not None else going


def _grown(shape: ObjectCloud | None, cloud: ObjectCloud) -> ObjectCloud:
    """Return all that is known of an object's shape, with what a cloud shows for the first time."""
    if shape is None:
        return cloud
    distance = shape.tree.query(cloud.points, distance_upper_bound=NEW_POINT * cloud.spacing)[0]
    new = np.flatnonzero(~np.isfinite(distance))
    if len(new) < LEAST_NEW * len(cloud.points):
        return shape
    points, normals, areas = (
        np.concatenate([getattr(shape, name), getattr(cloud, name)[new]])
        for name in ("points", "normals", "areas")
    )
    return ObjectCloud(points, normals, areas, shape.spacing)


def _in_object_frame(cloud: ObjectCloud, pose: Registration) -> ObjectCloud:
    # Exact in single precision, as every cloud is: what is stored is what was computed with.
    points = ((cloud.points - pose.position) @ pose.rotation).astype(np.float32).astype(np.float64)
    return ObjectCloud(points, cloud.normals @ pose.rotation, cloud.areas, cloud.spacing)


def _nearest(cloud_times: Array, times: Array) -> NDArray[np.int64]:
    """Return the place of the cloud nearest in time to each frame, shape (n_frames,)."""
    after = np.clip(np.searchsorted(cloud_times, times), 1, max(1, len(cloud_times) - 1))
    if len(cloud_times) == 1:
        return np.zeros(len(times), dtype=np.int64)
    earlier = times - cloud_times[after - 1] <= cloud_times[after] - times
    return np.asarray(np.where(earlier, after - 1, after), dtype=np.int64)
