"""Format ``grab``: GRAB, whole-body grasps of 51 objects by motion capture.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  a sequence, ``grab/<subject>/<object>_<intent>_<number>.npz``
subject                ``sbj_id``
hands                  ``rhand`` and ``lhand``: MANO with the person's own template (``vtemp``), principal
                       components about the flat hand
object                 ``object.object_mesh``, below the data set's folder
object pose            ``object.params``; its rotation is applied to rows, so it is the transpose's
measured contact       ``contact.object``: vertices that a part of either hand touches, in each frame
task                   ``motion_intent``
rate, frame            ``framerate`` (120 Hz); metres, z up
=====================  ===========================================================================

Files keep dicts as pickled objects, which are read as data alone. MANO's model files are needed (--mano).
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.archives import read_npz
from graspdb_ingest.importers.base import (
    Clip,
    ClipHand,
    ClipSource,
    Format,
    Importer,
    ImportOptions,
    MeasuredContact,
    ObjectSource,
    clip_name,
)
from graspdb_ingest.importers.fields import (
    AGAIN,
    entry,
    matches,
    mesh_of,
    numbers,
    rigid,
    rotations_of,
    word,
)
from graspdb_ingest.importers.mano import N_SHAPE, find_mano, read_mano
from graspdb_ingest.importers.order import in_usual_order
from graspdb_ingest.objects.files import read_geometry
from graspdb_schemas.errors import ImportSourceError, UnsafeFileError
from graspdb_schemas.vocabulary import Side

HANDS: Final[Mapping[Side, str]] = {Side.RIGHT: "rhand", Side.LEFT: "lhand"}
HAND_PARTS: Final = (21, 22, *range(26, 56))
"""Numbers of the parts of both hands in ``contact``: palms, and three segments a digit."""

FORMAT: Final = Format(
    name="grab",
    title="GRAB",
    version="2020",
    licence="NC: non-commercial scientific research only, see the data set's licence",
    needs=(
        "grab/<subject>/<object>_<intent>_<number>.npz",
        "tools/object_meshes and tools/subject_meshes",
        "--mano: MANO_RIGHT.pkl and MANO_LEFT.pkl",
    ),
    documentation="https://github.com/otaheri/GRAB",
)
_KEYS: Final = (
    "sbj_id",
    "obj_name",
    "motion_intent",
    "framerate",
    "n_frames",
    "rhand",
    "lhand",
    "object",
    "contact",
)


def recognises(path: Path) -> bool:
    """Whether a folder looks like GRAB, its folder ``grab``, or one of its subjects."""
    return matches(path, "grab/s[0-9]*/*_*.npz", "s[0-9]*/*_*.npz", "s[0-9]*_*hand.ply") or (
        path.name.startswith("s") and path.parent.name == "grab" and matches(path, "*_*.npz")
    )


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the sequences under the data set's folder, its folder ``grab``, or that of a subject.

    Raises
    ------
    ImportSourceError
        If there is none, or meshes or MANO's model files are missing.
    """
    patterns = ("grab/s[0-9]*/*_*.npz", "s[0-9]*/*_*.npz", "*_*.npz")
    files = next((found for pattern in patterns if (found := sorted(path.glob(pattern)))), [])
    if not files or not recognises(path):
        raise ImportSourceError(
            path, "no sequence of GRAB is in it", "Give the folder that holds grab/ and tools/."
        )
    models = [find_mano(options.mano, side, path) for side in Side]
    for file in files:
        root = _root(file)
        content = read_npz(file, ("obj_name", "object", "rhand", "lhand"))
        mesh = _inside(root, word(content, "object.object_mesh", file), file)
        templates = [_inside(root, word(content, f"{name}.vtemp", file), file) for name in HANDS.values()]
        name = word(content, "obj_name", file)
        yield ClipSource(
            name=clip_name(file.parent.name, file.stem),
            subject=file.parent.name,
            files=(file, *templates, *models),
            object=ObjectSource(name, mesh, category=name),
        )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one sequence.

    Raises
    ------
    ImportSourceError
        If a file is cut off or of another layout.
    ObjectError
        If a mesh is.
    """
    file = source.files[0]
    content = read_npz(file, _KEYS)
    vectors = numbers(content, "object.params.global_orient", (None, 3), file)
    # GRAB turns rows of vertices, v R, and so by the transpose of R.
    rotations = np.swapaxes(rotations_of(vectors), 1, 2)
    positions = numbers(content, "object.params.transl", (len(vectors), 3), file)
    given = zip(Side, source.files[1:3], source.files[3:5], strict=True)
    hands = [_hand(content, side, template, model, file) for side, template, model in given]
    if any(len(hand.key_points) != len(vectors) for hand in hands):
        raise ImportSourceError(file, "hands and object have different numbers of frames", AGAIN)
    return Clip(
        hands=tuple(hands),
        rate=options.rate or float(numbers(content, "framerate", (), file)),
        identifier=f"{file.parent.name}/{file.stem}",
        poses=rigid(rotations, positions),
        up=(0.0, 0.0, 1.0),
        task=word(content, "motion_intent", file),
        measured=_measured(content, mesh_of(source), len(vectors), file),
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _root(file: Path) -> Path:
    """Return the folder that holds ``tools``."""
    for folder in (file.parent.parent.parent, file.parent.parent, file.parent):
        if (folder / "tools").is_dir():
            return folder
    found = "tools/ is missing beside grab/"
    raise ImportSourceError(
        file.parent.parent.parent, found, "Unpack the meshes of objects and subjects there."
    )


def _inside(root: Path, named: str, file: Path) -> Path:
    """Return a file that a sequence names, if it lies in the data set's folder."""
    path = root / named.replace("\\", "/")
    if not path.resolve().is_relative_to(root.resolve()):
        raise UnsafeFileError(file, f"it names {named!r}, outside of the data set", AGAIN)
    if not path.is_file():
        raise ImportSourceError(
            path, f"it is missing, for {file.name}", "Unpack the meshes of the data set (tools/)."
        )
    return path


def _hand(content: object, side: Side, template: Path, model: Path, file: Path) -> ClipHand:
    name = HANDS[side]
    pose = numbers(content, f"{name}.params.hand_pose", (None, None), file)
    orientation = numbers(content, f"{name}.params.global_orient", (len(pose), 3), file)
    place = numbers(content, f"{name}.params.transl", (len(pose), 3), file)
    own = read_mano(model, side).with_template(read_geometry(template).vertices)
    full = own.full_pose(pose, components=True, flat_hand_mean=True)
    points = own.key_points(full, orientation, place, np.zeros(N_SHAPE))
    return ClipHand(side, in_usual_order(points, "mano"))


def _measured(content: Mapping[str, Any], mesh: Path, n_frames: int, file: Path) -> MeasuredContact | None:
    """Return which vertices of the object the hands touch in which frame."""
    if "contact" not in content:
        return None
    vertices: Floats = read_geometry(mesh).vertices
    parts = np.asarray(entry(content, "contact.object", file))
    if parts.shape != (n_frames, len(vertices)) or parts.dtype.kind not in "iu":
        wanted = f"{n_frames} frames and the {len(vertices)} vertices of {mesh.name}"
        found = f"contact.object has shape {parts.shape} for {wanted}"
        raise ImportSourceError(file, found, "Get the sequence and its mesh again.")
    return MeasuredContact("annotated", vertices, np.isin(parts, HAND_PARTS))
