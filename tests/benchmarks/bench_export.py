"""How fast hands in motion become a LeRobotDataset, and in how much memory."""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import duckdb
import moving_database
from harness import Result, benchmark

import graspdb

SIZES = (200, 2000)
"""Trials of the databases, of 500 frames each."""

RUNS = 3


@dataclass(frozen=True)
class Spent:
    """What the best of some runs took, and the most memory of the process [s, s, MB]."""

    clock: float
    processor: float
    memory: float


@benchmark("export")
def export() -> Sequence[Result]:
    """Export 100,000 and 1,000,000 frames, each in a process of its own."""
    with tempfile.TemporaryDirectory() as name:
        spent = []
        for size in SIZES:
            moving_database.build(Path(name) / f"db{size}", size)
            spent.append(_in_a_process("ours", Path(name) / f"db{size}"))
        peer = _in_a_process("peer", Path(name) / f"db{SIZES[-1]}")
    frames = SIZES[-1] * moving_database.FRAMES_PER_TRIAL
    small, large = spent
    return [
        Result(
            f"export: {frames:,} frames into lerobot Parquet",
            frames / large.clock,
            frames / peer.clock,
            "frames/s",
            better="more",
            note="at least 100,000; peer: DuckDB copies the same columns to Parquet as they are; of the "
            f"processor {large.processor:.2f} and {peer.processor:.2f} s",
        ),
        Result(
            f"export: most memory for {SIZES[-1]:,} trials",
            large.memory,
            small.memory,
            "MB",
            note=f"peer: ours for {SIZES[0]:,}",
        ),
    ]


def _in_a_process(whose: str, path: Path) -> Spent:
    """Measure in a process of its own, so that memory is nobody else's."""
    told = subprocess.run(
        [sys.executable, __file__, whose, str(path)], check=True, capture_output=True, text=True
    ).stdout
    return Spent(**json.loads(told))


def _ours(path: Path, out: Path) -> None:
    with graspdb.open(path) as database:
        database.export("lerobot", out / "lerobot")


def _peer(path: Path, out: Path) -> None:
    columns = "trial, frame, time, q, object_position, object_quaternion, touching"
    with duckdb.connect() as connection:
        connection.execute(
            f"COPY (SELECT {columns} FROM read_parquet('{path}/frames/*.parquet')) TO '{out}/copy.parquet'"
        )


def _measure(work: Callable[[Path, Path], None], path: Path) -> Spent:
    """Return the least times of some runs, and the most memory."""
    runs = []
    for _ in range(RUNS):
        with tempfile.TemporaryDirectory() as out:
            clock, processor = time.perf_counter(), time.process_time()
            work(path, Path(out))
            runs.append((time.perf_counter() - clock, time.process_time() - processor))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    return Spent(min(run[0] for run in runs), min(run[1] for run in runs), memory)


if __name__ == "__main__":
    print(json.dumps(vars(_measure({"ours": _ours, "peer": _peer}[sys.argv[1]], Path(sys.argv[2])))))
