"""From a query to an export: select, read part by part, write, add card and checksums."""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pyarrow.compute as pc

from graspdb.export.card import Told, card, left_out, totals
from graspdb.export.checksums import write_checksums
from graspdb.export.errors import ExportError
from graspdb.export.journal import Journal, export_key
from graspdb.export.options import ExportOptions
from graspdb.export.reading import episode_frames, episodes_of, grasps_of
from graspdb.export.registry import Format, Part, Writer, writer_of
from graspdb.export.selection import Selection, Slice, select
from graspdb_queries.engine import Engine
from graspdb_schemas.errors import GraspDBError, MissingLibraryError, ParameterError

if TYPE_CHECKING:
    from graspdb.database import Database

Progress = Callable[[int, int], None]
"""Told how many items are done, and how many there are."""

_EVERYWHERE: Final = ("where", "split", "seed")
"""Options that every format heeds."""

DEFAULT_FPS: Final = 30
"""Frames a second where no trial says its rate."""


@dataclass(frozen=True)
class ExportReport:
    """What became of an export.

    Attributes
    ----------
    format : str
        Its format.
    path : Path
        Where it is.
    counts : mapping of str to int
        What was written, such as episodes and frames.
    splits : mapping of str to mapping of str to int
        The same for each side of the split.
    left_out : mapping of str to int
        What was not: reason -> number.
    """

    format: str
    path: Path
    counts: dict[str, int] = field(default_factory=dict)
    splits: dict[str, dict[str, int]] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)


def run_export(
    database: "Database",
    engine: Engine,
    form: str,
    folder: Path,
    options: ExportOptions,
    refused: Sequence[str] = (),
    progress: Progress | None = None,
) -> ExportReport:
    """Write an export, or go on with one that was interrupted.

    Parameters
    ----------
    database : Database
        The database, for its name and version, and for whatever else a format needs.
    engine : Engine
        Answers from those rows of it that may be exported.
    form : str
        Name of the format.
    folder : Path
        Where to; empty or not there yet, or with the same export unfinished.
    options : ExportOptions
        What is asked for.
    refused : sequence of str
        Licences that `engine` leaves out, for the card.
    progress : callable, optional
        Told after each part.

    Raises
    ------
    ParameterError
        There is no such format, it does not heed an option, or a side of the split would be empty.
    QueryError
        The filter cannot be used, or selects nothing.
    ExportError
        The folder is not empty, cannot be written, or nothing can be exported of what was selected.
    MissingLibraryError
        The format's library is not installed.
    """
    kind = writer_of(form)
    _check(kind.format, options)
    selection = select(engine, options, kind.format.items)
    if "fps" in kind.format.options:
        options = with_rate(options, selection)
    import graspdb

    version = graspdb.__version__
    asked = {**options.given(), "refused": list(refused)}
    try:
        journal = Journal(folder, export_key(form, asked, version, selection.rows))
    except OSError as error:
        raise ExportError(folder, f"cannot be written: {error.strerror}", "Name another folder.") from error
    try:
        writer = kind(folder, options, database)
        _write(writer, engine, selection, journal, progress)
        features = writer.features()
    except GraspDBError:
        journal.discard()
        raise
    name = f"the database {Path(str(database.path)).resolve().name}, version {_version_of(database)}"
    told = Told(kind.format, options, selection.rows, journal.written, features, version, name, refused)
    (folder / "README.md").write_text(card(told), encoding="utf-8")
    write_checksums(folder)
    journal.close()
    sides = [part.split for part in journal.written if part.split]
    return ExportReport(
        form,
        folder,
        totals(journal.written),
        {side: totals(journal.written, side) for side in dict.fromkeys(sides)},
        left_out(journal.written),
    )


def _check(form: Format, options: ExportOptions) -> None:
    """Raise unless the format heeds every option that was given, and its library is there."""
    for name, value in options.given().items():
        if name not in (*_EVERYWHERE, *form.options):
            raise ParameterError(name, value, f"nothing, for format {form.name} does not heed it")
    if form.library and find_spec(form.library) is None:
        raise MissingLibraryError(
            form.library, "it is not installed", f"Install it: pip install 'graspdb[{form.extra}]'"
        )


def _write(
    writer: Writer[Any], engine: Engine, selection: Selection, journal: Journal, progress: Progress | None
) -> None:
    """Write the parts that are not done yet, and what needs all of them."""
    slices = list(selection.slices(writer.format.part))
    total = selection.rows.num_rows
    todo = range(len(journal.written), len(slices))
    # Closed here, so that nothing is being read any more when the engine is closed.
    with closing(_items(writer, engine, [slices[i] for i in todo])) as parts:
        for index, items in zip(todo, parts, strict=True):
            piece = slices[index]
            journal.add(writer.write(Part(index, piece.split, piece.first, items, tuple(journal.written))))
            if progress is not None:
                progress(piece.first + piece.rows.num_rows, total)
    _refuse_nothing(journal)
    writer.finish(journal.written)


def _items(
    writer: Writer[Any], engine: Engine, slices: Sequence[Slice]
) -> Generator[Iterator[Any], None, None]:
    """Yield the items of each slice; the frames of the next are read while those of one are written."""
    if writer.format.items == "grasps":
        yield from (grasps_of(engine, piece.rows) for piece in slices)
        return
    columns = writer.columns()
    with ThreadPoolExecutor(1) as reader:
        ahead = [reader.submit(episode_frames, engine, piece.rows, columns) for piece in slices[:1]]
        for index, piece in enumerate(slices):
            frames = ahead.pop().result()
            ahead += [
                reader.submit(episode_frames, engine, coming.rows, columns)
                for coming in slices[index + 1 : index + 2]
            ]
            yield episodes_of(piece.rows, frames)


def _refuse_nothing(journal: Journal) -> None:
    """Raise unless something was written, on every side of the split."""
    for side in dict.fromkeys(part.split for part in journal.written):
        if not any(totals(journal.written, side).values()):
            reasons = "; ".join(f"{n:,} {reason}" for reason, n in left_out(journal.written).items())
            on = f" on the side {side} of the split" if side else ""
            raise ExportError(
                journal.folder,
                f"nothing of what was selected can be exported{on}; left out: {reasons}",
                "Select other grasps with --where, or see graspdb export --help for what may be kept.",
            )


def with_rate(options: ExportOptions, selection: Selection) -> ExportOptions:
    """Return options with a rate: that asked for, or the lowest of what was selected, as a whole number."""
    if options.fps is not None:
        return options
    lowest = pc.min(selection.rows["rate"]).as_py()
    return replace(options, fps=DEFAULT_FPS if lowest is None else max(1, round(lowest)))


def _version_of(database: "Database") -> int:
    """Return the version of the table whose commits make trials visible."""
    return database.snapshot.versions["trials"]
