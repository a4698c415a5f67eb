"""Parquet: plain tables, and graspdb's own table of markers."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from graspdb_ingest.readers.plain import find_columns, plain_recording
from graspdb_ingest.readers.registry import reader
from graspdb_ingest.readers.timing import check_frame_numbers, rate_from_times
from graspdb_ingest.readers.trajectories import scale_of, trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.tables import unit_of

_OWN: Final = {"frame", "time", "labels", "positions"}


@reader("Parquet", ".parquet", ".pq")
def read_parquet(path: Path, default_scale: float) -> Recording:
    """Read Parquet: one trial of graspdb's table of markers, or a plain table.

    A plain table's unit is that of its columns' metadata ``unit``, where they have it; graspdb's own
    is in metres.
    """
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(
            path,
            f"it is no whole Parquet file ({str(error).splitlines()[0]})",
            "Write or copy it again.",
        ) from error
    if set(table.column_names) >= _OWN:
        return _own(path, table)
    return _plain(path, table, default_scale)


def _plain(path: Path, table: pa.Table, default_scale: float) -> Recording:
    columns = find_columns(path, table.column_names)
    units = {unit_of(table.schema.field(column)) for column in columns.used}
    if len(units) > 1:
        raise RecordingError(
            path, f"its columns are in several units: {', '.join(sorted(units))}", "Write it in one unit."
        )
    coordinates = np.column_stack([_numbers(path, table, column) for column in columns.used])
    times = _numbers(path, table, columns.time)
    frames = None if columns.frame is None else _numbers(path, table, columns.frame)
    return plain_recording(
        path, columns, times, frames, coordinates, scale_of(path, units.pop(), default_scale)
    )


def _numbers(path: Path, table: pa.Table, column: int) -> NDArray[np.float64]:
    """Return a column of numbers with NaN for null."""
    values = table.column(column)
    if not (pa.types.is_floating(values.type) or pa.types.is_integer(values.type)):
        raise RecordingError(
            path,
            f"column {table.column_names[column]!r} is of type {values.type}, not numbers",
            "Write it as numbers, with null for what is missing.",
        )
    return np.asarray(values.cast(pa.float64()).to_numpy(), dtype=np.float64)


def _own(path: Path, table: pa.Table) -> Recording:
    if "trial" in table.column_names:
        trials = table.column("trial").unique().to_pylist()
        if len(trials) > 1:
            raise RecordingError(
                path, f"it holds {len(trials)} trials", "Write the rows of one trial to a file of its own."
            )
    table = table.sort_by("frame")
    if table.num_rows == 0:
        raise RecordingError(path, "it holds no frames", "Write it again with the rows of one trial.")
    names = table.column("labels")[0].as_py() or []
    written = table.column("labels").combine_chunks()
    each = np.array(pc.list_flatten(written).to_numpy(zero_copy_only=False))
    if len(each) != len(names) * table.num_rows or (each.reshape(-1, len(names)) != names).any():
        raise RecordingError(path, "its rows have different labels", "Write the same labels in every row.")
    raw = _positions(path, table.column("positions").combine_chunks(), len(names))
    check_frame_numbers(path, _numbers(path, table, table.column_names.index("frame")))
    times = _numbers(path, table, table.column_names.index("time"))
    return trajectories(path, names, raw, 1.0, rate_from_times(path, times), float(times[0]))


def _positions(path: Path, rows: Any, n_markers: int) -> NDArray[np.float64]:
    """Return lists of lists as an array, shape (n_frames, n_markers, 3); null is NaN."""
    filled = np.full((len(rows), n_markers, 3), np.nan)
    whole = np.asarray(rows.is_valid())
    points = rows.flatten()
    seen = np.asarray(points.is_valid())
    lengths = np.asarray(rows.drop_null().value_lengths())
    sizes = np.asarray(points.drop_null().value_lengths())
    if (lengths != n_markers).any() or (sizes != 3).any():
        raise RecordingError(
            path, "its positions are not three numbers for each label", "Write one [x, y, z] for each label."
        )
    part = np.full((len(points), 3), np.nan)
    part[seen] = points.drop_null().flatten().cast(pa.float64()).to_numpy(zero_copy_only=False).reshape(-1, 3)
    filled[whole] = part.reshape(-1, n_markers, 3)
    return filled
