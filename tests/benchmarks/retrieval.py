"""Real grasps of 17 objects as a database, and how well their features find each other.

The grasps are 21 key points each, in the frame of the object; they go through the same contact, enclosing
space, feature and store as any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from dexycb import read_grasps
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from graspdb.database import Database
from graspdb.store import Store
from graspdb_ingest.descriptor import describe, descriptor_kind
from graspdb_ingest.importers.base import Clip, ClipSource, Importer, ImportOptions
from graspdb_ingest.importers.clip import ImportJob, process_clip
from graspdb_ingest.importers.keypoints import IMPORTER
from graspdb_ingest.importers.objects import prepare_source
from graspdb_ingest.importers.session import imported_session_rows
from graspdb_ingest.importers.survey import SurveyedSubject
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.fpfh import point_histograms
from graspdb_ingest.objects.mesh import load_surface
from graspdb_ingest.parameters import CloudParameters, IngestParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_queries.similar.library import descriptors_of, sizes_of
from graspdb_queries.similar.metric import learn_metric
from graspdb_schemas.vocabulary import Side

LEAST_POINTS = 30
"""Features of fewer points are too small to be told apart."""

Floats = NDArray[np.float64]
Vectors = NDArray[np.float32]


def build(data: Path, folder: Path, every: int = 1, workers: int = 2) -> None:
    """Write every n-th grasp of every object into a database, with radii as the data's page states them."""
    options = ImportOptions(session="dexycb", side=Side.RIGHT, subject="someone", objects=data)
    job = ImportJob(_every(every), options, IngestParameters())
    size = next(iter(read_grasps(data).values()))[0].dimensions
    subject = SurveyedSubject("someone", size, (Side.RIGHT,))
    store = Store.create_or_open(folder)
    tasks = (delayed(_rows)(job, source, subject) for source in job.importer.find(data, options))
    for shared, clip in Parallel(n_jobs=workers, return_as="generator")(tasks):
        store.commit_session(shared)
        store.commit_trial(clip)


def _rows(job: ImportJob, source: ClipSource, subject: SurveyedSubject) -> tuple[TrialTables, TrialTables]:
    """Return the rows of an object's grasps, and those that they stand on."""
    if source.object is None:
        raise ValueError("grasps without an object")
    prepared = prepare_source(source.object, job.parameters)
    shared = imported_session_rows(job.session, [subject], (source.object, prepared))
    return shared, process_clip(job, source, subject, prepared)


def _every(n: int) -> Importer:
    """Return the importer of key points, which leaves out all but each n-th posture of a clip."""
    return replace(IMPORTER, read=partial(_read_every, n))


def _read_every(n: int, source: ClipSource, options: ImportOptions) -> Clip:
    clip = IMPORTER.read(source, options)
    hands = tuple(replace(hand, key_points=hand.key_points[::n]) for hand in clip.hands)
    return replace(clip, hands=hands)


@dataclass(frozen=True, eq=False)
class Gallery:
    """Features of a database, those of at least 30 points.

    Attributes
    ----------
    keys : list of str
        Their grasps, in order.
    objects : ndarray of str, shape (n,)
        Their objects.
    descriptors : ndarray of float32, shape (n, 428)
        Their descriptors.
    partners : ndarray of bool, shape (n, n)
        Which share at least half of their points (intersection over union).
    """

    keys: list[str]
    objects: NDArray[np.str_]
    descriptors: Vectors
    partners: NDArray[np.bool_]


def gallery(database: Database) -> Gallery:
    """Return the features of a database."""
    table = database.sql(
        "SELECT grasp, object, points, descriptor FROM features "
        f"WHERE len(points) >= {LEAST_POINTS} ORDER BY grasp"
    ).table
    objects = np.array(table["object"].to_pylist())
    points = [set(row) for row in table["points"].to_pylist()]
    partners = np.zeros((len(points), len(points)), dtype=bool)
    for i, mine in enumerate(points):
        for j in np.flatnonzero(objects[:i] == objects[i]):
            partners[i, j] = partners[j, i] = 2 * len(mine & points[j]) >= len(mine | points[j])
    return Gallery(table["grasp"].to_pylist(), objects, descriptors_of(table["descriptor"]), partners)


