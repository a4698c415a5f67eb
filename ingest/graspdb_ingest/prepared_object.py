"""An object ready for contact: its surface, its even cloud, and what is computed once of them."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.descriptor import descriptor_kind, local_features
from graspdb_ingest.feature_shape import surface_neighbours
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.curvature import principal_curvatures
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.objects.live_surface import LiveCloud
from graspdb_ingest.objects.mechanics import Mechanics, object_mechanics
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.objects.solid import Solid
from graspdb_ingest.parameters import IngestParameters
from graspdb_schemas.errors import ObjectError
from graspdb_schemas.manifest import SessionObject


@dataclass(frozen=True)
class PreparedObject:
    """An object ready for contact: its surface, its cloud and the cloud's histograms.

    Attributes
    ----------
    name : str
        Key in the manifest.
    surface : Surface
        The mesh or cloud as loaded.
    cloud : ObjectCloud
        Evenly spaced points.
    distance : ObjectDistance
        How far it is: exact to the mesh, where there is one.
    histograms : ndarray of float32, shape (n_points, 33)
        FPFH of every point.
    features : ndarray of float32, shape (n_points, 128)
        Their Fourier features, of which the descriptors of the object's parts are made.
    descriptor_kind : str
        Kind of the descriptors that are made of them.
    marker_labels : tuple of str
        Its markers.
    marker_positions : ndarray, shape (n_markers, 3)
        Their places in the object frame [m].
    mechanics : Mechanics
        Friction, center of mass and radius.
    curvatures : ndarray, shape (n_points, 2)
        Principal curvatures of the cloud's points [1/m].
    neighbours : ndarray of int, shape (m, 2)
        Pairs of the cloud's points that are neighbours on the surface.
    solid : Solid
        The body that its mesh bounds, if it is closed.
    first_point : int
        Index of the cloud's first point among those that the database keeps of the object: above zero where
        a trial shows it in several live clouds.
    """

    name: str
    surface: Surface
    cloud: ObjectCloud
    distance: ObjectDistance
    histograms: NDArray[np.float32]
    features: NDArray[np.float32]
    descriptor_kind: str
    marker_labels: tuple[str, ...]
    marker_positions: Floats
    mechanics: Mechanics
    curvatures: Floats
    neighbours: NDArray[np.int64]
    solid: Solid
    first_point: int = 0


def prepare_object(described: SessionObject, parameters: IngestParameters) -> PreparedObject:
    """Load an object's surface, sample its cloud and describe its points and its mechanics.

    Raises
    ------
    ObjectError
        If the file of its mesh or cloud cannot be the surface of an object, or there is none.
    """
    if described.mesh is None:
        raise ObjectError(Path(described.name), "the object has no mesh", "Name its file as `mesh`.")
    surface = load_surface(described.mesh, described.mesh_scale)
    return prepare_cloud(described, surface, sample_cloud(surface, parameters.cloud), parameters)


def prepare_live_cloud(
    described: SessionObject, live: LiveCloud, first_point: int, parameters: IngestParameters
) -> PreparedObject:
    """Describe an object that one live cloud shows, whose points the database keeps from `first_point` on."""
    prepared = prepare_cloud(described, live.surface, live.cloud, parameters)
    return replace(prepared, first_point=first_point)


def prepare_cloud(
    described: SessionObject, surface: Surface, cloud: ObjectCloud, parameters: IngestParameters
) -> PreparedObject:
    """Describe the points of an object's cloud, and its mechanics."""
    friction = parameters.quality.friction
    histograms = point_histograms(cloud, parameters.cloud)
    return PreparedObject(
        name=described.name,
        surface=surface,
        cloud=cloud,
        distance=ObjectDistance(surface, cloud),
        histograms=histograms,
        features=local_features(histograms),
        descriptor_kind=descriptor_kind(parameters.cloud),
        marker_labels=tuple(described.markers),
        marker_positions=np.array(list(described.markers.values()), dtype=float).reshape(-1, 3),
        mechanics=object_mechanics(surface, cloud, friction, described.friction, described.center_of_mass),
        curvatures=principal_curvatures(cloud.points, cloud.normals, cloud.spacing),
        neighbours=surface_neighbours(cloud.points, cloud.normals, cloud.spacing),
        solid=Solid(surface),
    )


def join_live_clouds(
    described: SessionObject, parts: Sequence[PreparedObject], parameters: IngestParameters
) -> PreparedObject:
    """Return an object with the points of all the live clouds that a trial's grasps were found in.

    Parameters
    ----------
    described : SessionObject
        The object.
    parts : sequence of PreparedObject
        What `prepare_live_cloud` makes of each cloud, in the order of their first points; at least one.
    parameters : IngestParameters
        Friction of an object whose manifest gives none.
    """
    if len(parts) == 1:
        return parts[0]
    clouds = [part.cloud for part in parts]
    points, normals, areas = (
        np.concatenate([getattr(cloud, name) for cloud in clouds]) for name in ("points", "normals", "areas")
    )
    cloud = ObjectCloud(points, normals, areas, clouds[0].spacing)
    digest = hashlib.sha256("".join(part.surface.sha256 for part in parts).encode()).hexdigest()
    warnings = tuple(dict.fromkeys(warning for part in parts for warning in part.surface.warnings))
    live = LiveCloud(cloud, digest, warnings)
    friction = parameters.quality.friction
    return replace(
        parts[0],
        surface=live.surface,
        cloud=cloud,
        distance=live.distance,
        histograms=np.concatenate([part.histograms for part in parts]),
        features=np.concatenate([part.features for part in parts]),
        mechanics=object_mechanics(live.surface, cloud, friction, described.friction),
        curvatures=np.concatenate([part.curvatures for part in parts]),
        neighbours=np.concatenate([part.neighbours + part.first_point for part in parts]),
        solid=Solid(live.surface),
    )
