"""Which formats there are, and what one has to do: turn parts of a selection into files."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, ClassVar, Final, Generic, TypeVar

from graspdb.export.options import ExportOptions
from graspdb_schemas.errors import ParameterError, nearest

if TYPE_CHECKING:
    from graspdb.database import Database

Item = TypeVar("Item")
W = TypeVar("W", bound="type[Writer[Any]]")


@dataclass(frozen=True)
class Feature:
    """One thing that an export holds, for the card.

    Attributes
    ----------
    name : str
        What the files call it.
    kind : str
        Type of its numbers, such as ``float32``.
    shape : str
        Such as ``(T, 30)``.
    unit : str
        Unit of its numbers; empty where they have none.
    doc : str
        One line that says what it is.
    """

    name: str
    kind: str
    shape: str
    unit: str
    doc: str


@dataclass(frozen=True, eq=False)
class Part(Generic[Item]):
    """Some items of a selection, which are written together.

    Attributes
    ----------
    index : int
        Number of the part, from 0.
    split : str
        Side of the split that all its items are on; empty without a split.
    first : int
        Number of its first item in the whole selection, from 0.
    items : iterator
        The episodes or grasps, read as they are asked for; once.
    before : sequence of Written
        What came of the parts before.
    """

    index: int
    split: str
    first: int
    items: Iterator[Item]
    before: "Sequence[Written]"


@dataclass(frozen=True)
class Written:
    """What came of a part; plain values, for it is kept as JSON until the export is done.

    Attributes
    ----------
    split : str
        Side of the split.
    counts : mapping of str to int
        What was written, such as ``{"episodes": 12, "frames": 9300}``; added up over the parts.
    left_out : mapping of str to int
        What was not written: reason -> number, added up; the card tells it.
    state : mapping
        Whatever else `Writer.finish` needs.
    """

    split: str
    counts: Mapping[str, int]
    left_out: Mapping[str, int] = field(default_factory=dict)
    state: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Format:
    """What a user has to know of a format.

    Attributes
    ----------
    name : str
        What ``graspdb export`` calls it.
    title : str
        What it is, in half a sentence.
    items : str
        What it is made of: ``episodes`` or ``grasps``.
    options : tuple of str
        Names of those `ExportOptions` that it heeds, beside where, split and seed.
    part : int
        Items of a part.
    library : str
        Module that it needs and that is not always there; empty if none.
    extra : str
        The extra that has this library.
    """

    name: str
    title: str
    items: str
    options: tuple[str, ...] = ()
    part: int = 64
    library: str = ""
    extra: str = "export"


class Writer(ABC, Generic[Item]):
    """Writes one export; made anew for each, also for one that goes on after an interruption.

    A writer keeps nothing in memory between parts: what it must know later stands in `Written`. The files
    of a part that was interrupted are written again, under the same names.

    Parameters
    ----------
    folder : Path
        Where to; it exists.
    options : ExportOptions
        What is asked for; `fps` is set.
    database : Database
        For whatever else a format needs.

    Attributes
    ----------
    format : Format
        Set by `export_format`.
    """

    format: ClassVar[Format]

    def __init__(self, folder: Path, options: ExportOptions, database: "Database") -> None:
        self.folder = folder
        self.options = options
        self.database = database

    def columns(self) -> Sequence[str]:
        """Return the columns of `frames` that episodes are to have; see `reading.FRAME_COLUMNS`."""
        from graspdb.export.reading import FRAME_COLUMNS

        return FRAME_COLUMNS

    @abstractmethod
    def write(self, part: Part[Item]) -> Written:
        """Write the items of a part."""

    def finish(self, written: Sequence[Written]) -> None:
        """Write what needs all parts, once they are written; may be done again after an interruption."""

    @abstractmethod
    def features(self) -> Sequence[Feature]:
        """Return what the files hold, for the card; asked once `finish` is done."""


_WRITERS: Final[dict[str, type[Writer[Any]]]] = {}


def export_format(form: Format) -> Callable[[W], W]:
    """Register the decorated `Writer` as that of a format."""

    def register(writer: W) -> W:
        writer.format = form
        _WRITERS[form.name] = writer
        return writer

    return register


def writers() -> Mapping[str, type[Writer[Any]]]:
    """Return every writer by the name of its format."""
    from graspdb.export import formats

    for module in sorted(module.name for module in iter_modules(formats.__path__)):
        import_module(f"{formats.__name__}.{module}")
    return dict(sorted(_WRITERS.items()))


def writer_of(name: str) -> type[Writer[Any]]:
    """Return the writer of a format.

    Raises
    ------
    ParameterError
        There is no such format.
    """
    found = writers()
    if name not in found:
        names = ["duckdb", *found]
        raise ParameterError("format", name, ", ".join(names) + nearest(name, names))
    return found[name]
