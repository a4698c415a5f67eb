"""Ingest of a whole session: how much faster than real time with one worker and with two, and its memory."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import trimesh
import yaml
from harness import Result, benchmark

from graspdb.simulate import simulate_session

RATE: Final = 120.0
N_TRIALS: Final = 60
AREA: Final = 0.1083
"""Surface of the object [m2] that has 20,000 points at the usual spacing."""

_RUN = """
import json, resource, sys, time
import graspdb
from pathlib import Path
first, session, db, workers = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
graspdb.ingest(first, db, workers=workers)
start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
report = graspdb.ingest(session, db, workers=workers)
seconds = time.perf_counter() - start
after = resource.getrusage(resource.RUSAGE_SELF)
assert not report.rejected, report.rejected[0].reasons
own = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
peaks = {}
children = [c for t in Path("/proc/self/task").iterdir() for c in (t / "children").read_text().split()]
for process in ["self", *children]:
    status = Path(f"/proc/{process}/status").read_text()
    peaks[process] = int(status.partition("VmHWM:")[2].split()[0]) / 1024
with graspdb.open(db) as database:
    duration = database.sql("SELECT sum(duration) FROM trials WHERE session = 'long'").rows()[0][0]
    points = database.sql("SELECT max(n_points) FROM objects").rows()[0][0]
found = {"wall": seconds, "cpu": own, "duration": duration, "points": points, "peak": max(peaks.values())}
print(json.dumps(found))
"""


@benchmark("ingest")
def ingest() -> list[Result]:
    """Ingest trials at 120 Hz with objects of 20,000 points, from files to committed rows."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        first, session = _sessions(folder)
        runs = {workers: _run(first, session, folder / f"db{workers}", workers) for workers in (1, 2)}
    one, two = runs[1], runs[2]
    what = f"{one['duration']:.0f} s of recordings at {RATE:g} Hz, {one['points']:,.0f} points"
    return [
        Result(
            "ingest, seconds of recording a second of one core",
            one["duration"] / one["cpu"],
            1.0,
            "s/s",
            better="more",
            note=f"{what}; peer: real time; calibration and object included; at least 20",
        ),
        Result(
            "ingest with two workers",
            two["wall"],
            one["wall"],
            "s",
            note="peer: with one worker; the two workers start meanwhile; at least 1.7 times as fast",
        ),
        Result("ingest, peak memory of a worker", two["peak"], None, "MiB", note="below 700 MB"),
    ]


def _sessions(folder: Path) -> tuple[Path, Path]:
    """Return a session of one trial, which starts everything, and the session to measure."""
    long = folder / "long"
    simulate_session(long, subjects=1, seed=7, rate=RATE)
    file = long / "session.yaml"
    manifest = yaml.safe_load(file.read_text())
    manifest["id"] = "long"
    _grown(long, manifest)
    trials = manifest["trials"]
    chosen = []
    for number in range(N_TRIALS):
        trial = dict(trials[number % len(trials)])
        source = long / trial["file"]
        trial["file"] = str(Path(trial["file"]).with_name(f"{number}-{source.name}"))
        shutil.copyfile(source, long / trial["file"])
        chosen.append(trial)
    manifest["trials"] = chosen
    calibration = [chosen[0]["file"], chosen[1]["file"]]
    for subject in manifest["subjects"].values():
        subject["calibration"] = calibration
    file.write_text(yaml.safe_dump(manifest, sort_keys=False))
    first = folder / "first"
    shutil.copytree(long, first)
    manifest |= {"id": "first", "trials": chosen[:2]}
    (first / "session.yaml").write_text(yaml.safe_dump(manifest, sort_keys=False))
    return first, long


def _grown(session: Path, manifest: dict[str, object]) -> None:
    """Scale every object's mesh to the surface that has 20,000 points."""
    objects = manifest["objects"]
    if not isinstance(objects, dict):
        raise TypeError("no objects")
    for entry in objects.values():
        mesh = trimesh.load_mesh(session / entry["mesh"])
        unit = {"m": 1.0, "mm": 0.001}[entry.get("mesh_units", manifest["units"])]
        mesh.vertices *= (AREA / (mesh.area * unit**2)) ** 0.5
        mesh.export(session / entry["mesh"])


def _run(first: Path, session: Path, db: Path, workers: int) -> dict[str, float]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", _RUN, str(first), str(session), str(db), str(workers)]
    done = subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found
