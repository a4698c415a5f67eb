"""Format ``arctic``: ARCTIC, two hands with articulated objects.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  a part of the object in a sequence, ``raw_seqs/<subject>/<sequence>``
subject                the folder
hands                  ``*.mano.npy``: ``rot``, ``pose``, ``trans``, ``shape`` of right and left, MANO
                       about the mean hand
object                 ``meta/object_vtemplates/<object>/top.obj`` and ``bottom.obj``, millimetres
object pose            ``*.object.npy``: articulation, rotation vector, translation in millimetres
task                   the word in the sequence's name: grab or use
rate, frame            30 Hz; metres, z up
=====================  ===========================================================================

An articulated object is no rigid body, but each of its parts is one, so each sequence gives two trials, one
with the lower part and one with the upper part, which turns about the object's own z axis. A hand that holds
both parts at once has one grasp in each. MANO's model files are needed (--mano); the left one is taken as
published, since the data set was fitted with it.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_npy
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
from graspdb_ingest.importers.fields import AGAIN, matches, numbers, rigid, rotations_of
from graspdb_ingest.importers.mano import N_POSE, N_SHAPE, find_mano, read_mano
from graspdb_ingest.importers.order import in_usual_order
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

RATE: Final = 30.0
PARTS: Final = ("bottom", "top")
MILLIMETRE: Final = 1e-3

FORMAT: Final = Format(
    name="arctic",
    title="ARCTIC",
    version="2023",
    licence="NC: non-commercial scientific research only, see the data set's licence",
    needs=(
        "raw_seqs/<subject>/<sequence>.mano.npy and .object.npy",
        "meta/object_vtemplates/<object>/top.obj and bottom.obj, or --objects",
        "--mano: MANO_RIGHT.pkl and MANO_LEFT.pkl",
    ),
    documentation="https://github.com/zc-alexfan/arctic/blob/master/docs/data/data_doc.md",
)


def recognises(path: Path) -> bool:
    """Whether a folder looks like ARCTIC's data, its raw sequences, or one of its subjects."""
    return matches(path, "*.mano.npy", "*/*.mano.npy", "raw_seqs/*/*.mano.npy")


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield both parts of each sequence under the data folder, ``raw_seqs``, or a subject's folder.

    Raises
    ------
    ImportSourceError
        If there is none, or meshes or MANO's model files are missing.
    """
    patterns = ("*.mano.npy", "*/*.mano.npy", "raw_seqs/*/*.mano.npy")
    files = [file for pattern in patterns for file in sorted(path.glob(pattern))]
    if not files:
        raise ImportSourceError(
            path, "no sequence of ARCTIC is in it", "Give the folder that holds raw_seqs/."
        )
    models = [find_mano(options.mano, side, path) for side in Side]
    for file in files:
        sequence = file.name.removesuffix(".mano.npy")
        thing = sequence.partition("_")[0]
        motion = file.with_name(f"{sequence}.object.npy")
        templates = options.objects or file.parent.parent.parent / "meta" / "object_vtemplates"
        for part in PARTS:
            mesh = templates / thing / f"{part}.obj"
            if not mesh.is_file():
                raise ImportSourceError(
                    mesh, f"it is missing, for {file.name}", "Get meta/, or name --objects."
                )
            yield ClipSource(
                name=clip_name(file.parent.name, sequence, part),
                subject=file.parent.name,
                files=(file, motion, *models),
                object=ObjectSource(f"{thing}_{part}", mesh, MILLIMETRE, category=thing),
                part={"part": part},
            )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one part of a sequence.

    Raises
    ------
    ImportSourceError
        If a file is missing, cut off or of another layout.
    """
    file, motion = source.files[:2]
    content = read_npy(file)
    hands = [_hand(content, side, model, file) for side, model in zip(Side, source.files[2:4], strict=True)]
    states = numbers({"object": read_npy(motion)}, "object", (None, 7), motion)
    if any(len(hand.key_points) != len(states) for hand in hands):
        counts = [len(hand.key_points) for hand in hands]
        raise ImportSourceError(motion, f"it has {len(states)} frames, the hands {counts}", AGAIN)
    sequence = file.name.removesuffix(".mano.npy")
    return Clip(
        hands=tuple(hands),
        rate=options.rate or RATE,
        identifier=f"{file.parent.name}/{sequence}",
        poses=_poses(states, source.part["part"]),
        up=(0.0, 0.0, 1.0),
        task=next((word for word in sequence.split("_") if word in ("grab", "use")), None),
        attributes={"part": source.part["part"]},
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _hand(content: object, side: Side, model: Path, file: Path) -> ClipHand:
    pose = numbers(content, f"{side}.pose", (None, N_POSE), file)
    orientation = numbers(content, f"{side}.rot", (len(pose), 3), file)
    place = numbers(content, f"{side}.trans", (len(pose), 3), file)
    shape = numbers(content, f"{side}.shape", ((N_SHAPE,), (len(pose), N_SHAPE)), file)
    mano = read_mano(model, side)
    full = mano.full_pose(pose, components=False, flat_hand_mean=False)
    return ClipHand(side, in_usual_order(mano.key_points(full, orientation, place, shape), "mano"))


def _poses(states: Floats, part: str) -> Floats:
    """Return world_from_part, shape (n, 4, 4), of states (n, 7)."""
    rotations = rotations_of(states[:, 1:4])
    if part == "top":
        # The upper part is opened by its angle about -z in the object's frame, then both are turned.
        rotations = rotations @ rotations_of(states[:, :1] * [[0.0, 0.0, -1.0]])
    return rigid(rotations, MILLIMETRE * states[:, 4:])
