"""From rows of a selection to episodes and grasps, with one query a slice."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from graspdb.export.items import Episode, Floats, Grasp
from graspdb.grasp import read_grasps
from graspdb_queries.engine import Engine
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import N_SITES

_SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "q": (),
    "sites": (N_SITES, 3),
    "object_position": (3,),
    "object_quaternion": (4,),
    "touching": (N_SITES,),
}
"""Columns of `frames` that episodes have, with the shape of a value; () for as many numbers as there are."""

FRAME_COLUMNS: Final = tuple(_SHAPES)

_FRAMES: Final = """
    SELECT trial, side, frame, time, {columns}
    FROM frames
    WHERE ingest_id BETWEEN $least AND $greatest AND ingest_id IN (SELECT unnest($ingest_ids))
"""


def episode_frames(engine: Engine, rows: pa.Table, columns: Sequence[str] = FRAME_COLUMNS) -> pa.Table:
    """Return the frames of the trials of some rows of a selection, in any order.

    Parameters
    ----------
    engine : Engine
        Answers from the database.
    rows : pyarrow.Table
        Rows of `Selection.rows`, one a hand of a trial.
    columns : sequence of str
        Those of `FRAME_COLUMNS` that are wanted.
    """
    ids = sorted(set(rows["ingest_id"].to_pylist()))
    statement = _FRAMES.format(columns=", ".join(columns))
    bound = {"least": ids[0], "greatest": ids[-1], "ingest_ids": ids}
    return engine.sql(statement, bound).table.combine_chunks()


def episodes_of(rows: pa.Table, frames: pa.Table) -> Iterator[Episode]:
    """Yield the episodes of some rows of a selection, in their order.

    Parameters
    ----------
    rows : pyarrow.Table
        Rows of `Selection.rows`, one a hand of a trial.
    frames : pyarrow.Table
        What `episode_frames` returns for them; arrays of columns that are not in it are empty.
    """
    places = _places(frames)
    whole = {name: _array(frames, name) for name in ("time", *FRAME_COLUMNS)}
    for row in rows.to_pylist():
        place = places.get((row["trial"], row["side"]), slice(0, 0))
        arrays = {
            name: vectors(_rows(frames[name], place), *_SHAPES[name]) if array is None else array[place]
            for name, array in whole.items()
        }
        yield _episode(row, arrays)


def _array(frames: pa.Table, name: str) -> Floats | None:
    """Return a column as an array, or None where its lists are of several lengths."""
    if name not in frames.column_names:
        return np.empty((frames.num_rows, 0))
    if name == "time":
        return np.asarray(frames[name].to_numpy())
    try:
        return vectors(frames[name], *_SHAPES[name])
    except QueryError:
        return None


def _rows(column: pa.ChunkedArray, place: slice | NDArray[np.int64]) -> pa.ChunkedArray:
    return column[place] if isinstance(place, slice) else column.take(place)


def _places(frames: pa.Table) -> dict[tuple[str, str], slice | NDArray[np.int64]]:
    """Return where the frames of each hand of each trial are, in order of time.

    They mostly stand behind each other, and then are a slice.
    """
    trial = frames["trial"].combine_chunks().dictionary_encode()
    side = frames["side"].combine_chunks().dictionary_encode()
    code = trial.indices.to_numpy() * np.int64(2) + side.indices.to_numpy()
    number = frames["frame"].to_numpy()
    order = np.lexsort((number, code))
    starts = np.flatnonzero(np.diff(code[order], prepend=-1))
    names = zip(trial.take(order[starts]).to_pylist(), side.take(order[starts]).to_pylist(), strict=True)
    runs = np.split(order, starts[1:]) if len(order) else []
    return {name: _as_slice(run) for name, run in zip(names, runs, strict=True)}


def _as_slice(rows: NDArray[np.int64]) -> slice | NDArray[np.int64]:
    """Return rows as a slice where they follow each other."""
    return slice(int(rows[0]), int(rows[-1]) + 1) if (np.diff(rows) == 1).all() else rows


def _episode(row: dict[str, Any], arrays: dict[str, Any]) -> Episode:
    return Episode(
        **{name: row[name] for name in ("trial", "side", "session", "subject", "object", "split")},
        task=task_text(row),
        grasps=tuple(row["grasps"]),
        rate=float("nan") if row["rate"] is None else row["rate"],
        **arrays,
    )


def task_text(row: dict[str, Any]) -> str:
    """Return a task in words, such as ``lift the mug with the right hand, medium wrap``.

    Where there are several grasps, the commonest type is named, of those as common the first.
    """
    types = Counter(name for name in row["grasp_types"] if name)
    kind = f", {types.most_common(1)[0][0]}" if types else ""
    return f"{row['task'] or 'grasp'} the {row['object']} with the {row['side']} hand{kind}"


def vectors(column: pa.ChunkedArray | pa.Array, *shape: int) -> Floats:
    """Return a column of lists as an array, NaN where a list, or a value in it, is null.

    Parameters
    ----------
    column : pyarrow.ChunkedArray or pyarrow.Array
        Lists, or lists of lists, of numbers or truth values.
    *shape : int
        Shape of a value; without it, that of the first value, one axis long.

    Returns
    -------
    ndarray, shape (n, *shape)

    Raises
    ------
    QueryError
        A value has another length.
    """
    whole = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    known = whole.is_valid().to_numpy(zero_copy_only=False)
    values, size = whole.flatten(), int(known.sum())
    if not shape:
        shape = (len(values) // size if size else 0,)
    if len(values) != size * shape[0]:
        raise QueryError(
            f"{len(values)} values in {size} lists, where each is to have {shape[0]}",
            "Hands of different models cannot be in one export; narrow it with --where.",
        )
    if len(shape) > 1:
        numbers = vectors(values, *shape[1:])
    else:
        numbers = values.cast(pa.float64()).to_numpy(zero_copy_only=False)
    if size == len(whole):
        return numbers.reshape(size, *shape)
    array = np.full((len(whole), *shape), np.nan)
    array[known] = numbers.reshape(size, *shape)
    return array


def grasps_of(engine: Engine, rows: pa.Table) -> Iterator[Grasp]:
    """Return the grasps of some rows of a selection, in their order."""
    return read_grasps(engine, rows["grasp"].to_pylist())
