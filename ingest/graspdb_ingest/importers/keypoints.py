"""Format ``keypoints``: 21 key points of hands in NPZ, CSV or Parquet files."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

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
from graspdb_ingest.importers.meshes import find_mesh
from graspdb_ingest.importers.order import in_usual_order
from graspdb_ingest.importers.posture_arrays import ARRAY, read_arrays
from graspdb_ingest.importers.posture_tables import read_table
from graspdb_ingest.importers.postures import Postures
from graspdb_schemas.errors import ImportSourceError, ParameterError
from graspdb_schemas.units import METRES_PER, metres_per
from graspdb_schemas.vocabulary import Side

ENDINGS: Final = (".npz", ".csv", ".parquet")
POSTURES_PER_CLIP: Final = 100
"""Static postures are cut into clips of so many, so that none needs much memory."""

FORMAT: Final = Format(
    name="keypoints",
    title="21 key points a hand, from any source",
    version="1",
    licence="",
    needs=("a file .npz, .csv or .parquet, or a folder of them, with key points; meshes beside it",),
    documentation="docs/import.md",
)


def recognises(path: Path) -> bool:
    """Whether a path is a file of key points, or a folder with one."""
    return any(_has_key_points(file) for file in _files(path))


def find(path: Path, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield the clips in a file, or in the files of a folder.

    Raises
    ------
    ImportSourceError
        If there is none, or a mesh is missing.
    ParameterError
        If neither file nor options say which hand it is.
    """
    files = _files(path)
    if not files:
        there = "a file" if path.is_file() else f"a folder without {' or '.join(ENDINGS)}"
        raise ImportSourceError(path, there if path.exists() else "there is no such path", "Check the path.")
    for file in files:
        for number, postures in enumerate(read_postures(file)):
            yield from _clips(file, number, postures, options)


def read(source: ClipSource, options: ImportOptions) -> Clip:
    """Read one clip.

    Raises
    ------
    ImportSourceError
        If the file can no longer be read.
    ParameterError
        If the unit or the order is unknown.
    """
    file, part = source.files[0], source.part
    postures = read_postures(file)[part["number"]]
    chosen = slice(part["start"], part["stop"])
    scale = _scale(postures.units or options.units)
    poses = postures.poses
    if poses is not None:
        poses = poses[chosen].copy()
        poses[:, :3, 3] *= scale
    order = postures.order or options.order or "usual"
    identifiers = postures.identifiers[chosen]
    return Clip(
        hands=tuple(
            ClipHand(_side(side, options), in_usual_order(points[chosen] * scale, order))
            for side, points in postures.key_points.items()
        ),
        rate=postures.rate or options.rate,
        identifier=f"{file.name}:{postures.name}[{part['start']}:{part['stop']}]",
        poses=poses,
        up=postures.up,
        task=postures.task,
        attributes={"identifiers": list(identifiers)} if identifiers else {},
    )


IMPORTER: Final = Importer(FORMAT, recognises, find, read)


def read_postures(path: Path) -> tuple[Postures, ...]:
    """Return all that a file holds; the last file asked for is kept, for its clips follow one another.

    Raises
    ------
    ImportSourceError
        If it cannot be read, or holds no key points; the message says what it holds.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise ImportSourceError(path, f"it cannot be opened ({error.strerror})", "Check the path.") from error
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=1)
def _read(path: Path, _modified: int, _size: int) -> tuple[Postures, ...]:
    return tuple(read_arrays(path) if path.suffix.lower() == ".npz" else read_table(path))


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix.lower() in ENDINGS and file.is_file())
    return [path] if path.is_file() and path.suffix.lower() in ENDINGS else []


def _has_key_points(file: Path) -> bool:
    if file.suffix.lower() == ".npz":
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
                return any(ARRAY.fullmatch(name) for name in arrays.files)
        except Exception:
            return False
    try:
        return b"wrist_x" in file.read_bytes() if file.suffix == ".parquet" else b"wrist_x" in _head(file)
    except OSError:
        return False


def _head(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.readline(1 << 16)


def _clips(file: Path, number: int, postures: Postures, options: ImportOptions) -> Iterator[ClipSource]:
    """Yield a moving clip whole, and static postures in parts."""
    for said in postures.key_points:
        _side(said, options)
    thing = None
    if postures.object is not None:
        mesh = find_mesh(postures.object, file.parent, options)
        thing = ObjectSource(postures.object, mesh)
    moving = postures.rate or options.rate
    length = postures.n_frames if moving else POSTURES_PER_CLIP
    # With the file's name, so that two files of one object do not take each other's place.
    name = clip_name(file.stem, "" if postures.name == file.stem else postures.name)
    starts = range(0, postures.n_frames, length)
    for start in starts:
        yield ClipSource(
            name=name if len(starts) == 1 else f"{name}_{start}",
            subject=postures.subject or options.subject or "unknown",
            files=(file,),
            object=thing,
            part={"number": number, "start": start, "stop": min(start + length, postures.n_frames)},
        )


def _side(said: Side | None, options: ImportOptions) -> Side:
    side = said or options.side
    if side is None:
        raise ParameterError("side", None, "right or left; say it with --side")
    return side


def _scale(unit: str | None) -> float:
    scale = 1.0 if unit is None else metres_per(unit)
    if scale is None:
        raise ParameterError("units", unit, ", ".join(METRES_PER))
    return scale
