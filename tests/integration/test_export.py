"""Exports of moving hands, read back by the formats' own libraries, and what cannot be exported."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import zarr
from moving_trials import LOST, N_FRAMES, RATE, build, moving_trial
from typer.testing import CliRunner

import graspdb
from graspdb.cli import app
from graspdb.export.errors import ExportError
from graspdb.export.formats.lerobot import LeRobotWriter
from graspdb.export.registry import Format, Part, Writer, writers
from graspdb.export.split import VALID, side_of
from graspdb.store import Store
from graspdb_schemas.errors import GraspDBError, MissingLibraryError, ParameterError, QueryError

EPISODE_FORMATS = ("lerobot", "hdf5", "zarr")
N_HANDS = 7


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("moving") / "db"
    return build(folder)


@pytest.fixture(scope="module")
def database(path: Path) -> Iterator[graspdb.Database]:
    with graspdb.open(path) as opened:
        yield opened


def recorded(database: graspdb.Database, trial: str, side: str) -> dict[str, np.ndarray]:
    """Return the frames of a hand as the database has them, NaN where something is not known."""
    rows = database.sql(
        "SELECT q, object_position, object_quaternion, touching FROM frames "
        "WHERE trial = $trial AND side = $side ORDER BY frame",
        trial=trial,
        side=side,
    ).rows()
    widths = (30, 3, 4, 20)
    columns = zip(*rows, strict=True)
    q, position, quaternion, touching = (
        np.array([[np.nan] * width if row is None else row for row in column], dtype=float)
        for column, width in zip(columns, widths, strict=True)
    )
    return {"state": q, "environment": np.hstack([position, quaternion, touching])}


def kept(trial: str) -> slice:
    """Return the frames of a trial that are exported: the longest run in which the object is known."""
    lost = LOST.get(trial)
    if lost is None:
        return slice(0, N_FRAMES)
    return slice(0, lost.start) if lost.stop == N_FRAMES else slice(lost.stop, N_FRAMES)


def expected(database: graspdb.Database, trial: str, side: str) -> dict[str, np.ndarray]:
    """Return what an episode has to hold, in float32."""
    return {
        name: rows[kept(trial)].astype(np.float32) for name, rows in recorded(database, trial, side).items()
    }


def files(folder: Path) -> dict[str, bytes]:
    return {
        file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()
    }


def test_lerobot_holds_what_the_database_holds(database: graspdb.Database, tmp_path: Path) -> None:
    report = database.export("lerobot", tmp_path / "out", split="subject")
    meta = tmp_path / "out" / "meta"
    info = json.loads((meta / "info.json").read_text())
    episodes = pd.concat(map(pd.read_parquet, sorted((meta / "episodes").rglob("*.parquet"))))
    tasks = pd.read_parquet(meta / "tasks.parquet")
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == RATE
    assert report.counts == {"episodes": N_HANDS, "frames": info["total_frames"]}
    assert info["total_episodes"] == len(episodes) == N_HANDS
    assert info["total_tasks"] == len(tasks) == 3
    assert set(tasks.index) == {
        "lift the mug with the right hand, medium wrap",
        "lift the mug with the left hand, medium wrap",
        "lift the jug with the right hand",
    }
    data = {
        place: pq.read_table(
            tmp_path / "out" / info["data_path"].format(chunk_index=place[0], file_index=place[1])
        )
        for place in set(zip(episodes["data/chunk_index"], episodes["data/file_index"], strict=True))
    }
    total = 0
    for row in episodes.to_dict("records"):
        table = data[row["data/chunk_index"], row["data/file_index"]].to_pandas()
        own = table[table["episode_index"] == row["episode_index"]]
        wanted = expected(database, row["graspdb/trial"], row["graspdb/side"])
        state = np.stack(own["observation.state"])
        np.testing.assert_array_equal(state, wanted["state"])
        np.testing.assert_array_equal(np.stack(own["observation.environment_state"]), wanted["environment"])
        np.testing.assert_array_equal(np.stack(own["action"]), np.concatenate([state[1:], state[-1:]]))
        n = len(own)
        assert row["length"] == n == row["dataset_to_index"] - row["dataset_from_index"]
        assert row["dataset_from_index"] == total
        np.testing.assert_array_equal(own["index"], total + np.arange(n))
        np.testing.assert_array_equal(own["frame_index"], np.arange(n))
        np.testing.assert_allclose(own["timestamp"], np.arange(n) / RATE, rtol=1e-6)
        assert set(tasks.index[own["task_index"]]) == set(row["tasks"])
        np.testing.assert_allclose(
            row["stats/observation.state/mean"], wanted["state"].mean(axis=0), atol=1e-6
        )
        total += n
    assert total == info["total_frames"]


def test_lerobot_is_laid_out_as_its_reader_wants(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("lerobot", tmp_path / "out", missing="mask", fps=30)
    meta = tmp_path / "out" / "meta"
    info = json.loads((meta / "info.json").read_text())
    schema = pq.read_schema(next((tmp_path / "out" / "data").rglob("*.parquet")))
    kinds = {name: str(schema.field(name).type) for name in schema.names}
    assert set(kinds) == set(info["features"])
    for name, feature in info["features"].items():
        (width,) = feature["shape"]
        kind = {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]
        # A feature of one number is a column of numbers; all others are lists of a fixed length.
        assert kinds[name] == (kind if width == 1 else f"fixed_size_list<element: {kind}>[{width}]"), name
        assert feature["names"] is None or len(feature["names"]) == width
    statistics = json.loads((meta / "stats.json").read_text())
    assert set(statistics) == set(info["features"])
    for name, one in statistics.items():
        assert set(one) == {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
        assert one["count"] == [info["total_frames"]]
        assert all(len(one[key]) == info["features"][name]["shape"][0] for key in ("min", "q50")), name
    assert info["splits"] == {"train": f"0:{N_HANDS}"}
    assert list(pd.read_parquet(meta / "tasks.parquet").columns) == ["task_index"]


def test_hdf5_is_what_robomimic_reads(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("hdf5", tmp_path / "out", split="random", seed=3)
    with h5py.File(tmp_path / "out" / "demos.hdf5") as file:
        data = file["data"]
        assert sorted(data) == sorted(f"demo_{i}" for i in range(N_HANDS))
        assert data.attrs["total"] == sum(demo.attrs["num_samples"] for demo in data.values())
        assert json.loads(data.attrs["env_args"])["env_name"] == "graspdb"
        for demo in data.values():
            wanted = expected(database, demo.attrs["trial"], demo.attrs["side"])
            np.testing.assert_array_equal(demo["obs/state"], wanted["state"])
            np.testing.assert_array_equal(demo["obs/environment_state"], wanted["environment"])
            np.testing.assert_array_equal(demo["next_obs/state"], demo["actions"])
            np.testing.assert_array_equal(demo["actions"][:-1], wanted["state"][1:])
            assert demo.attrs["num_samples"] == len(demo["actions"])
            assert np.flatnonzero(demo["dones"]).tolist() == [len(demo["actions"]) - 1]
            np.testing.assert_array_equal(demo["rewards"], demo["dones"])
        sides = {side: {name.decode() for name in names} for side, names in file["mask"].items()}
        assert set(sides) == {"train", "valid"}
        assert sides["train"] | sides["valid"] == set(data)
        trials = {side: {data[name].attrs["trial"] for name in names} for side, names in sides.items()}
        assert not trials["train"] & trials["valid"]


def test_zarr_is_a_replay_buffer(database: graspdb.Database, tmp_path: Path) -> None:
    report = database.export("zarr", tmp_path / "out", split="object", seed=3)
    root = zarr.open_group(tmp_path / "out" / "replay_buffer.zarr", mode="r")
    assert root.metadata.zarr_format == 2
    ends = root["meta/episode_ends"][:]
    assert ends.dtype == np.int64
    assert len(ends) == N_HANDS
    for name, array in root["data"].arrays():
        assert array.shape[0] == ends[-1] == report.counts["frames"], name
    keys = database.sql("SELECT DISTINCT trial, side, object FROM grasps ORDER BY trial, side").rows()
    valid = root["meta/episode_valid"][:]
    assert valid.any()
    assert not valid.all()
    held_out = {name for name in ("mug", "jug") if side_of(name, 3) == VALID}
    order = sorted(keys, key=lambda key: (key[2] in held_out, key[0], key[1]))
    starts = [0, *ends[:-1]]
    for (trial, side, thing), start, end, is_valid in zip(order, starts, ends, valid, strict=True):
        wanted = expected(database, trial, side)
        np.testing.assert_array_equal(root["data/state"][start:end], wanted["state"])
        np.testing.assert_array_equal(root["data/environment_state"][start:end], wanted["environment"])
        assert is_valid == (thing in held_out)


def test_frames_at_another_rate_turn_evenly(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("hdf5", tmp_path / "out", fps=64, where="trial = 's/anna_mug_0'")
    with h5py.File(tmp_path / "out" / "demos.hdf5") as file:
        half = 2.0 * np.arange(len(file["data/demo_0/actions"])) / 64 / 2
        np.testing.assert_allclose(file["data/demo_0/obs/state"][:, 3], np.cos(half), atol=1e-4)
        np.testing.assert_allclose(file["data/demo_0/obs/state"][:, 4], np.sin(half), atol=1e-4)


@pytest.mark.parametrize("form", EPISODE_FORMATS)
def test_an_interrupted_export_goes_on_to_the_same_files(
    database: graspdb.Database, tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = writers()[form]
    monkeypatch.setattr(kind, "format", _in_parts_of(kind.format, 2))
    database.export(form, tmp_path / "whole", split="subject")
    write, started = kind.write, []

    def breaks_off(writer: Writer[Any], part: Part[Any]) -> Any:
        started.append(part.index)
        if len(started) == 3:
            write(writer, part)
            raise KeyboardInterrupt
        return write(writer, part)

    monkeypatch.setattr(kind, "write", breaks_off)
    with pytest.raises(KeyboardInterrupt):
        database.export(form, tmp_path / "parts", split="subject")
    assert not (tmp_path / "parts" / "README.md").exists()
    with pytest.raises(ExportError, match="another unfinished export"):
        database.export(form, tmp_path / "parts", split="subject", fps=50)
    database.export(form, tmp_path / "parts", split="subject")
    # The part that was interrupted is written again, those before are not.
    assert started == [0, 1, 2, *range(2, started[-1] + 1)]
    mine, whole = files(tmp_path / "parts"), files(tmp_path / "whole")
    if form == "hdf5":
        # HDF5 notes when things were written; the checksum with it.
        for name in ("demos.hdf5", "SHA256SUMS"):
            mine.pop(name), whole.pop(name)
    assert mine == whole


def _in_parts_of(form: Format, size: int) -> Format:
    return Format(form.name, form.title, form.items, form.options, size, form.library)


def test_a_journal_that_breaks_off_in_a_line_is_read_up_to_there(
    database: graspdb.Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    monkeypatch.setattr(LeRobotWriter, "format", _in_parts_of(LeRobotWriter.format, 2))
    finish = LeRobotWriter.finish
    monkeypatch.setattr(LeRobotWriter, "finish", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        database.export("lerobot", out)
    journal = out / ".graspdb-export" / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:-20])
    monkeypatch.setattr(LeRobotWriter, "finish", finish)
    report = database.export("lerobot", out)
    assert report.counts["episodes"] == N_HANDS
    assert not journal.parent.exists()


@pytest.mark.parametrize("form", EPISODE_FORMATS)
def test_card_and_checksums(database: graspdb.Database, tmp_path: Path, form: str) -> None:
    out = tmp_path / "out"
    report = database.export(form, out, where="subject <> 'dan'", split="subject")
    card = (out / "README.md").read_text()
    assert "`subject <> 'dan'`" in card
    assert "| Hands | 2 | CC BY-NC 4.0 | s | 1 |" in card
    assert "| own recordings |  | none noted | s | 4 |" in card
    assert f"| all | {report.counts['episodes']} | {report.counts['frames']} |" in card
    assert f"graspdb {graspdb.__version__}" in card
    left_out = sum(N_FRAMES - len(range(N_FRAMES)[kept(trial)]) for trial in LOST)
    assert f"- left out: {left_out} steps in which" in card
    for feature in writers()[form].format.options:
        assert f"- {feature}: " in card
    done = subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=out, capture_output=True)
    assert done.returncode == 0, done.stderr
    listed = {line.split(maxsplit=1)[1] for line in (out / "SHA256SUMS").read_text().splitlines()}
    assert listed == set(files(out)) - {"SHA256SUMS"}


def test_licences_are_refused(database: graspdb.Database, tmp_path: Path) -> None:
    report = database.export("lerobot", tmp_path / "out", refuse_licences=["NC"])
    assert report.counts["episodes"] == N_HANDS - 1
    assert "CC BY-NC" not in (tmp_path / "out" / "README.md").read_text()


def test_a_grasp_selects_its_hand_of_its_trial(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("hdf5", tmp_path / "out", where="grasp = 's/anna_mug_0/left/1'")
    with h5py.File(tmp_path / "out" / "demos.hdf5") as file:
        (demo,) = file["data"].values()
        assert (demo.attrs["trial"], demo.attrs["side"]) == ("s/anna_mug_0", "left")
        assert list(demo.attrs["grasps"]) == ["s/anna_mug_0/left/1"]
        np.testing.assert_array_equal(demo["obs/state"], expected(database, "s/anna_mug_0", "left")["state"])


@pytest.mark.parametrize("form", EPISODE_FORMATS)
@pytest.mark.parametrize(
    ("asked", "error", "said"),
    [
        ({"where": "subject = 'nobody'"}, QueryError, "nothing to export: no grasp has subject = 'nobody'"),
        ({"where": "q"}, QueryError, "not BOOLEAN"),
        ({"where": "true) OR (true"}, QueryError, "not one expression"),
        ({"where": "subjekt = 'anna'"}, QueryError, "did you mean"),
        ({"split": "object", "where": "object = 'mug'"}, ParameterError, "'mug' alone"),
        ({"split": "subject", "seed": 1}, ParameterError, "leaves one side empty.*such as seed 0"),
        ({"split": "digit"}, ParameterError, "subject, object, session, random"),
        ({"fps": 0}, ParameterError, "whole number from 1"),
        ({"state": "angles"}, ParameterError, "configuration, sites"),
        ({"missing": "keep"}, ParameterError, "drop, mask"),
        ({"frames": 3}, ParameterError, "fps"),
        ({"refuse_licences": [" "]}, ParameterError, "an empty text"),
    ],
)
def test_what_cannot_be_asked(
    database: graspdb.Database,
    tmp_path: Path,
    form: str,
    asked: dict[str, Any],
    error: type[GraspDBError],
    said: str,
) -> None:
    with pytest.raises(error, match=said):
        database.export(form, tmp_path / "out", **asked)
    assert not list(tmp_path.iterdir())


def test_folders_that_are_taken(database: graspdb.Database, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(ExportError, match="not empty"):
        database.export("lerobot", tmp_path / "full")
    with pytest.raises(ExportError, match="it is a file"):
        database.export("lerobot", tmp_path / "full" / "mine.txt")
    with pytest.raises(ExportError, match="cannot be written"):
        database.export("lerobot", tmp_path / "full" / "mine.txt" / "out")
    assert files(tmp_path) == {"full/mine.txt": b"mine"}
    (tmp_path / "empty").mkdir()
    database.export("lerobot", tmp_path / "empty")
    with pytest.raises(ExportError, match="not empty"):
        database.export("lerobot", tmp_path / "empty")


def test_hands_that_have_no_episode_are_counted(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_trials(
        [moving_trial(0), moving_trial(1, n=1), moving_trial(2, angles=False), moving_trial(3, "ben", n_q=22)]
    )
    with graspdb.open(store.path) as database:
        with pytest.raises(ExportError, match=r"s/ben_mug_3/right has 22 numbers .* before it 30"):
            database.export("lerobot", tmp_path / "mixed")
        report = database.export("lerobot", tmp_path / "right", where="subject = 'anna'")
        assert report.counts["episodes"] == 1
        assert [number for reason, number in report.left_out.items() if "episodes" in reason] == [1, 1]
        for trial, reason in ((1, "one instant"), (2, "without joint angles")):
            with pytest.raises(ExportError, match=f"nothing of what was selected.*1 episodes.*{reason}"):
                database.export("zarr", tmp_path / "none", where=f"trial = 's/anna_mug_{trial}'")
        assert database.export("zarr", tmp_path / "sites", state="sites").counts["episodes"] == 3
        assert database.export("hdf5", tmp_path / "small", where="subject = 'ben'").counts["episodes"] == 1
    assert not (tmp_path / "none").exists()
    assert not (tmp_path / "mixed").exists()


def test_a_library_that_is_missing_is_named(
    database: graspdb.Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("graspdb.export.run.find_spec", lambda _: None)
    with pytest.raises(MissingLibraryError, match=r"h5py.*pip install 'graspdb\[export\]'"):
        database.export("hdf5", tmp_path / "out")
    assert not list(tmp_path.iterdir())


def told(*arguments: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["export", *arguments])
    return done.exit_code, done.stdout, done.stderr


def test_the_command(path: Path, tmp_path: Path) -> None:
    asked = ("lerobot", str(tmp_path / "out"), "--db", str(path), "--split", "subject")
    status, said, _ = told(*asked, "--fps", "50", "--json")
    report = json.loads(said)
    assert status == 0
    assert report["counts"]["episodes"] == N_HANDS
    assert sum(side["frames"] for side in report["splits"].values()) == report["counts"]["frames"]
    status, said, _ = told("zarr", str(tmp_path / "zarr"), "--db", str(path), "--missing", "mask")
    assert status == 0
    assert f"Wrote {tmp_path / 'zarr'}: {N_HANDS} episodes, {N_HANDS * N_FRAMES} frames" in said


def test_the_command_lists_formats_and_refuses_others(path: Path, tmp_path: Path) -> None:
    status, said, _ = told("--list", "--json")
    assert status == 0
    assert {"duckdb", *EPISODE_FORMATS} <= {form["name"] for form in json.loads(said)}
    status, _, said = told("lerobto", str(tmp_path / "out"), "--db", str(path))
    assert status == 2
    assert "did you mean 'lerobot'" in " ".join(said.split())
    status, _, said = told("lerobot", "--db", str(path))
    assert status == 2
