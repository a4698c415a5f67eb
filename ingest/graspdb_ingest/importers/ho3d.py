"""Format ``ho3d``: HO-3D, right hands with YCB objects before depth cameras.

=====================  ===========================================================================
here                   in the data set
=====================  ===========================================================================
trial                  a sequence, ``train/<sequence>``; frames are numbered by their file names
subject                sequences with the same hand shape, ``handBeta``; people are not named
hand                   ``handJoints3D`` of ``meta/*.pkl``, right, in MANO's order with tips
object                 ``objName``, in ``models/<name>/textured_simple.obj`` (YCB-Video models)
object pose            ``objRot`` (rotation vector) and ``objTrans``
frame                  that of the camera; OpenGL's axes (y up, z backwards) become x right, y down, z ahead
rate                   20 Hz; its authors did not note it and say that it varies from 10 to 25 (--rate)
=====================  ===========================================================================

Frames without annotation have None in their file. The evaluation split has the wrist alone and is of no use.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.importers.archives import read_pickle
from graspdb_ingest.importers.base import (
    Clip,
    ClipHand,
    ClipSource,
    Format,
    Importer,
    ImportOptions,
    ObjectSource,
)
from graspdb_ingest.importers.fields import (
    entry,
    find_ycb_mesh,
    matches,
    metres_in,
    n_frames_of,
    numbers,
    rigid,
    rotations_of,
    word,
)
from graspdb_ingest.importers.order import in_usual_order
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

RATE: Final = 20.0
_FROM_OPENGL: Final = np.array([1.0, -1.0, -1.0])
"""Diagonal of the half turn about x that carries OpenGL's axes into those of images."""

FORMAT: Final = Format(
    name="ho3d",
    title="HO-3D",
    version="2 and 3",
    licence="NC: non-commercial academic research only, no redistribution, see the data set's terms",
    needs=("train/<sequence>/meta/*.pkl", "models/<object>/textured_simple.obj, or --objects"),
    documentation="https://github.com/shreyashampali/ho3d",
)


def recognises(path: Path) -> bool:
    """Whether a folder looks like HO-3D, one of its splits or one of its sequences."""
    return matches(path, "meta/[0-9]*.pkl", "*/meta/[0-9]*.pkl", "train/*/meta/[0-9]*.pkl")


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the sequences under the data set's folder (those of ``train``), a split's, or one of their own.

    Raises
    ------
    ImportSourceError
        If there is none, or a mesh is missing.
    """
    folders = [
        folder
        for pattern in ("meta", "*/meta", "train/*/meta")
        for folder in sorted(path.glob(pattern))
        if any(file.stem.isdecimal() for file in folder.glob("[0-9]*.pkl"))
    ]
    if not folders:
        raise ImportSourceError(path, "no sequence of HO-3D is in it", "Give the folder that holds train/.")
    for folder in folders:
        sequence = folder.parent
        numbered = [file for file in folder.glob("[0-9]*.pkl") if file.stem.isdecimal()]
        files = tuple(sorted(numbered, key=lambda file: int(file.stem)))
        first = _first(files)
        name = word(first, "objName", files[0])
        root = sequence.parent.parent if sequence.parent.name in ("train", "evaluation") else sequence.parent
        mesh = find_ycb_mesh(name, root, options)
        yield ClipSource(
            name=sequence.name,
            subject=options.subject or _subject(first),
            files=files,
            object=ObjectSource(name, mesh, category=name.partition("_")[2]),
        )


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one sequence.

    Raises
    ------
    ImportSourceError
        If a file is cut off, of another layout, or of the evaluation split.
    """
    first = int(source.files[0].stem)
    n_frames = n_frames_of([int(file.stem) for file in source.files], source.files[0].parent)
    scale = metres_in(options)
    points = np.full((n_frames, 21, 3), np.nan)
    vectors, positions = np.zeros((n_frames, 3)), np.full((n_frames, 3), np.nan)
    for file in source.files:
        frame, content = int(file.stem) - first, read_pickle(file)
        if entry(content, "objRot", file) is None or entry(content, "handJoints3D", file) is None:
            continue
        joints = numbers(content, "handJoints3D", ((21, 3), (3,)), file)
        if joints.ndim == 1:
            found = "it has the wrist alone, as all of the evaluation split"
            raise ImportSourceError(file, found, "Import the folder train.")
        points[frame] = in_usual_order(scale * joints * _FROM_OPENGL, options.order or "mano")
        vectors[frame] = numbers(content, "objRot", ((3,), (3, 1)), file).ravel()
        positions[frame] = scale * numbers(content, "objTrans", (3,), file) * _FROM_OPENGL
    poses = rigid(_FROM_OPENGL[:, None] * rotations_of(vectors), positions)
    poses[np.isnan(positions[:, 0])] = np.nan
    notes = () if options.rate else (f"HO-3D does not state its rate; {RATE:g} Hz was taken",)
    return Clip(
        hands=(ClipHand(Side.RIGHT, points),),
        rate=options.rate or RATE,
        identifier=source.files[0].parent.parent.name,
        poses=poses,
        attributes={"first_frame": first},
        notes=notes,
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def _first(files: tuple[Path, ...]) -> object:
    """Return the first file's content that is annotated."""
    for file in files:
        content = read_pickle(file)
        if entry(content, "objRot", file) is not None:
            return content
    raise ImportSourceError(
        files[0].parent, "no frame in it is annotated", "Remove the sequence, or get it again."
    )


def _subject(content: object) -> str:
    """Return a name for the hands of one shape."""
    shape = content.get("handBeta") if isinstance(content, dict) else None
    if not isinstance(shape, np.ndarray):
        return "unknown"
    rounded = np.round(np.asarray(shape, dtype=np.float64).ravel(), 3) + 0.0
    return f"shape_{hashlib.sha256(rounded.tobytes()).hexdigest()[:8]}"
