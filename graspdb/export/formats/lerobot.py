"""``lerobot``: LeRobotDataset v3.0 without images, as the package lerobot 0.4 reads and writes it.

A part is one file of frames under data/, with a row group an episode, and one of episodes under
meta/episodes/, which holds each episode's statistics too.
"""

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from graspdb.export.episodes import EPISODE_OPTIONS, EpisodeWriter, Stepped, before
from graspdb.export.items import Episode
from graspdb.export.registry import Feature, Format, Part, Written, export_format
from graspdb.export.statistics import STATISTICS, RunningStatistics, Statistics, episode_statistics
from graspdb.export.steps import ACTION, ENVIRONMENT, ENVIRONMENT_NAMES, KNOWN, STATE, Steps, state_names

VERSION: Final = "v3.0"
FILES_PER_CHUNK: Final = 1000
DATA: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES: Final = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

_INDEX: Final = {
    "timestamp": ("float32", "s", "time since the episode's first frame"),
    "frame_index": ("int64", "", "frame of the episode, from 0"),
    "episode_index": ("int64", "", "episode, from 0"),
    "index": ("int64", "", "frame of the data set, from 0"),
    "task_index": ("int64", "", "row of meta/tasks.parquet"),
}
"""Columns that every LeRobotDataset has."""

Columns = dict[str, NDArray[Any]]


@export_format(
    Format(
        "lerobot",
        "LeRobotDataset v3.0, one episode a hand and trial",
        items="episodes",
        options=EPISODE_OPTIONS,
    )
)
class LeRobotWriter(EpisodeWriter):
    """Writes data and episodes part by part; info, tasks and statistics at the end."""

    def write_steps(self, part: Part[Episode], stepped: list[Stepped]) -> dict[str, Any]:
        """Write the data and episodes files of a part."""
        place = {"chunk_index": part.index // FILES_PER_CHUNK, "file_index": part.index % FILES_PER_CHUNK}
        tasks = _tasks(part.before)
        new = [text for text in dict.fromkeys(episode.task for episode, _ in stepped) if text not in tasks]
        numbers = {text: index for index, text in enumerate([*tasks, *new])}
        first, start = before(part, "episodes"), before(part, "frames")
        rows: list[dict[str, Any]] = []
        statistics: list[Statistics] = []
        path = self.folder / DATA.format(**place)
        path.parent.mkdir(parents=True, exist_ok=True)
        schema = _data_schema(stepped[0][1], self.options.missing)
        # Least and greatest help to find episodes; of vectors they would be no use to anybody.
        found_by = ["episode_index", "index", "task_index"]
        with pq.ParquetWriter(path, schema, use_dictionary=False, write_statistics=found_by) as file:
            for index, (episode, steps) in enumerate(stepped, first):
                columns = self._columns(steps, index, start, numbers[episode.task])
                file.write_table(_table(columns, schema))
                rows.append(_episode_row(episode, steps, index, start, place))
                statistics.append(episode_statistics(columns))
                start += len(steps)
        self._write_episodes(rows, statistics, place)
        return {"tasks": new}

    def _columns(self, steps: Steps, episode: int, start: int, task: int) -> Columns:
        """Return all columns of an episode."""
        n = len(steps)
        frames = np.arange(n)
        return {
            **steps.columns(self.options.missing),
            "timestamp": (frames / (self.options.fps or 1)).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(n, episode),
            "index": start + frames,
            "task_index": np.full(n, task),
        }

    def _write_episodes(
        self, rows: list[dict[str, Any]], statistics: list[Statistics], place: dict[str, int]
    ) -> None:
        """Write the rows of episodes, with statistics in columns ``stats/<feature>/<statistic>``."""
        table = pa.Table.from_pylist(rows)
        for name in statistics[0]:
            for statistic in STATISTICS:
                numbers = np.stack([one[name][statistic] for one in statistics])
                kind = pa.int64() if statistic == "count" else pa.float64()
                column = _lists(numbers).cast(pa.list_(kind))
                table = table.append_column(f"stats/{name}/{statistic}", column)
        path = self.folder / EPISODES.format(**place)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, path)

    def finish(self, written: Sequence[Written]) -> None:
        """Write meta/info.json, meta/tasks.parquet and meta/stats.json."""
        super().finish(written)
        meta = self.folder / "meta"
        tasks = _tasks(written)
        _write_tasks(tasks, meta / "tasks.parquet")
        # As json.dump of lerobot does: lists of numbers, one number in a list of its own for scalar features.
        (meta / "stats.json").write_text(json.dumps(self._statistics(), indent=4), encoding="utf-8")
        info = {
            "codebase_version": VERSION,
            "robot_type": "human_hand",
            "total_episodes": sum(part.counts["episodes"] for part in written),
            "total_frames": sum(part.counts["frames"] for part in written),
            "total_tasks": len(tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self.options.fps,
            "splits": _splits(written),
            "data_path": DATA,
            "video_path": None,
            "features": self._features(),
        }
        (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")

    def _statistics(self) -> dict[str, dict[str, list[float]]]:
        """Return the statistics of all episodes, read back file by file."""
        running: dict[str, RunningStatistics] = {}
        for path in sorted((self.folder / "meta" / "episodes").rglob("*.parquet")):
            table = pq.read_table(path)
            for name in self._features():
                batch = {statistic: _numbers(table[f"stats/{name}/{statistic}"]) for statistic in STATISTICS}
                running.setdefault(name, RunningStatistics()).add(batch)
        return {
            name: {statistic: numbers.tolist() for statistic, numbers in one.values().items()}
            for name, one in running.items()
        }

    def _features(self) -> dict[str, dict[str, Any]]:
        """Return the features as info.json has them."""
        names = list(state_names(self.n_state, self.options.state))
        described = {
            STATE: _described("float32", names),
            ENVIRONMENT: _described("float32", list(ENVIRONMENT_NAMES)),
            ACTION: _described("float32", names),
        }
        if self.options.missing == "mask":
            described |= {name: _described("bool", None) for name in KNOWN}
        return described | {name: _described(kind, None) for name, (kind, *_) in _INDEX.items()}

    def features(self) -> Sequence[Feature]:
        """Return what the data files hold."""
        index = [Feature(name, kind, "(1,)", unit, doc) for name, (kind, unit, doc) in _INDEX.items()]
        return [*super().features(), *index]


def _described(kind: str, names: list[str] | None) -> dict[str, Any]:
    return {"dtype": kind, "shape": [len(names) if names else 1], "names": names}


def _tasks(written: Sequence[Written]) -> list[str]:
    """Return the tasks of some parts, in the order of their numbers."""
    return [text for part in written for text in part.state.get("tasks", ())]


def _write_tasks(tasks: list[str], path: Any) -> None:
    """Write the table of tasks, of which pandas makes the text the index."""
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "__index_level_0__": tasks})
    column = {"field_name": None, "metadata": None, "name": None, "pandas_type": "unicode"}
    pandas = {
        "index_columns": ["__index_level_0__"],
        "column_indexes": [{**column, "numpy_type": "object", "metadata": {"encoding": "UTF-8"}}],
        "columns": [
            {**column, "field_name": "task_index", "name": "task_index", "numpy_type": "int64"}
            | {"pandas_type": "int64"},
            {**column, "field_name": "__index_level_0__", "numpy_type": "object"},
        ],
        "pandas_version": "2.2.0",
    }
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(pandas)}), path)


