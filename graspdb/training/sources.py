"""Where episodes to train with come from: a state of a database, or an export in the form of LeRobot."""

import json
import os
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as pa_dataset
import pyarrow.parquet as pq
from numpy.typing import NDArray

from graspdb.export.errors import ExportError
from graspdb.export.options import export_options
from graspdb.export.reading import episodes_of
from graspdb.export.run import with_rate
from graspdb.export.selection import select
from graspdb.export.split import TRAIN, VALID
from graspdb.export.steps import ACTION, ENVIRONMENT, KNOWN, STATE, Steps, step_columns, steps_of
from graspdb_queries.engine import Engine
from graspdb_schemas.errors import ParameterError

if TYPE_CHECKING:
    from graspdb.database import Database

EpisodeArrays = Mapping[str, NDArray[Any]]
"""Name of a feature -> its values, a row a step."""

_BLOCK: Final = 16
"""Episodes that are read with one query."""


class EpisodeSource(ABC):
    """Episodes by number. Small when pickled; whoever unpickles it opens files anew."""

    @property
    @abstractmethod
    def n_episodes(self) -> int:
        """Number of episodes, those without steps included."""

    @abstractmethod
    def read(self, episodes: Sequence[int]) -> Iterator[EpisodeArrays | None]:
        """Yield episodes in the order asked for; None for one without two steps in which all is known."""

    @abstractmethod
    def lengths(self) -> NDArray[np.int64]:
        """Return the number of steps of every episode, shape (n_episodes,)."""


class DatabaseSource(EpisodeSource):
    """Episodes of one state of a database, as an export would have them.

    Parameters
    ----------
    database : Database
        Open; its state is what every process reads, whatever is written meanwhile.
    only : {'train', 'valid'} or None
        The side of the split.
    options : mapping
        Fields of `ExportOptions`.
    """

    def __init__(self, database: "Database", only: str | None, options: Mapping[str, Any]) -> None:
        asked = export_options(options)
        if only is not None and asked.split is None:
            raise ParameterError("only", only, "nothing, unless split says what the sides do not share")
        self._tables = database.snapshot.sources
        with Engine(self._tables) as engine:
            selection = select(engine, asked, "episodes")
        self._options = with_rate(asked, selection)
        rows = selection.rows
        self._rows: pa.Table = rows if only is None else rows.filter(pc.equal(rows["split"], only))
        self._lengths: NDArray[np.int64] | None = None

    @property
    def n_episodes(self) -> int:
        """Number of hands of trials that were selected."""
        return int(self._rows.num_rows)

    def read(self, episodes: Sequence[int]) -> Iterator[EpisodeArrays | None]:
        """Yield episodes in the order asked for."""
        for start in range(0, len(episodes), _BLOCK):
            rows = self._rows.take(pa.array(episodes[start : start + _BLOCK], pa.int64()))
            for episode in episodes_of(rows, self._frames(rows)):
                steps = steps_of(episode, self._options)
                yield steps.columns(self._options.missing) if isinstance(steps, Steps) else None

    def _frames(self, rows: pa.Table) -> pa.Table:
        """Return the frames of some rows, read by Arrow.

        Workers of a DataLoader are forks, and an engine of DuckDB does not outlive a fork. The ids of the
        rows are those of committed trials, so nothing else can be among their frames.
        """
        frames = self._tables["frames"]
        found = pa_dataset.dataset([*frames.files, *frames.mixed_files], format="parquet")
        ids = pc.field("ingest_id").isin(rows["ingest_id"].combine_chunks().unique())
        columns = ["trial", "side", "frame", "time", *step_columns(self._options)]
        return found.to_table(columns=columns, filter=ids, use_threads=False).combine_chunks()

    def lengths(self) -> NDArray[np.int64]:
        """Return the number of steps of every episode; all are read once to know it."""
        if self._lengths is None:
            found = self.read(range(self.n_episodes))
            self._lengths = np.array([0 if one is None else len(one[STATE]) for one in found], dtype=np.int64)
        return self._lengths


