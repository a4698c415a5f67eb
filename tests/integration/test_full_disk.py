"""A disk that is full in the middle of an ingest: a clear error, and a database that is whole."""

import multiprocessing
import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from handmade import rows, session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import DatabaseError

N_TRIALS = 30
CONTEXT = multiprocessing.get_context("spawn")


def big(number: int, n_frames: int) -> TrialTables:
    """Return a trial with many frames of noise, which does not compress."""
    tables = dict(trial_tables(number).tables)
    noise = np.random.default_rng(number).normal(size=(n_frames, 30)).tolist()
    key = tables["trials"]["trial"][0].as_py()
    frames = ({"trial": key, "side": "right", "frame": i, "q": q} for i, q in enumerate(noise))
    tables["frames"] = rows("frames", *frames)
    tables["trials"] = rows("trials", tables["trials"].to_pylist()[0] | {"n_frames": n_frames})
    return TrialTables(tables)


def fill(path: Path, n_frames: int) -> None:
    """Commit trials one by one."""
    store = Store.create_or_open(path)
    store.commit_session(session_tables())
    for number in range(N_TRIALS):
        store.commit_trial(big(number, n_frames))


def fill_limited(path: Path, n_frames: int, largest: int, answer: "multiprocessing.Queue[str]") -> None:
    """Commit trials in a process that may write files of so many bytes at most; answer what went wrong."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    try:
        fill(path, n_frames)
    except graspdb.GraspDBError as error:
        answer.put(str(error))
    except BaseException as error:
        answer.put(f"not one of ours: {error!r}")
    else:
        answer.put("")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path | None]:
    """Mount a disk of 2 MB; None where this may not be done."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode:
        yield None
        return
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def whole_after_all(path: Path, n_frames: int) -> None:
    """Check that what was committed is there, and that the rest follows when there is room."""
    assert graspdb.verify(path).whole
    with graspdb.open(path) as database:
        before = database.info().rows["trials"]
    assert before < N_TRIALS
    store = Store.open(path)
    store.commit_session(session_tables())
    store.commit_trials([big(number, n_frames) for number in range(N_TRIALS)])
    store.optimize()
    assert graspdb.verify(path).whole
    with graspdb.open(path) as database:
        assert database.info().rows["frames"] == N_TRIALS * n_frames


def test_a_disk_that_is_full_and_then_made_larger(small_disk: Path | None, tmp_path: Path) -> None:
    if small_disk is None:
        limited(tmp_path / "db", 400, 50_000)
        return
    path = small_disk / "db"
    with pytest.raises(DatabaseError, match=r"cannot write to .*free space"):
        fill(path, 400)
    with pytest.raises(DatabaseError, match=r"cannot .*(space|again)"):
        fill(path, 400)
    assert graspdb.verify(path).whole
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    whole_after_all(path, 400)


@pytest.mark.parametrize("largest", [9_000, 60_000])
def test_files_that_may_not_grow(tmp_path: Path, largest: int) -> None:
    """The limits fall into different tables: small ones, and frames."""
    limited(tmp_path / "db", 400, largest)


def limited(path: Path, n_frames: int, largest: int) -> None:
    store = Store.create_or_open(path)
    store.commit_session(session_tables())
    store.commit_trial(trial_tables(99, object_=None))
    answer: multiprocessing.Queue[str] = CONTEXT.Queue()
    process = CONTEXT.Process(target=fill_limited, args=(path, n_frames, largest, answer))
    process.start()
    told = answer.get(timeout=120)
    process.join(60)
    assert "cannot write to table" in told
    assert "free space" in told
    graspdb.remove(path, "trial", ["s/anna_None_99"])
    whole_after_all(path, n_frames)
