"""Importing key points and motion files: how long a thousand frames take, and the memory of a large set."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from harness import Result, benchmark
from threadpoolctl import threadpool_limits

from graspdb.importing import import_data_set
from graspdb_ingest.importers.base import ImportOptions
from graspdb_schemas.vocabulary import KEY_POINTS, Side

sys.path.append(str(Path(__file__).parents[1]))
from posed_hands import movement

N_FRAMES = 1000
RATE = 60.0
MANY = 100_000
ROOT = Path(__file__).parents[2]

_PEAK = """
import sys
from pathlib import Path
from graspdb.importing import import_data_set
report = import_data_set("keypoints", sys.argv[1], sys.argv[2])
assert all(trial.status == "ok" for trial in report.trials)
# Unlike the figure of getrusage, this one begins anew with each program.
status = Path("/proc/self/status").read_text()
print(int(status.partition("VmHWM:")[2].split()[0]) / 1024)
"""


@benchmark("import")
def import_formats() -> list[Result]:
    """Import 1,000 frames of each format, from finding the files to the commit; processor time."""
    results = []
    points = movement(Side.RIGHT, N_FRAMES)[1]
    with TemporaryDirectory() as folder:  # once before, so that no import of modules is timed
        write(Path(folder) / "hand.npz", points[:10])
        timed("keypoints", Path(folder) / "hand.npz", Path(folder) / "grasps")
    for ending in (".npz", ".csv", ".parquet"):
        with TemporaryDirectory() as folder:
            write(Path(folder) / f"hand{ending}", points)
            seconds = timed("keypoints", Path(folder) / f"hand{ending}", Path(folder) / "grasps")
            note = "one hand, moving, no object"
            results.append(Result(f"keypoints {ending}, 1,000 frames", seconds, None, "s", note=note))
            if ending == ".npz":
                fitted = timed("keypoints", Path(folder) / "hand.npz", Path(folder) / "fitted", fit=True)
                note = "with the calibration, which does not grow with the frames"
                results.append(Result("keypoints .npz --fit, 1,000 frames", fitted, None, "s", note=note))
    return [*results, *real()]


def real() -> list[Result]:
    """Import the data sets that are there, if they are."""
    data = Path(os.environ.get("GRASPDB_TEST_DATA", ROOT.parent / "shared" / "data"))
    found = []
    for form, folder, n_frames, note in (
        ("contactpose", "contactpose-camera", 460, "2 clips, two hands, one object prepared, two grasps"),
        ("manipnet", "manipnet/mug1", 4000, "1 clip, two hands, one object prepared, ten grasps"),
    ):
        if (data / folder).is_dir():
            with TemporaryDirectory() as out:
                seconds = timed(form, data / folder, Path(out) / "grasps") * N_FRAMES / n_frames
            found.append(Result(f"{form}, 1,000 frames", seconds, None, "s", note=note))
    return found


@benchmark("import of 100,000 frames")
def many_frames() -> list[Result]:
    """Import 100,000 static postures, and a fifth of them: processor time, and peak memory."""
    peaks = {}
    points = movement(Side.RIGHT, 500)[1]
    for n in (MANY // 5, MANY):
        with TemporaryDirectory() as folder:
            file = Path(folder) / "hand.npz"
            np.savez(file, right_key_points=np.resize(points, (n, 21, 3)).astype(np.float32))
            start = os.times()
            command = [sys.executable, "-c", _PEAK, str(file), str(Path(folder) / "grasps")]
            done = subprocess.run(command, capture_output=True, check=True, text=True)
            stop = os.times()
            peaks[n] = float(done.stdout)
    seconds = stop.children_user - start.children_user + stop.children_system - start.children_system
    note = "1,000 clips; with the start of Python"
    return [
        Result(f"{MANY:,} frames", seconds, None, "s", note=note),
        Result(f"{MANY:,} frames, peak memory", peaks[MANY], peaks[MANY // 5], "MiB", note="peer: a fifth"),
    ]


def timed(form: str, path: Path, db: Path, fit: bool = False) -> float:
    """Return the processor time of an import in this process [s]."""
    with threadpool_limits(1):
        start = process_time()
        report = import_data_set(form, path, db, options=ImportOptions(), fit=fit)
        stop = process_time()
    if report.rejected:
        raise RuntimeError(report.rejected[0].reasons[0])
    return stop - start


def write(path: Path, points: np.ndarray) -> None:
    """Write key points of a moving right hand."""
    if path.suffix == ".npz":
        np.savez(path, right_key_points=points, rate=RATE)
        return
    names = [f"{name}_{axis}" for name in KEY_POINTS for axis in "xyz"]
    columns = dict(zip(names, points.reshape(len(points), -1).T, strict=True))
    table = pa.table({"time": np.arange(len(points)) / RATE, "side": ["right"] * len(points), **columns})
    if path.suffix == ".csv":
        pyarrow.csv.write_csv(table, path)
    else:
        pyarrow.parquet.write_table(table, path)