def perturbed(database: Database, found: Gallery, data: Path, seed: int = 7) -> Vectors:
    """Return the descriptors of the same features on other samples of the objects, moved, 0.5 mm of noise."""
    rng = np.random.default_rng(seed)
    parameters = CloudParameters(seed=seed)
    hulls = dict(database.sql("SELECT grasp, hull_vertices FROM features").rows())
    described = np.zeros_like(found.descriptors)
    for name in np.unique(found.objects):
        clean = sample_cloud(load_surface(data / "meshes" / f"{name}.obj", 1.0), parameters)
        turn, shift = Rotation.random(rng=rng), rng.normal(size=3)
        noisy = turn.apply(clean.points + rng.normal(size=clean.points.shape) * 0.0005) + shift
        cloud = ObjectCloud(noisy, turn.apply(clean.normals), clean.areas, clean.spacing)
        histograms = point_histograms(cloud, parameters)
        for i in np.flatnonzero(found.objects == name):
            planes = ConvexHull(turn.apply(np.array(hulls[found.keys[i]])) + shift).equations
            inside = np.flatnonzero((noisy @ planes[:, :3].T + planes[:, 3] <= 1e-9).all(axis=1))
            described[i] = describe(
                noisy[inside], cloud.normals[inside], histograms[inside], cloud.areas[inside]
            )
    return described


def distances(found: Gallery, queries: Vectors) -> Floats:
    """Return distances of queries to all features by a metric of these features; the own one is infinite."""
    metric = learn_metric(found.descriptors)
    return _apart(metric.vectors(queries), metric.vectors(found.descriptors))


def distances_by_others(found: Gallery, queries: Vectors) -> Floats:
    """Return the same by metrics learned from half of the objects, for queries of the other half."""
    names = np.unique(found.objects)
    apart = np.full((len(queries), len(queries)), np.inf)
    for first in (0, 1):
        learned = np.isin(found.objects, names[first::2])
        metric = learn_metric(found.descriptors[learned])
        vectors = metric.vectors(found.descriptors)
        apart[~learned] = _apart(metric.vectors(queries), vectors)[~learned]
    return np.asarray(apart)


def size_distances(database: Database, found: Gallery) -> Floats:
    """Return distances of the features' sizes; the own one is infinite."""
    rows = database.sql("SELECT grasp, extents, area FROM features").rows()
    known = {grasp: (extents, area) for grasp, extents, area in rows if grasp in set(found.keys)}
    sizes = sizes_of(
        np.array([known[key][0] for key in found.keys]), np.array([known[key][1] for key in found.keys])
    )
    return _apart(sizes, sizes)


def same_object(found: Gallery, apart: Floats, count: int) -> float:
    """Return the share of the nearest features that are of the query's object."""
    order = np.argsort(apart, axis=1, kind="stable")[:, :count]
    return float((found.objects[order] == found.objects[:, None]).mean())


def reciprocal_rank(found: Gallery, order: Sequence[NDArray[np.int64]], queries: NDArray[np.int64]) -> float:
    """Return the mean reciprocal rank of the first partner; zero where none is in the order."""
    ranks = []
    for i, ranked in zip(queries, order, strict=True):
        hits = np.flatnonzero(found.partners[i, ranked])
        ranks.append(1 / (1 + hits[0]) if len(hits) else 0.0)
    return float(np.mean(ranks))


def kind() -> str:
    """Return the kind of descriptors that the default parameters make."""
    return descriptor_kind(CloudParameters())


def _apart(queries: Vectors, vectors: Vectors) -> Floats:
    offsets = queries[:, None].astype(float) - vectors
    apart = np.sqrt((offsets**2).sum(axis=2))
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart)
