"""The real grasps of the data set DexYCB: key points of right hands on objects of known mesh."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from graspdb_ingest.grasp_rows import Grasp
from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.keypoints import KeyPointGrasp, dimensions_of, static_grasp
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject, prepare_object
from graspdb_schemas.manifest import SessionObject
from graspdb_schemas.vocabulary import DIGITS, JOINTS_OF_DIGIT, Side

THICKNESS = {
    f"{digit}_{joint}": thickness
    for digit in DIGITS
    for joint, thickness in zip(JOINTS_OF_DIGIT[digit], (0.026, 0.022, 0.019, 0.016), strict=True)
}
"""Radii of 13 mm at the knuckles to 8 mm at the tips, which the data's page states for its hands."""


def prepare_objects(folder: Path, parameters: IngestParameters) -> dict[str, PreparedObject]:
    """Return the objects of the data set that there are grasps of."""
    return {
        path.stem: prepare_object(SessionObject(path.stem, path, 1.0, {}), parameters)
        for path in sorted((folder / "meshes").glob("*.obj"))
    }


def read_grasps(
    folder: Path, thickness: Mapping[str, float] | None = THICKNESS
) -> dict[str, list[KeyPointGrasp]]:
    """Return all grasps, by object; all hands of the data set have one size.

    With no thicknesses of joints [m] they follow from the size of the hand, as for any key points.
    """
    with np.load(folder / "grasps.npz") as arrays:
        joints = {name.removesuffix(".joints_m"): arrays[name].astype(np.float64) for name in arrays.files}
    measured = dimensions_of(np.concatenate(list(joints.values())))
    size = HandDimensions(measured.hand_length, measured.hand_breadth, thickness or {})
    return {
        name: [
            KeyPointGrasp("dexycb", f"{name}_{i}", "someone", Side.RIGHT, points, size)
            for i, points in enumerate(hands)
        ]
        for name, hands in joints.items()
    }


def find_all(
    folder: Path, thickness: Mapping[str, float] | None = THICKNESS
) -> Iterator[tuple[PreparedObject, KeyPointGrasp, Grasp]]:
    """Yield every grasp with contacts, hull and feature."""
    parameters = IngestParameters()
    objects = prepare_objects(folder, parameters)
    for name, grasps in read_grasps(folder, thickness).items():
        for described in grasps:
            yield objects[name], described, static_grasp(described, objects[name], parameters)[0]