class ExportSource(EpisodeSource):
    """Episodes of a folder that ``graspdb export lerobot`` wrote.

    Parameters
    ----------
    folder : Path
        The export.
    only : {'train', 'valid'} or None
        The side of the split that it was written with.

    Raises
    ------
    ExportError
        The folder holds no such export, or not that side.
    """

    def __init__(self, folder: Path, only: str | None) -> None:
        self._folder = folder
        try:
            info = json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
            paths = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
            names = ["dataset_from_index", "dataset_to_index", "data/chunk_index", "data/file_index"]
            table = pa.concat_tables([pq.read_table(path, columns=names) for path in paths])
            self._pattern: str = info["data_path"]
            self._names = [name for name in (STATE, ENVIRONMENT, ACTION, *KNOWN) if name in info["features"]]
        except (OSError, ValueError, KeyError) as error:
            raise ExportError(
                folder,
                f"it is no whole LeRobotDataset v3.0: {error}",
                "Write one with graspdb export lerobot.",
            ) from error
        if only is not None and only not in info["splits"]:
            found = ", ".join(info["splits"])
            raise ExportError(folder, f"it has no side {only}, but {found}", "Export it with --split.")
        first, end = map(int, info["splits"][only].split(":")) if only else (0, table.num_rows)
        self._from, self._to, self._chunk, self._file = (table[name].to_numpy() for name in names)
        self._episodes = range(first, end)

    @property
    def n_episodes(self) -> int:
        """Number of episodes of that side."""
        return len(self._episodes)

    def lengths(self) -> NDArray[np.int64]:
        """Return the number of steps of every episode."""
        chosen = slice(self._episodes.start, self._episodes.stop)
        return np.asarray(self._to[chosen] - self._from[chosen])

    def read(self, episodes: Sequence[int]) -> Iterator[EpisodeArrays | None]:
        """Yield episodes in the order asked for."""
        opened: dict[tuple[int, int], pq.ParquetFile] = {}
        for number in episodes:
            episode = self._episodes[number]
            place = (int(self._chunk[episode]), int(self._file[episode]))
            if place not in opened:
                opened = {place: pq.ParquetFile(self._path(place))}
            yield self._cut(opened[place], episode, place)

    def _path(self, place: tuple[int, int]) -> Path:
        return self._folder / self._pattern.format(chunk_index=place[0], file_index=place[1])

    def _cut(self, file: pq.ParquetFile, episode: int, place: tuple[int, int]) -> EpisodeArrays:
        """Return the steps of an episode, from those row groups alone that hold them."""
        in_file = (self._chunk == place[0]) & (self._file == place[1])
        start = int(self._from[episode] - self._from[in_file].min())
        length = int(self._to[episode] - self._from[episode])
        sizes = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
        ends = list(accumulate(sizes))
        first, last = bisect_right(ends, start), bisect_right(ends, start + length - 1)
        groups = file.read_row_groups(list(range(first, last + 1)), columns=self._names, use_threads=False)
        own = groups.slice(start - (ends[first] - sizes[first]), length)
        return {name: _array(own[name]) for name in self._names}


def _array(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return lists of one length, or single values, as an array of a row a step."""
    whole = column.combine_chunks()
    if pa.types.is_fixed_size_list(whole.type):
        flat = whole.flatten().to_numpy()
        return np.asarray(flat.reshape(len(whole), -1))
    return np.asarray(whole.to_numpy(zero_copy_only=False))


def open_source(
    source: "str | os.PathLike[str] | Database", only: str | None, options: Mapping[str, Any]
) -> EpisodeSource:
    """Return the episodes of a database or an export.

    Raises
    ------
    ParameterError
        `only` is no side of a split, or an option is not allowed; an export's options are those it was
        written with.
    """
    from graspdb.database import Database

    if only not in (None, TRAIN, VALID):
        raise ParameterError("only", only, f"{TRAIN} or {VALID}")
    if isinstance(source, Database):
        return DatabaseSource(source, only, options)
    if (Path(source) / "meta" / "info.json").is_file():
        if options:
            raise ParameterError(next(iter(options)), next(iter(options.values())), "nothing, for an export")
        return ExportSource(Path(source), only)
    with Database(source) as database:
        return DatabaseSource(database, only, options)
