"""A session by one process, by two, and by a Ray cluster of two nodes: the same rows; and Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh
import yaml

import graspdb
from graspdb.simulate import NoiseParameters, simulate_session
from graspdb.store.content import content_key
from graspdb_schemas.tables import TABLES

N_TRIALS = 4


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a session of short trials with two small objects, of which one can only be rejected."""
    folder = tmp_path_factory.mktemp("engines") / "session"
    noise = NoiseParameters(marker_sd=0.001, skin_sd=0.0, occlusion=0.0, swaps=0.0)
    simulate_session(folder, subjects=1, trials=1, seed=3, noise=noise)
    file = folder / "session.yaml"
    manifest = yaml.safe_load(file.read_text())
    by_object: dict[str, list[dict[str, object]]] = {}
    for trial in manifest["trials"]:
        by_object.setdefault(trial["object"], []).append(trial)
    first, second, *_ = by_object.values()
    manifest["trials"] = [first[0], second[0], first[1], second[1]]
    damaged = folder / str(manifest["trials"][-1]["file"])
    damaged.write_bytes(damaged.read_bytes()[:3000])
    for trial in manifest["trials"]:
        trial |= {"start": 0.8, "end": 1.8}
    for thing in manifest["objects"].values():
        trimesh.creation.box((30, 40, 50)).export(folder / thing["mesh"])
    for subject in manifest["subjects"].values():
        subject.pop("calibration", None)
    file.write_text(yaml.safe_dump(manifest, sort_keys=False))
    return folder


def command(session: Path, db: Path, *arguments: str) -> list[str]:
    program = [sys.executable, "-c", "from graspdb.cli import main; main()"]
    return [*program, "ingest", str(session), "--db", str(db), "--json", *arguments]


@pytest.fixture(scope="module")
def by_one(session: Path) -> Path:
    db = session.parent / "by-one"
    report = graspdb.ingest(session, db, workers=1)
    assert len(report.rejected) == 1
    return db


def contents(db: Path) -> dict[str, str]:
    """Return a hash of each table's rows without the names of their ingests, in the order of their keys."""
    hashes = {}
    with graspdb.open(db) as database:
        for name in TABLES:
            own = [column for column in TABLES[name].names if column not in ("ingest_id", "context")]
            rows = database.sql(f"SELECT {', '.join(own)} FROM {name} ORDER BY ALL").arrow()
            hashes[name] = content_key({name: rows})
    return hashes


def test_two_workers_bring_the_same_rows(session: Path, by_one: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        command(session, tmp_path / "db", "--workers", "2"), capture_output=True, check=False
    )
    assert done.returncode == 1, done.stderr  # a trial is rejected
    (report,) = json.loads(done.stdout)
    assert sorted(trial["outcome"] for trial in report["trials"]) == ["added"] * N_TRIALS
    assert contents(tmp_path / "db") == contents(by_one)


def test_a_ray_cluster_brings_the_same_rows(session: Path, by_one: Path, tmp_path: Path) -> None:
    from ray_cluster import two_nodes

    # Paths of sockets may have 107 characters, which those of pytest's folders leave few of.
    with tempfile.TemporaryDirectory(prefix="ray") as short, two_nodes(Path(short)) as environment:
        done = subprocess.run(
            command(session, tmp_path / "db", "--engine", "ray"),
            env={**os.environ, **environment},
            capture_output=True,
            check=False,
        )
    assert done.returncode == 1, done.stderr
    assert contents(tmp_path / "db") == contents(by_one)


def still_running(group: int) -> list[str]:
    """Return the names of the processes of a group that run on, waiting ten seconds at the most."""
    deadline = time.monotonic() + 10
    while True:
        stats = [
            file.read_text().rpartition(")") for file in Path("/proc").glob("[0-9]*/stat") if file.exists()
        ]
        left = [name for name, _, rest in stats if rest.split()[2] == str(group) and rest.split()[0] != "Z"]
        if not left or time.monotonic() > deadline:
            return left
        time.sleep(0.02)


@pytest.fixture
def interrupted(session: Path, tmp_path: Path) -> Iterator[tuple[Path, "subprocess.Popen[bytes]"]]:
    """Yield the database of an ingest and the ingest, stopped by Ctrl-C when its first trial was there."""
    db = tmp_path / "db"
    ingest = subprocess.Popen(
        command(session, db, "--workers", "2"),
        stderr=subprocess.PIPE,
        process_group=0,
        stdout=subprocess.DEVNULL,
    )
    try:
        while not list(db.glob("trials/*.parquet")) and ingest.poll() is None:
            time.sleep(0.02)
        os.killpg(ingest.pid, signal.SIGINT)  # as a terminal does: to all processes of the group
        yield db, ingest
    finally:
        ingest.kill()
        ingest.communicate()


def test_ctrl_c_stops_cleanly_and_keeps_what_was_committed(
    session: Path, by_one: Path, interrupted: tuple[Path, "subprocess.Popen[bytes]"]
) -> None:
    db, ingest = interrupted
    said = ingest.communicate(timeout=60)[1].decode()
    assert ingest.returncode == 130
    assert "Traceback" not in said
    assert "committed, and safe" in said
    assert not still_running(ingest.pid)
    with graspdb.open(db) as database:
        kept = database.info().rows["trials"]
    assert 0 < kept <= N_TRIALS
    report = graspdb.ingest(session, db, workers=1)
    assert sum(trial.outcome == "unchanged" for trial in report.trials) == kept
    assert contents(db) == contents(by_one)
