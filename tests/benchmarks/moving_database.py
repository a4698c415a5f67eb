"""A database of hands in motion, written as the store writes: trials, grasps and frames of some size."""

from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from deltalake import WriterProperties, write_deltalake
from numpy.typing import NDArray

from graspdb.store import Store
from graspdb_schemas.tables import TABLES

FRAMES_PER_TRIAL: Final = 500
RATE: Final = 100.0
TRIALS_PER_FILE: Final = 100
"""Trials of a file, as compaction leaves them."""

Floats = NDArray[np.float64]


def build(folder: Path, n_trials: int) -> Path:
    """Write a database of so many trials, each with one grasp and one hand, and return its folder."""
    store = Store.create_or_open(folder)
    zstd = WriterProperties(compression="ZSTD", compression_level=3)
    rng = np.random.default_rng(0)
    for first in range(0, n_trials, TRIALS_PER_FILE):
        trials = range(first, min(first + TRIALS_PER_FILE, n_trials))
        for name, rows in _rows(trials, rng).items():
            write_deltalake(str(store.path / name), rows, mode="append", writer_properties=zstd)
    return folder


def _rows(trials: range, rng: np.random.Generator) -> dict[str, pa.Table]:
    """Return the rows of some trials."""
    n = len(trials)
    key = [f"study/trial_{number:06}" for number in trials]
    ids = [f"{2**60 + 4096 * number:016x}-{2654435761 * number % 2**48:012x}" for number in trials]
    described = {
        "session": ["study"] * n,
        "trial": key,
        "subject": [f"s{number % 10}" for number in trials],
        "object": [f"object_{number % 20}" for number in trials],
        "task": ["lift"] * n,
        "ingest_id": ids,
    }
    context = [[f"{2**60:016x}-{0:012x}-{0:032x}"]] * n
    counts = [[("frames", FRAMES_PER_TRIAL), ("grasps", 1)]] * n
    numbers = {
        "rate": [RATE] * n,
        "n_frames": [FRAMES_PER_TRIAL] * n,
        "context": context,
        "table_rows": counts,
    }
    grasps = {
        "grasp": [f"{name}/right/0" for name in key],
        "side": ["right"] * n,
        "snapshot_frame": [250] * n,
    }
    moving = {"grasp_type": ["medium wrap"] * n}
    return {
        "trials": _declared("trials", {**described, **numbers, "status": ["ok"] * n}),
        "grasps": _declared("grasps", {**described, **grasps, **moving}),
        "frames": _frames(key, ids, rng),
    }


def _frames(key: list[str], ids: list[str], rng: np.random.Generator) -> pa.Table:
    """Return frames in which everything moves smoothly."""
    n = len(key) * FRAMES_PER_TRIAL
    time = np.tile(np.arange(FRAMES_PER_TRIAL) / RATE, len(key))
    q = _smooth(rng, len(key), 30)
    q[:, 3:7] = _unit(_smooth(rng, len(key), 4))
    return _declared(
        "frames",
        {
            "trial": pa.array(key).take(pa.array(np.repeat(np.arange(len(key)), FRAMES_PER_TRIAL))),
            "ingest_id": pa.array(ids).take(pa.array(np.repeat(np.arange(len(key)), FRAMES_PER_TRIAL))),
            "side": pa.repeat("right", n),
            "frame": np.tile(np.arange(FRAMES_PER_TRIAL), len(key)),
            "time": time,
            "q": _lists(q),
            "sites": _lists(_smooth(rng, len(key), 60), 3),
            "object_position": _lists(_smooth(rng, len(key), 3)),
            "object_quaternion": _lists(_unit(_smooth(rng, len(key), 4))),
            "gap": _lists(_smooth(rng, len(key), 20)),
            "touching": _lists(_smooth(rng, len(key), 20) > 0),
        },
    )


def _smooth(rng: np.random.Generator, n_trials: int, width: int) -> Floats:
    """Return numbers that swing with time, shape (n_trials * FRAMES_PER_TRIAL, width)."""
    phase, speed = rng.uniform(0, 6, (2, n_trials, 1, width))
    return np.asarray(np.sin(phase + speed * np.arange(FRAMES_PER_TRIAL)[:, None] / RATE).reshape(-1, width))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _lists(values: NDArray[np.generic], inner: int = 0) -> pa.Array:
    """Return rows as lists, or as lists of lists of so many numbers."""
    flat = pa.array(values.ravel())
    if inner:
        flat = pa.FixedSizeListArray.from_arrays(flat, inner)
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1] // (inner or 1))


def _declared(name: str, given: dict[str, object]) -> pa.Table:
    """Return rows of a table; columns that are not given are null."""
    n = len(given["ingest_id"])  # type: ignore[arg-type]
    columns = [
        pa.array(given[field.name]).cast(field.type)
        if field.name in given and not pa.types.is_map(field.type)
        else pa.array(given[field.name], field.type)
        if field.name in given
        else pa.nulls(n, field.type)
        for field in TABLES[name]
    ]
    return pa.Table.from_arrays(columns, schema=TABLES[name])
