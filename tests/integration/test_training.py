"""Windows to train with: the same from a database and from its export, all of them, in every process."""

import multiprocessing
import pickle
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moving_trials import LOST, N_FRAMES, build, frame_rows, moving_trial

import graspdb
from graspdb.export.errors import ExportError
from graspdb.store import Store
from graspdb_schemas.errors import ParameterError, QueryError

HORIZON = 4


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("training") / "db"
    return build(folder)


@pytest.fixture(scope="module")
def exported(path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out: Path = tmp_path_factory.mktemp("export") / "lerobot"
    with graspdb.open(path) as database:
        database.export("lerobot", out, split="subject", missing="mask")
    return out


def same(a: dict[str, Any], b: dict[str, Any]) -> None:
    assert set(a) == set(b)
    for name, values in a.items():
        np.testing.assert_array_equal(values, b[name], err_msg=name)


def places(windows: Iterator[dict[str, Any]]) -> list[tuple[int, int]]:
    return [(window["episode"], window["step"]) for window in windows]


def test_windows_are_those_of_the_frames(path: Path) -> None:
    windows = graspdb.WindowDataset(path, HORIZON, where="trial = 's/ben_jug_4'")
    state = np.array([row["q"] for row in frame_rows("s/ben_jug_4", 4)], dtype=np.float32)
    assert len(windows) == N_FRAMES
    for step in range(N_FRAMES):
        inside = np.minimum(step + np.arange(HORIZON), N_FRAMES - 1)
        window = windows[step]
        np.testing.assert_array_equal(window["observation.state"], state[inside])
        np.testing.assert_array_equal(window["action"], state[np.minimum(inside + 1, N_FRAMES - 1)])
        np.testing.assert_array_equal(window["is_pad"], step + np.arange(HORIZON) >= N_FRAMES)
        assert window["observation.environment_state"].shape == (HORIZON, 27)
        assert (window["episode"], window["step"]) == (0, step)
    same(windows[-1], windows[N_FRAMES - 1])
    with pytest.raises(IndexError):
        windows[N_FRAMES]
    with pytest.raises(IndexError):
        windows[-N_FRAMES - 1]


@pytest.mark.parametrize("only", [None, "train", "valid"])
def test_a_database_and_its_export_have_the_same_windows(
    path: Path, exported: Path, only: str | None
) -> None:
    options = {"split": "subject", "missing": "mask"}
    mine = graspdb.WindowDataset(path, HORIZON, only=only, **options)
    theirs = graspdb.WindowDataset(exported, HORIZON, only=only)
    assert len(mine) == len(theirs) > 0
    for window, other in zip(mine, theirs, strict=True):
        same(window, other)
    streamed = graspdb.WindowStream(exported, HORIZON, only=only)
    for window, other in zip(mine, streamed, strict=True):
        same(window, other)


def test_what_is_not_known_is_left_out_or_marked(path: Path) -> None:
    known = graspdb.WindowDataset(path, where="trial = 's/cal_jug_1'")
    lost = LOST["s/cal_jug_1"]
    assert len(known) == N_FRAMES - lost.stop
    marked = graspdb.WindowDataset(path, where="trial = 's/cal_jug_1'", missing="mask")
    assert len(marked) == N_FRAMES
    unknown = [step for step in range(N_FRAMES) if not marked[step]["object_known"][0]]
    assert unknown == list(range(lost.start, lost.stop))


@pytest.mark.parametrize("shuffle", [None, 7])
def test_workers_share_out_all_windows(
    path: Path, shuffle: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = graspdb.WindowStream(path, HORIZON, shuffle=shuffle)
    alone = places(iter(stream))
    assert len(set(alone)) == len(alone) == len(graspdb.WindowDataset(path))
    shares = []
    for number in range(3):
        info = SimpleNamespace(id=number, num_workers=3)
        monkeypatch.setitem(
            sys.modules, "torch.utils.data", SimpleNamespace(get_worker_info=lambda i=info: i)
        )
        shares.append(places(iter(stream)))
    assert sorted(place for share in shares for place in share) == sorted(alone)
    assert all(shares)


def test_epochs_have_orders_of_their_own(path: Path) -> None:
    stream, again = (graspdb.WindowStream(path, shuffle=7) for _ in range(2))
    first = places(iter(stream))
    assert first == places(iter(again))
    assert first != sorted(first)
    stream.set_epoch(1)
    second = places(iter(stream))
    assert second != first
    assert sorted(second) == sorted(first)


def test_other_processes_read_the_same(path: Path, exported: Path) -> None:
    of_database = graspdb.WindowDataset(path, HORIZON)
    of_export = graspdb.WindowDataset(exported, HORIZON)
    # Opened here first, so that what cannot go to another process would be there to be sent.
    mine = [of_database[5], of_export[5]]
    assert len(pickle.dumps(of_export)) < 20_000
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        theirs = list(pool.map(_sixth, [of_database, of_export]))
    for window, other in zip(mine, theirs, strict=True):
        same(window, other)


def _sixth(windows: graspdb.WindowDataset) -> dict[str, Any]:
    return windows[5]


def test_what_is_written_meanwhile_does_not_count(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_trials([moving_trial(0), moving_trial(1)])
    windows = graspdb.WindowDataset(store.path)
    before = [windows[i]["observation.state"] for i in range(len(windows))]
    store.commit_trials([moving_trial(1, n=20, task="other"), moving_trial(2)], force=True)
    anew = pickle.loads(pickle.dumps(windows))
    assert len(anew) == 2 * N_FRAMES
    for window, state in zip(anew, before, strict=True):
        np.testing.assert_array_equal(window["observation.state"], state)
    assert len(graspdb.WindowDataset(store.path)) == 2 * N_FRAMES + 20


def test_episodes_make_room_for_others(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    windows = graspdb.WindowDataset(path, HORIZON)
    expected = [windows[i] for i in range(len(windows))]
    room = 2 * max(sum(v.nbytes for v in one.values()) for one in windows._kept.values())
    monkeypatch.setattr("graspdb.training.windows.CACHE", room)
    anew = pickle.loads(pickle.dumps(windows))
    for i in np.random.default_rng(0).permutation(len(windows))[:60]:
        same(anew[i], expected[i])
        assert 1 <= len(anew._kept) <= 3
        assert anew._bytes == sum(v.nbytes for one in anew._kept.values() for v in one.values()) <= room


@pytest.mark.parametrize("kind", [graspdb.WindowDataset, graspdb.WindowStream])
def test_what_cannot_be_asked(path: Path, exported: Path, tmp_path: Path, kind: Any) -> None:
    with pytest.raises(ParameterError, match="horizon"):
        kind(path, 0)
    with pytest.raises(ParameterError, match="train or valid"):
        kind(path, only="test", split="subject")
    with pytest.raises(ParameterError, match="unless split"):
        kind(path, only="train")
    with pytest.raises(ParameterError, match="nothing, for an export"):
        kind(exported, fps=30)
    with pytest.raises(ParameterError, match="did you mean 'where'"):
        kind(path, were="true")
    with pytest.raises(QueryError, match="nothing to export"):
        kind(path, where="false")
    with graspdb.open(path) as database:
        database.export("lerobot", tmp_path / "unsplit")
    with pytest.raises(ExportError, match="no side valid, but train"):
        kind(tmp_path / "unsplit", only="valid")
    (tmp_path / "unsplit" / "meta" / "info.json").write_text("{")
    with pytest.raises(ExportError, match="no whole LeRobotDataset"):
        kind(tmp_path / "unsplit")
