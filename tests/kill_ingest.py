"""Ingests killed at random moments: ``python tests/kill_ingest.py [ROUNDS]``, or ``make kill``.

Each round ingests 20 small trials with 2 workers into a copy of a database, and kills the whole process group
with SIGKILL after a random time. Then the database has to open and to be whole, and a plain second run has to
bring it to the very content of one that was never disturbed. Every fifth round begins without a database, so
that its creation is interrupted, too.

What the trials come to is computed once; from then on the workers hand over these rows, so that a round
spends its time where a kill could do harm: in `graspdb.ingest`, between and within its commits.
"""

import argparse
import multiprocessing
import os
import pickle
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).parent))

from handmade import session_tables, trial_tables
from tiny_session import write_tiny_session

import graspdb
from graspdb import batches, ingestion
from graspdb.engines import Engine, make_engine
from graspdb.preparation import Parts, Processed, prepare_parts, process_prepared
from graspdb.store import Store
from graspdb_ingest.input_key import session_inputs
from graspdb_ingest.parameters import CloudParameters, IngestParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.manifest import Session, SessionTrial

N_TRIALS = 20
WORKERS = 2
PARAMETERS = IngestParameters(cloud=CloudParameters(spacing=0.006))
PERIODS = (0.0, 0.3)
"""Times from one commit to the next [s]: trials come alone, or some together."""

FROM_NOTHING = 5
"""Every so many rounds there is no database before."""

CONTEXT = multiprocessing.get_context("forkserver")
Content = dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Bench:
    """What all rounds share: a session, a database before it, and how it should end."""

    folder: Path
    session: Path
    before: Path
    expected: dict[bool, Content]
    seconds: float


@dataclass(frozen=True)
class Round:
    """What a round found: trials committed before the kill (None without a database), dead rows, faults."""

    committed: int | None
    dead: int
    faults: tuple[str, ...]


def prepare(folder: Path) -> Bench:
    """Write the session, compute its rows once, and ingest it undisturbed."""
    session = write_tiny_session(folder / "session", N_TRIALS)
    _compute(folder, session)
    before = folder / "before"
    store = Store.create_or_open(before)
    store.commit_session(session_tables("earlier"))
    store.commit_trials([trial_tables(number, session="earlier") for number in range(3)])
    expected, seconds = {}, 0.0
    for from_nothing in (False, True):
        db = folder / "undisturbed"
        shutil.rmtree(db, ignore_errors=True)
        if not from_nothing:
            shutil.copytree(before, db)
        start = time.monotonic()
        _run(folder, db)
        seconds = time.monotonic() - start
        expected[from_nothing] = content(db)
    return Bench(folder, session, before, expected, seconds)


def _compute(folder: Path, session: Path) -> None:
    """Write what the trials stand on, and the rows of each, as `graspdb.ingest` would compute them."""
    described = ingestion.parse_manifest(session)
    inputs = session_inputs(described, PARAMETERS)
    with make_engine(workers=1) as engine:
        parts = prepare_parts(engine, described, described.trials, PARAMETERS)
        shared = engine.share((described, PARAMETERS))
        for trial in described.trials:
            stands_on = ingestion._stands_on(described, parts, trial.object or "")
            done = process_prepared(shared, trial, parts.of(described, trial), inputs[trial.name])
            (folder / trial.name).write_bytes(pickle.dumps((stands_on, done)))


def one_round(bench: Bench, number: int, rng: random.Random) -> Round:
    """Ingest, kill, look, ingest again, look again."""
    db = bench.folder / "killed"
    shutil.rmtree(db, ignore_errors=True)
    from_nothing = number % FROM_NOTHING == FROM_NOTHING - 1
    if not from_nothing:
        shutil.copytree(bench.before, db)
    _run(bench.folder, db, PERIODS[number % len(PERIODS)], kill_after=rng.uniform(0, bench.seconds))
    faults: list[str] = []
    committed, dead = None, 0
    try:
        with graspdb.open(db) as database:
            row = database.sql("SELECT count(*) FILTER (session = 'tiny') FROM trials").rows()[0]
            committed = int(row[0])
        found = graspdb.verify(db)
        faults += [f"before: {name}: {p}" for name, table in found.tables.items() for p in table.problems]
        dead = sum(table.dead_rows for table in found.tables.values())
    except DatabaseError as error:
        if not from_nothing:
            faults.append(f"before: {error}")
    _run(bench.folder, db)
    found = graspdb.verify(db)
    faults += [f"after: {name}: {p}" for name, table in found.tables.items() for p in table.problems]
    if content(db) != bench.expected[from_nothing]:
        faults.append("after: the content differs from that of an undisturbed ingest")
    return Round(committed, dead, tuple(faults))


