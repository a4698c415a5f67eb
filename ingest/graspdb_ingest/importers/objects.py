"""An imported object, from where its surface comes from to what contact needs."""

from typing import Final

import numpy as np

from graspdb_ingest.file_hash import file_sha256
from graspdb_ingest.importers.base import ObjectSource
from graspdb_ingest.objects.cloud import sample_cloud
from graspdb_ingest.objects.files import Geometry, read_geometry
from graspdb_ingest.objects.mesh import surface_of
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject, prepare_cloud
from graspdb_schemas.manifest import SessionObject

MIRROR: Final = np.array([-1.0, 1.0, 1.0])


def prepare_source(source: ObjectSource, parameters: IngestParameters) -> PreparedObject:
    """Load an object's surface, sample its cloud and describe its points.

    Raises
    ------
    ObjectError
        If the file is missing or damaged, or its size says that its unit is wrong.
    """
    if source.vertices is not None:
        geometry = Geometry(
            np.asarray(source.vertices, dtype=np.float64), source.faces, None, file_sha256(source.file) or ""
        )
        surface = surface_of(source.file, geometry)
    else:
        geometry = read_geometry(source.file)
        surface = surface_of(source.file, _mirrored(geometry) if source.mirrored else geometry, source.scale)
    described = SessionObject(source.name, source.file, source.scale, {}, source.mass, source.category)
    return prepare_cloud(described, surface, sample_cloud(surface, parameters.cloud), parameters)


def _mirrored(geometry: Geometry) -> Geometry:
    """Negate x; the corners of a face are turned round, so that its outside stays outside."""
    faces = None if geometry.faces is None else np.asarray(geometry.faces[:, ::-1])
    normals = None if geometry.normals is None else np.asarray(geometry.normals * MIRROR, dtype=np.float64)
    return Geometry(np.asarray(geometry.vertices * MIRROR, dtype=np.float64), faces, normals, geometry.sha256)
