"""Format ``oakink``: OakInk-Image, right hands that use, hold, lift and hand over objects.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  one hand in a sequence, ``<object>_<intent>_<subject>/<time>``; a handover has two
subject                from the sequence's name; of a handover's two the flag of the sample says which
hand                   ``image/anno/hand_j``: 21 joints, right, in OpenPose's order
object                 ``image/obj/<object>.obj`` or ``.ply``
object pose            ``image/anno/obj_transf``, of the mesh moved to the middle of its bounding box
task                   the intent: use, hold, liftup, handover
rate, frame            30 Hz by the numbers of the frames; that of the camera which has most of them
=====================  ===========================================================================

All is in the axes of one fixed camera, and which way is up is not known there. ``general_info``, which holds
tensors of another library, is not read.
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_pickle
from graspdb_ingest.importers.base import (
    Clip,
    ClipHand,
    ClipSource,
    Format,
    Importer,
    ImportOptions,
    ObjectSource,
    clip_name,
)
from graspdb_ingest.importers.fields import AGAIN, matches, mesh_of, metres_in, n_frames_of, numbers
from graspdb_ingest.importers.meshes import find_mesh
from graspdb_ingest.importers.order import in_usual_order
from graspdb_ingest.objects.files import read_geometry
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

RATE: Final = 30.0
INTENTS: Final = {"0001": "use", "0002": "hold", "0003": "liftup", "0004": "handover"}

FORMAT: Final = Format(
    name="oakink",
    title="OakInk-Image",
    version="annotations 2.1",
    licence="that of the data set, see www.oakink.net (its toolkit is MIT)",
    needs=(
        "image/anno/hand_j/*.pkl and image/anno/obj_transf/*.pkl",
        "image/obj/<object>.obj or .ply, or --objects",
    ),
    documentation="https://github.com/oakink/OakInk/blob/main/docs/datasets.md",
)
_SAMPLE: Final = re.compile(
    r"(?P<object>[A-Za-z0-9]+)__?(?P<intent>\d{4})__?(?P<subjects>\d{4}(?:__?\d{4})?)"
    r"__(?P<time>[0-9-]+)__(?P<hand>\d)__(?P<frame>\d+)__(?P<camera>\d+)\.pkl"
)


def recognises(path: Path) -> bool:
    """Whether a folder looks like OakInk or its folder ``image``."""
    return matches(path, "image/anno/hand_j/*.pkl", "anno/hand_j/*.pkl")


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the hands of all sequences under the data set's folder or its folder ``image``.

    Raises
    ------
    ImportSourceError
        If there is none, or a mesh is missing.
    """
    image = path / "image" if (path / "image" / "anno").is_dir() else path
    hands: dict[tuple[str, str, str, str, str], list[tuple[int, int, Path]]] = {}
    for file in sorted((image / "anno" / "hand_j").glob("*.pkl")):
        match = _SAMPLE.fullmatch(file.name)
        if match:
            people = match["subjects"].replace("__", "_")
            key = match["object"], match["intent"], people, match["time"], match["hand"]
            hands.setdefault(key, []).append((int(match["camera"]), int(match["frame"]), file))
    if not hands:
        raise ImportSourceError(
            path, "no sample of OakInk-Image is in it", "Give the folder that holds image/."
        )
    for (thing, intent, subjects, time, hand), samples in hands.items():
        counts = Counter(camera for camera, _, _ in samples)
        chosen = min(counts, key=lambda camera: (-counts[camera], camera))
        joints = [file for _, file in sorted((f, file) for camera, f, file in samples if camera == chosen)]
        mesh = find_mesh(thing, image / "obj", options)
        people = subjects.split("_")
        yield ClipSource(
            name=clip_name(thing, intent, subjects, time, hand if len(people) > 1 else ""),
            subject=people[min(int(hand), len(people) - 1)],
            files=tuple(joints) + tuple(image / "anno" / "obj_transf" / file.name for file in joints),
            object=ObjectSource(thing, mesh),
            part={
                "task": INTENTS.get(intent),
                "camera": chosen,
                "identifier": f"{thing}_{intent}_{subjects}/{time}",
            },
        )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one hand in one sequence.

    Raises
    ------
    ImportSourceError
        If a file is missing, cut off or of another layout.
    """
    half = len(source.files) // 2
    frames = [_frame(file) for file in source.files[:half]]
    n_frames = n_frames_of(frames, source.files[0])
    scale = metres_in(options)
    points = np.full((n_frames, 21, 3), np.nan)
    poses = np.full((n_frames, 4, 4), np.nan)
    middle = np.eye(4)
    middle[:3, 3] = -_middle(mesh_of(source))
    for frame, joints, pose in zip(frames, source.files[:half], source.files[half:], strict=True):
        seen = numbers({"hand_j": read_pickle(joints)}, "hand_j", (21, 3), joints)
        points[frame - frames[0]] = in_usual_order(scale * seen, options.order or "openpose")
        placed = numbers({"obj_transf": read_pickle(pose)}, "obj_transf", (4, 4), pose)
        placed[:3, 3] *= scale
        poses[frame - frames[0]] = placed @ middle
    return Clip(
        hands=(ClipHand(Side.RIGHT, points),),
        rate=options.rate or RATE,
        identifier=source.part["identifier"],
        poses=poses,
        task=source.part["task"],
        attributes={"camera": source.part["camera"], "first_frame": frames[0]},
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _middle(mesh: Path) -> Floats:
    """Return the middle of a mesh's bounding box, shape (3,)."""
    vertices = read_geometry(mesh).vertices
    if not np.isfinite(vertices).all():
        raise ImportSourceError(mesh, "it has vertices that are nowhere", AGAIN)
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _frame(file: Path) -> int:
    match = _SAMPLE.fullmatch(file.name)
    if match is None:
        raise ImportSourceError(file, "its name is not that of a sample", AGAIN)
    return int(match["frame"])
