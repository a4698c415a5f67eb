"""From rows of a selection to episodes and grasps, with one query a slice."""

from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pyarrow as pa

from graspdb.export.items import Episode, Floats, Grasp
from graspdb.grasp import read_grasp
from graspdb_queries.engine import Engine
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import N_SITES

_FRAMES: Final = """
    SELECT trial, side, frame, time, q, sites, object_position, object_quaternion, touching
    FROM frames
    WHERE ingest_id BETWEEN $least AND $greatest AND ingest_id IN (SELECT unnest($ingest_ids))
    ORDER BY trial, side, frame
"""


def read_episodes(engine: Engine, rows: pa.Table) -> Iterator[Episode]:
    """Yield the episodes of some rows of a selection, in their order.

    Parameters
    ----------
    engine : Engine
        Answers from the database.
    rows : pyarrow.Table
        Rows of `Selection.rows`, one a hand of a trial.
    """
    ids = sorted(set(rows["ingest_id"].to_pylist()))
    frames = engine.sql(_FRAMES, {"least": ids[0], "greatest": ids[-1], "ingest_ids": ids}).table
    frames = frames.combine_chunks()
    places = _places(frames)
    for row in rows.to_pylist():
        start, end = places.get((row["trial"], row["side"]), (0, 0))
        yield _episode(row, frames.slice(start, end - start))


def _places(frames: pa.Table) -> dict[tuple[str, str], tuple[int, int]]:
    """Return where the frames of each hand of each trial begin and end."""
    trial = frames["trial"].combine_chunks().dictionary_encode()
    side = frames["side"].combine_chunks().dictionary_encode()
    code = trial.indices.to_numpy() * np.int64(2) + side.indices.to_numpy()
    starts = np.flatnonzero(np.diff(code, prepend=-1))
    ends = [*starts[1:].tolist(), len(code)]
    names = zip(trial.take(starts).to_pylist(), side.take(starts).to_pylist(), strict=True)
    return dict(zip(names, zip(starts.tolist(), ends, strict=True), strict=True))


def _episode(row: dict[str, Any], frames: pa.Table) -> Episode:
    return Episode(
        **{name: row[name] for name in ("trial", "side", "session", "subject", "object", "split")},
        task=task_text(row),
        grasps=tuple(row["grasps"]),
        rate=float("nan") if row["rate"] is None else row["rate"],
        time=frames["time"].to_numpy(),
        q=vectors(frames["q"]),
        sites=vectors(frames["sites"], N_SITES, 3),
        object_position=vectors(frames["object_position"], 3),
        object_quaternion=vectors(frames["object_quaternion"], 4),
        touching=vectors(frames["touching"], N_SITES),
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
    array = np.full((len(whole), *shape), np.nan)
    array[known] = numbers.reshape(size, *shape)
    return array


def read_grasps(engine: Engine, rows: pa.Table) -> Iterator[Grasp]:
    """Yield the grasps of some rows of a selection, in their order."""
    for key in rows["grasp"].to_pylist():
        yield read_grasp(engine, key)