def _splits(written: Sequence[Written]) -> dict[str, str]:
    """Return the range of episodes on each side of the split; all are to train with where there is none."""
    ranges: dict[str, str] = {}
    first = 0
    for side in dict.fromkeys(part.split for part in written):
        end = first + sum(part.counts["episodes"] for part in written if part.split == side)
        ranges[side or "train"] = f"{first}:{end}"
        first = end
    return ranges


def _data_schema(steps: Steps, missing: str) -> pa.Schema:
    """Return the schema of a data file: vectors as lists of fixed length, scalars as they are."""
    fields = [
        pa.field(name, pa.bool_() if values.ndim == 1 else pa.list_(pa.float32(), values.shape[1]))
        for name, values in steps.columns(missing).items()
    ]
    return pa.schema(
        [*fields, *(pa.field(name, pa.type_for_alias(kind)) for name, (kind, *_) in _INDEX.items())]
    )


def _table(columns: Columns, schema: pa.Schema) -> pa.Table:
    arrays = [pa.array(values) if values.ndim == 1 else _lists(values) for values in columns.values()]
    return pa.Table.from_arrays(arrays, schema=schema)


def _episode_row(
    episode: Episode, steps: Steps, index: int, start: int, place: dict[str, int]
) -> dict[str, Any]:
    """Return the row of an episode, its statistics apart; what graspdb adds has a name of its own."""
    return {
        "episode_index": index,
        "tasks": [episode.task],
        "length": len(steps),
        "dataset_from_index": start,
        "dataset_to_index": start + len(steps),
        **{f"data/{name}": number for name, number in place.items()},
        **{f"meta/episodes/{name}": number for name, number in place.items()},
        "graspdb/trial": episode.trial,
        "graspdb/side": episode.side,
        "graspdb/subject": episode.subject,
        "graspdb/object": episode.object,
        "graspdb/grasps": list(episode.grasps),
        "graspdb/start_time": steps.start,
    }


def _lists(values: NDArray[Any]) -> pa.Array:
    """Return rows of an array as lists of one length."""
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _numbers(column: pa.ChunkedArray) -> NDArray[np.float64]:
    """Return lists of one length as an array of floats."""
    flat = column.combine_chunks().flatten().cast(pa.float64()).to_numpy()
    return np.asarray(flat.reshape(len(column), -1))