def content(db: Path) -> Content:
    """Return, for each trial, the hashes of its rows in every table and of the rows it stands on.

    That these hashes are those of the rows on disk is what `graspdb.verify` checks.
    """
    with graspdb.open(db) as database:
        rows = database.sql("SELECT trial, table_hashes, context FROM trials").table.to_pylist()
    return {
        row["trial"]: (*sorted(map(str, row["table_hashes"])), *sorted(key[-32:] for key in row["context"]))
        for row in rows
    }


def _run(folder: Path, db: Path, period: float = 0.0, kill_after: float | None = None) -> None:
    """Ingest in a process group of its own; kill all of it after a time, or wait for its end."""
    process = CONTEXT.Process(target=_ingest, args=(str(folder), str(db), period))
    process.start()
    process.join(kill_after)
    if process.is_alive():
        # It may not have become a group of its own yet, or have ended by now.
        with suppress(ProcessLookupError):
            os.killpg(process.pid or 0, signal.SIGKILL)
        process.kill()
        process.join()
    if kill_after is None and process.exitcode:
        raise RuntimeError(f"the ingest ended with status {process.exitcode}")


def _ingest(folder: str, db: str, period: float) -> None:
    """Ingest the session; workers hand over the rows that were computed once."""
    os.setsid()

    stands_on: list[TrialTables] = []

    def handed_over(
        _: Engine, __: Session, todo: Sequence[SessionTrial], *___: object
    ) -> Iterator[list[Processed]]:
        for shared, done in pool.imap(_read, [Path(folder, trial.name) for trial in todo]):
            stands_on[:] = [shared]  # all trials are of one object
            yield [done]

    # The workers are forked before the store starts threads of its own.
    with multiprocessing.get_context("fork").Pool(WORKERS) as pool:
        ingestion.prepare_parts = lambda *_: Parts({}, {})
        ingestion._processed = handed_over
        ingestion._stands_on = lambda *_: stands_on[0]
        batches.PERIOD = period
        ingestion.ingest(Path(folder, "session"), db, workers=WORKERS, parameters=PARAMETERS)


def _read(file: Path) -> tuple[TrialTables, Processed]:
    rows: tuple[TrialTables, Processed] = pickle.loads(file.read_bytes())
    return rows


def main() -> int:
    """Run the rounds, print what they found, and return the exit status."""
    parser = argparse.ArgumentParser(description="Kill ingests at random moments.")
    parser.add_argument("rounds", nargs="?", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    # The server of processes looks for what it is to load here, and nowhere else.
    os.environ["PYTHONPATH"] = str(Path(__file__).parent)
    CONTEXT.set_forkserver_preload(["kill_ingest"])
    rng = random.Random(arguments.seed)
    faults = 0
    committed: Counter[str] = Counter()
    dead = 0
    with tempfile.TemporaryDirectory() as folder:
        bench = prepare(Path(folder))
        print(f"undisturbed: {N_TRIALS} trials in {bench.seconds:.1f} s", flush=True)
        for number in range(arguments.rounds):
            found = one_round(bench, number, rng)
            faults += bool(found.faults)
            dead += found.dead > 0
            committed[_when(found.committed)] += 1
            for fault in found.faults:
                print(f"round {number}: {fault}", flush=True)
            if (number + 1) % 10 == 0:
                print(f"{number + 1} rounds, {faults} with faults; {dict(committed)}", flush=True)
    print(
        f"{arguments.rounds} kills: {arguments.rounds - faults} databases opened, verified, and after a "
        f"second run were equal to an undisturbed one; {dead} had dead rows; killed {dict(committed)}"
    )
    return 1 if faults else 0


def _when(committed: int | None) -> str:
    if committed is None:
        return "before there was a database"
    if committed == 0:
        return "before the first trial"
    return "between trials" if committed < N_TRIALS else "after the last trial"


if __name__ == "__main__":
    raise SystemExit(main())
