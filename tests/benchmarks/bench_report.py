"""The report on a long session: how long it takes, and how large it is."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Result, benchmark
from long_session import SESSION, build

import graspdb
from graspdb.report import write_report

N_TRIALS = 200


@benchmark("report")
def report() -> list[Result]:
    """Write the report on a session of 200 trials, 7 s each at 120 frames a second."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        db, page = build(folder, N_TRIALS), folder / "report.html"
        start, processor = time.perf_counter(), time.process_time()
        with graspdb.open(db) as database:
            written = write_report(database, SESSION, page)
        seconds, busy = time.perf_counter() - start, time.process_time() - processor
        size = page.stat().st_size / 1e6
    note = f"bar 60 s; {len(written.grasps)} grasps; of the processor {busy:.1f} s"
    return [
        Result("report on 200 trials", seconds, None, "s", note=note),
        Result("size of that report", size, None, "MB", note="bar 30 MB"),
    ]
