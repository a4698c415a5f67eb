"""The real grasps of the data set DexYCB: key points of right hands on objects of known mesh."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from graspdb_ingest.grasp_rows import Grasp
from graspdb_ingest.keypoints import KeyPointGrasp, dimensions_of, static_grasp
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedObject, prepare_object
from graspdb_schemas.manifest import SessionObject
from graspdb_schemas.vocabulary import Side


def prepare_objects(folder: Path, parameters: IngestParameters) -> dict[str, PreparedObject]:
    """Return the objects of the data set that there are grasps of."""
    return {
        path.stem: prepare_object(SessionObject(path.stem, path, 1.0, {}), parameters)
        for path in sorted((folder / "meshes").glob("*.obj"))
    }


def read_grasps(folder: Path) -> dict[str, list[KeyPointGrasp]]:
    """Return all grasps, by object; all hands of the data set have one size."""
    with np.load(folder / "grasps.npz") as arrays:
        joints = {name.removesuffix(".joints_m"): arrays[name].astype(np.float64) for name in arrays.files}
    size = dimensions_of(np.concatenate(list(joints.values())))
    return {
        name: [
            KeyPointGrasp("dexycb", f"{name}_{i}", "someone", Side.RIGHT, points, size)
            for i, points in enumerate(hands)
        ]
        for name, hands in joints.items()
    }


def find_all(folder: Path) -> Iterator[tuple[PreparedObject, KeyPointGrasp, Grasp]]:
    """Yield every grasp with contacts, hull and feature."""
    parameters = IngestParameters()
    objects = prepare_objects(folder, parameters)
    for name, grasps in read_grasps(folder).items():
        for described in grasps:
            yield objects[name], described, static_grasp(described, objects[name], parameters)[0]
