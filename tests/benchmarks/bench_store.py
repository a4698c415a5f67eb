"""What the store costs when there is much in it."""

import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from harness import Result, benchmark
from many_trials import build

from graspdb.store import Store

FEW, MANY, VERY_MANY = 10, 10_000, 100_000
REPEATS = 15
UNCHANGED, RATE = 100, 120.0


@benchmark("add a trial")
def add_a_trial() -> Result:
    """Time opening a database, looking what it has of a session, and committing one more trial to it."""
    with TemporaryDirectory() as folder:
        paths = {n: Path(str(build(Path(folder) / str(n), n).path)) for n in (FEW, MANY)}
        times: dict[int, list[float]] = {n: [] for n in paths}
        for number in range(REPEATS):
            for n, path in paths.items():
                times[n].append(_add(path, number))
    return Result(
        f"add a trial to {MANY:,}",
        ours=median(times[MANY]),
        peer=median(times[FEW]),
        unit="s",
        note=f"peer: to {FEW}; at most 1.3 times that is allowed",
    )


def _add(path: Path, number: int) -> float:
    from handmade import session_tables, trial_tables

    session, trial = (
        session_tables("study-0000", subjects=["anna"]),
        trial_tables(1_000_000 + number, "study-0000"),
    )
    start = perf_counter()
    store = Store.open(path)
    store.committed_input_keys("study-0000")
    store.calibrated_hands("study-0000")
    store.commit_session(session)
    store.commit_trial(trial)
    return perf_counter() - start


@benchmark("many trials")
def many_trials() -> Result:
    """Time ``graspdb info``, a whole process, on a database of 100,000 trials."""
    with TemporaryDirectory() as folder:
        path = build(Path(folder) / "db", VERY_MANY).path
        times = []
        for _ in range(5):
            start = perf_counter()
            subprocess.run(
                [sys.executable, "-m", "graspdb", "info", "--db", str(path)], check=True, capture_output=True
            )
            times.append(perf_counter() - start)
    return Result(
        f"graspdb info on {VERY_MANY:,} trials",
        ours=median(times),
        peer=2.0,
        unit="s",
        note="against the 2 s that are allowed, after graspdb optimize; a whole process",
    )


@benchmark("unchanged trials")
def unchanged_trials() -> Result:
    """Time ingesting a session again of which nothing has changed, the hashes of its files included."""
    sys.path.append(str(Path(__file__).resolve().parents[1]))
    from tiny_session import write_tiny_session

    with TemporaryDirectory() as folder:
        session = write_tiny_session(Path(folder) / "session", UNCHANGED, rate=RATE)
        runs = [
            float(
                subprocess.run(
                    [sys.executable, "-c", _INGEST, str(session), str(Path(folder) / "db")],
                    check=True,
                    capture_output=True,
                    text=True,
                ).stdout
            )
            for _ in range(1 + 5)
        ]
        megabytes = next(session.glob("trials/*.c3d")).stat().st_size / 1e6
    return Result(
        f"skip {UNCHANGED} unchanged trials, each",
        ours=1e3 * median(runs[1:]) / UNCHANGED,
        peer=1e3 * runs[0] / UNCHANGED,
        unit="ms",
        note=f"peer: ingesting them, half a second of {megabytes:.1f} MB each; after the imports",
    )


_INGEST = """
import sys
from time import perf_counter
from graspdb.ingestion import ingest
start = perf_counter()
ingest(sys.argv[1], sys.argv[2])
print(perf_counter() - start)
"""
