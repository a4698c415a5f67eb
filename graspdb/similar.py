"""Parts and objects from outside, described as those of a database are."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.descriptor import describe, describe_features, descriptor_kind, local_features
from graspdb_ingest.feature import principal_extents
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_ingest.parameters import CloudParameters
from graspdb_queries.similar.library import Cloud, sizes_of
from graspdb_queries.similar.metric import Vectors
from graspdb_queries.similar.part import Part
from graspdb_queries.similar.places import NewObject
from graspdb_queries.similar.question import Question
from graspdb_schemas.errors import ObjectError

KIND: Final = descriptor_kind(CloudParameters())
"""Kind of the descriptors made here."""

LEAST_POINTS: Final = 10
"""Fewer points than this, at the spacing of clouds, are no surface to describe."""

_DECIMALS: Final = 8
"""Decimals of a metre that positions are rounded to before sampling: 10 nm."""

LARGEST_PART: Final = 0.5
"""Largest extent of what a hand encloses [m]."""


def part_question(path: Path, scale: float) -> Question:
    """Return a part of an object, read from a file, as a question.

    A cloud without normals is described with either side out, and the nearer counts.

    Parameters
    ----------
    path : Path
        A cloud (PLY, PCD) or a mesh (STL, OBJ, PLY, GLB, OFF) of the part alone.
    scale : float
        Factor from the file's numbers to metres.

    Raises
    ------
    ObjectError
        If the file cannot be read, holds too few points, or its size says that the unit is wrong.
    """
    parameters = CloudParameters()
    surface = load_surface(path, scale, whole=False)
    largest = float(surface.extents.max())
    if largest > LARGEST_PART:
        raise ObjectError(
            path,
            f"its largest extent is {largest:.4g} m; a hand encloses at most {LARGEST_PART:g} m",
            "Check --units, or cut out the part that is meant.",
        )
    cloud = _cloud(path, surface, parameters)
    oriented = surface.faces is not None or surface.normals is not None
    clouds = [cloud] if oriented else [cloud, _turned(cloud)]
    described = [_described(one, parameters) for one in clouds]
    nowhere = np.full((4, 4), np.nan)
    extents = principal_extents(cloud.points, cloud.areas)
    return Question(
        name=str(path),
        kind=KIND,
        descriptors=np.stack([descriptor for _, descriptor in described]),
        size=sizes_of(extents[None], cloud.areas.sum(keepdims=True))[0],
        part=Part(str(path), cloud.points, cloud.normals, described[0][0], nowhere, oriented),
        hand=None,
        side=None,
        contacts=np.empty((0, 3)),
        inside=False,
    )


def new_object(path: Path, scale: float) -> NewObject:
    """Return a whole object, read from a file, as those of a database are described.

    Parameters
    ----------
    path : Path
        A mesh (STL, OBJ, PLY, GLB, OFF) or a cloud (PLY, PCD).
    scale : float
        Factor from the file's numbers to metres.

    Raises
    ------
    ObjectError
        If the file cannot be read, holds too few points, or its size says that the unit is wrong.
    """
    parameters = CloudParameters()
    cloud = _cloud(path, load_surface(path, scale), parameters)
    histograms = point_histograms(cloud, parameters)
    features = local_features(histograms)

    def described(rows: NDArray[np.int64]) -> Vectors:
        return describe_features(cloud.points[rows], cloud.normals[rows], features[rows], cloud.areas[rows])

    return NewObject(
        name=str(path),
        kind=KIND,
        cloud=Cloud(cloud.points, cloud.normals, histograms),
        area=float(cloud.areas.sum()),
        describe=described,
    )


def _cloud(path: Path, surface: Surface, parameters: CloudParameters) -> ObjectCloud:
    """Return the cloud of a surface from a file; raise ObjectError if it has too few points."""
    cloud = _sampled(surface, parameters)
    if len(cloud.points) < LEAST_POINTS:
        raise ObjectError(
            path,
            f"{len(cloud.points)} points remain at {1e3 * parameters.spacing:g} mm from each other",
            f"At least {LEAST_POINTS} are needed to describe a surface; check --units.",
        )
    return cloud


def _sampled(surface: Surface, parameters: CloudParameters) -> ObjectCloud:
    """Return a surface's cloud, with the same points wherever and however the surface lies.

    Sampling depends on the frame; so it is done in the surface's own, along its principal axes, each
    pointing where the points reach further.
    """
    centre = surface.vertices.mean(axis=0)
    offsets = surface.vertices - centre
    axes = np.linalg.eigh(offsets.T @ offsets)[1]
    axes[:, :2] *= np.where(((offsets @ axes[:, :2]) ** 3).sum(axis=0) < 0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    own = replace(
        surface,
        # Rounded far below what anybody measures, so that the last bits of a motion do not matter.
        vertices=np.round(offsets @ axes, _DECIMALS),
        normals=None if surface.normals is None else surface.normals @ axes,
    )
    cloud = sample_cloud(own, parameters)
    return replace(cloud, points=cloud.points @ axes.T + centre, normals=cloud.normals @ axes.T)


def _described(cloud: ObjectCloud, parameters: CloudParameters) -> tuple[Vectors, Vectors]:
    """Return histograms and descriptor of a cloud."""
    histograms = point_histograms(cloud, parameters)
    return histograms, describe(cloud.points, cloud.normals, histograms, cloud.areas)


def _turned(cloud: ObjectCloud) -> ObjectCloud:
    """Return a cloud with its normals the other way round."""
    return ObjectCloud(cloud.points, -cloud.normals, cloud.areas, cloud.spacing)
