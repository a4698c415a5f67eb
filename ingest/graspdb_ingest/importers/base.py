"""What an importer of a public data set is, and what it hands over: clips of hands and objects.

An importer is one small module with two functions. `find` lists the clips under a folder or in a file,
cheaply: without reading motion. `read` reads one of them, in whatever process it is called. All that is
special to a data set, units, axes, order of key points, names, ends there; from then on all clips go the
same way.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.hand.model import Floats
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import KEY_POINTS, Side


@dataclass(frozen=True)
class Format:
    """What a user has to know of a data set before importing it.

    Attributes
    ----------
    name : str
        What ``graspdb import`` calls it.
    title : str
        The data set, as its authors call it.
    version : str
        Version of the data set whose layout the importer reads.
    licence : str
        Licence of the data, as a note that stays with every row; empty where the user must say it.
    needs : tuple of str
        Files that must be there, relative to the path given, one a line.
    documentation : str
        Address of the public documentation of the layout.
    """

    name: str
    title: str
    version: str
    licence: str
    needs: tuple[str, ...]
    documentation: str


@dataclass(frozen=True)
class ImportOptions:
    """What a user says of a data set that its files do not.

    Attributes
    ----------
    session : str or None
        Identifier of the session that the clips become trials of; the format's name unless given.
    units : str or None
        Unit of lengths (``m``, ``dm``, ``cm``, ``mm``) in files that do not say theirs; by default that of
        the data set.
    order : str or None
        Name of an order of key points, or their names, comma-separated; by default that of the data set.
    side : Side or None
        The hand, where files do not say it.
    subject : str or None
        Whose hand, where files do not say it.
    rate : float or None
        Frames per second, where files do not say it [Hz].
    objects : Path or None
        Folder of the objects' meshes, or one mesh, where they are not in the data set's folder.
    mano : Path or None
        Folder or file of the MANO hand model.
    licence : str or None
        Licence note, where it is not that of the format.
    """

    session: str | None = None
    units: str | None = None
    order: str | None = None
    side: Side | None = None
    subject: str | None = None
    rate: float | None = None
    objects: Path | None = None
    mano: Path | None = None
    licence: str | None = None


@dataclass(frozen=True, eq=False)
class ObjectSource:
    """Where an object's surface comes from.

    Attributes
    ----------
    name : str
        Its name in the session.
    file : Path
        Its mesh or cloud.
    scale : float
        Factor from the file's numbers to metres.
    mirrored : bool
        Whether x must be negated, since the file was written for left-handed axes.
    vertices, faces : ndarray or None
        The surface itself, (v, 3) [m] and (f, 3), where it is not what the file says, such as an
        articulated object in one state; the file then is only where it came from.
    category : str or None
        Kind of object.
    mass : float or None
        Mass [kg].
    """

    name: str
    file: Path
    scale: float = 1.0
    mirrored: bool = False
    vertices: Floats | None = None
    faces: NDArray[np.int64] | None = None
    category: str | None = None
    mass: float | None = None


@dataclass(frozen=True, eq=False)
class ClipSource:
    """A clip that `find` has found and nobody has read yet; small, and fit to be sent to a worker.

    Attributes
    ----------
    name : str
        Name of the trial, unique in the import, without a slash; see `clip_name`.
    subject : str
        Whose hands; all clips of a subject are taken to show the same hands.
    files : tuple of Path
        Every file that decides what `read` returns, but the object's mesh; their content is part of what
        tells whether the trial has changed since the last import.
    object : ObjectSource or None
        The object.
    part : mapping
        Whatever else `read` must know to find the clip in its files: names, numbers, slices.
    """

    name: str
    subject: str
    files: tuple[Path, ...]
    object: ObjectSource | None = None
    part: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ClipHand:
    """One hand in all frames of a clip.

    Attributes
    ----------
    side : Side
        Which hand.
    key_points : ndarray, shape (n_frames, 21, 3)
        Wrist and 20 sites (`KEY_POINTS`) in the clip's frame [m]; NaN where the hand is not known.
    extrapolated : tuple of str
        Names of those key points that the data set does not have and that were estimated from the others.
    dimensions : HandDimensions or None
        Size of the hand, where the data set says it; else it is measured on the key points.

    Raises
    ------
    ParameterError
        If the shape is wrong.
    """

    side: Side
    key_points: Floats
    extrapolated: tuple[str, ...] = ()
    dimensions: HandDimensions | None = None

    def __post_init__(self) -> None:
        if self.key_points.ndim != 3 or self.key_points.shape[1:] != (len(KEY_POINTS), 3):
            raise ParameterError("key_points", self.key_points.shape, f"(n_frames, {len(KEY_POINTS)}, 3)")


@dataclass(frozen=True, eq=False)
class MeasuredContact:
    """Contact that a data set measured, or annotated, on the object's surface.

    Attributes
    ----------
    kind : str
        How: ``thermal``, ``annotated`` ...
    positions : ndarray, shape (n, 3)
        Points of the surface, object frame [m].
    contact : ndarray, shape (n,) or (n_frames, n)
        Contact at each of them, 0 (none) to 1, or whether there is; once for the clip, or in each frame.
    """

    kind: str
    positions: Floats
    contact: Floats | NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Clip:
    """Hands, and the object if there is one, in the frames of one recording, photograph or annotation.

    Attributes
    ----------
    hands : tuple of ClipHand
        One or two hands, all with the same frames.
    rate : float or None
        Frames per second [Hz]; None for static postures: then every frame stands for itself, and is a
        grasp where there is an object.
    poses : ndarray, shape (n_frames, 4, 4), or None
        clip_from_object in every frame, rigid, NaN where the object is not known; None without an object,
        or where the clip's frame is the object's.
    up : tuple of float or None
        Unit vector against gravity in the clip's frame; None where it is not known, and then no lift is
        looked for.
    identifier : str
        What the data set calls this clip.
    task : str or None
        What was to be done.
    measured : MeasuredContact or None
        Contact that the data set has.
    attributes : mapping
        Whatever else is worth keeping; plain values.
    notes : tuple of str
        What a user should know of how the clip was read.

    Raises
    ------
    ParameterError
        If there is no hand, or the numbers of frames differ.
    """

    hands: tuple[ClipHand, ...]
    rate: float | None
    identifier: str
    poses: Floats | None = None
    up: tuple[float, float, float] | None = None
    task: str | None = None
    measured: MeasuredContact | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.hands or len({hand.side for hand in self.hands}) != len(self.hands):
            raise ParameterError("hands", [str(hand.side) for hand in self.hands], "a right, a left, or both")
        counts = [len(hand.key_points) for hand in self.hands]
        counts += [] if self.poses is None else [len(self.poses)]
        if len(set(counts)) != 1:
            raise ParameterError("frames", counts, "the same number for hands and object")
        if self.rate is not None and not self.rate > 0:
            raise ParameterError("rate", self.rate, "frames per second above zero, or none")

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.hands[0].key_points)


Find = Callable[[Path, ImportOptions], Iterator[ClipSource]]
"""Lists the clips of a data set; raises ImportSourceError where the path holds another, or lacks files."""

Read = Callable[[ClipSource, ImportOptions], Clip]
"""Reads one clip; raises a GraspDBError, which rejects that clip alone."""


@dataclass(frozen=True)
class Importer:
    """A format that can be imported.

    Attributes
    ----------
    format : Format
        What it is.
    recognises : callable
        Whether a path looks like this format; quick, reads at most a few file names or headers, never raises.
    find : callable
        Lists its clips.
    read : callable
        Reads one of them.
    """

    format: Format
    recognises: Callable[[Path], bool]
    find: Find
    read: Read


def clip_name(*parts: str) -> str:
    """Return the name of a trial from what tells its clip apart; slashes and spaces become underscores."""
    return "_".join("_".join(part.replace("/", " ").split()) for part in parts if part)
