"""Data sets into a database: the same rows as for own grasps, resumed, in parallel, and what is bad named."""

import gc
import json
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
import trimesh
from posed_hands import movement, postures
from typer.testing import CliRunner

import graspdb
from graspdb.cli import app
from graspdb.importing import CLIPS_PER_COMMIT, import_data_set
from graspdb.store import Outcome
from graspdb_ingest.importers.base import ImportOptions
from graspdb_ingest.importers.keypoints import POSTURES_PER_CLIP
from graspdb_ingest.importers.registry import IMPORTERS
from graspdb_ingest.keypoints import KeyPointGrasp, dimensions_of, static_grasp
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import prepare_object
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import ImportSourceError, ParameterError
from graspdb_schemas.manifest import SessionObject
from graspdb_schemas.tables import TABLES
from graspdb_schemas.vocabulary import SITES, Side

BOX = (0.05, 0.05, 0.12)
OPTIONS = ImportOptions(side=Side.RIGHT, subject="ada")
MIDDLE_TIP = 1 + SITES.index("middle_tip")


def box(folder: Path, name: str) -> Path:
    path = folder / f"{name}.stl"
    trimesh.creation.box(BOX).export(path)
    return path


def grasping(n: int, seed: int) -> np.ndarray:
    """Return key points of n right hands whose middle tips press on the side of the box."""
    points = postures(Side.RIGHT, n, seed)
    aim = np.column_stack([np.full(n, BOX[0] / 2 + 0.004), np.zeros(n), np.linspace(-0.04, 0.04, n)])
    return points + (aim - points[:, MIDDLE_TIP])[:, None]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a folder of static grasps of two boxes, and of postures without an object."""
    folder: Path = tmp_path_factory.mktemp("data")
    for number, name in enumerate(("box", "brick")):
        box(folder, name)
        np.savez(folder / f"{name}.npz", **{f"{name}.key_points": grasping(3, number)})
    np.savez(folder / "postures.npz", key_points=postures(Side.RIGHT, 5, 7))
    return folder


@pytest.fixture(scope="module")
def path(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("db") / "grasps"
    report = import_data_set("keypoints", data, folder, options=OPTIONS)
    assert [trial.status for trial in report.trials] == ["ok"] * 3
    return folder


def rows(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Return all rows of a database, without what the store adds, in an order of their own."""
    found = {}
    with graspdb.open(path) as database:
        for name in TABLES:
            table = database.table(name)
            kept = [c for c in table.column_names if c not in ("ingest_id", "context")]
            found[name] = sorted(table.select(kept).to_pylist(), key=repr)
    return found


def test_a_static_grasp_has_the_rows_of_any_other(data: Path, path: Path) -> None:
    parameters = IngestParameters()
    prepared = prepare_object(SessionObject("box", data / "box.stl", 1.0, {}), parameters)
    points = grasping(3, 0)
    size = dimensions_of(np.concatenate([grasping(3, 0), grasping(3, 1), postures(Side.RIGHT, 5, 7)]))
    with graspdb.open(path) as database:
        for i, hand in enumerate(points):
            described = KeyPointGrasp("keypoints", f"g{i}", "ada", Side.RIGHT, hand, size)
            expected, posed = static_grasp(described, prepared, parameters)
            key = f"keypoints/box/right/{i}"
            found = database.grasp(key)
            assert found.contact_sites == expected.contacts.site_names
            assert "middle_tip" in found.contact_sites
            np.testing.assert_allclose(found.sites, hand[1:], atol=1e-9)
            row = database.sql(
                "SELECT gap, hull_volume, feature_points, snapshot_kind FROM grasps WHERE grasp = $key",
                key=key,
            ).rows()[0]
            np.testing.assert_allclose(row[0], posed.gaps.gap, atol=1e-9)
            assert row[1] == pytest.approx(expected.space.volume)
            assert row[2:] == (len(expected.feature.points), "static")


def test_provenance_stands_with_every_trial(path: Path) -> None:
    with graspdb.open(path) as database:
        found = database.sql(
            "SELECT DISTINCT data_set, data_set_version, licence, source_sha256 IS NULL FROM trials"
        ).rows()
        identifiers = database.sql("SELECT original_id FROM trials ORDER BY trial").rows()
    assert found == [("keypoints", "1", "not stated", False)]
    assert identifiers[0] == ("box.npz:box[0:3]",)


def test_postures_without_an_object_are_frames_alone(path: Path) -> None:
    with graspdb.open(path) as database:
        found = database.sql(
            "SELECT count(sites), count(gap), count(object_position) FROM frames WHERE trial = $t",
            t="keypoints/postures",
        ).rows()
        assert found == [(5, 0, 0)]
        assert database.sql("SELECT count(*) FROM grasps WHERE object IS NULL").rows() == [(0,)]


def test_two_workers_bring_the_same_rows(data: Path, path: Path, tmp_path: Path) -> None:
    import_data_set("keypoints", data, tmp_path / "grasps", options=OPTIONS, workers=2)
    assert rows(tmp_path / "grasps") == rows(path)


def test_only_what_has_changed_is_imported_again(data: Path, tmp_path: Path) -> None:
    folder, db = tmp_path / "data", tmp_path / "grasps"
    folder.mkdir()
    for file in ("box.npz", "box.stl", "postures.npz"):
        (folder / file).write_bytes((data / file).read_bytes())

    def outcomes(**how: Any) -> dict[str, Outcome]:
        report = import_data_set("keypoints", folder, db, options=OPTIONS, **how)
        return {trial.trial.partition("/")[2]: trial.outcome for trial in report.trials}

    assert set(outcomes().values()) == {Outcome.ADDED}
    with graspdb.open(db) as database:
        before = database.info().versions
    assert set(outcomes().values()) == {Outcome.UNCHANGED}
    with graspdb.open(db) as database:
        assert database.info().versions == before
    np.savez(folder / "postures.npz", key_points=postures(Side.RIGHT, 4, 8))
    assert outcomes() == {"box": Outcome.UNCHANGED, "postures": Outcome.REPLACED}
    trimesh.creation.box((0.05, 0.05, 0.13)).export(folder / "box.stl")
    assert outcomes() == {"box": Outcome.REPLACED, "postures": Outcome.UNCHANGED}
    assert set(outcomes(force=True).values()) == {Outcome.REPLACED}


def test_what_an_interrupted_import_has_done_stays(tmp_path: Path) -> None:
    class StoppedError(Exception):
        pass

    def stop(_report: object, _total: int) -> None:
        raise StoppedError

    several = np.resize(postures(Side.RIGHT, 5), (40 * POSTURES_PER_CLIP, 21, 3))
    np.savez(tmp_path / "hand.npz", key_points=several)
    db = tmp_path / "grasps"
    with pytest.raises(StoppedError):
        import_data_set("keypoints", tmp_path / "hand.npz", db, options=OPTIONS, progress=stop)
    report = import_data_set("keypoints", tmp_path / "hand.npz", db, options=OPTIONS)
    outcomes = [trial.outcome for trial in report.trials]
    assert outcomes.count(Outcome.UNCHANGED) == CLIPS_PER_COMMIT
    assert outcomes.count(Outcome.ADDED) == 40 - CLIPS_PER_COMMIT
    with graspdb.open(db) as database:
        assert database.sql("SELECT count(*) FROM frames").rows() == [(len(several),)]


def test_a_bad_clip_is_rejected_alone(data: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "postures.npz").write_bytes((data / "postures.npz").read_bytes())
    np.savez(folder / "left.npz", key_points=postures(Side.LEFT, 5))
    np.savez(folder / "inches.npz", key_points=postures(Side.RIGHT, 5) / 0.0254)
    np.savez(folder / "box.npz", **{"box.key_points": grasping(2, 0)})
    (folder / "box.stl").write_bytes(b"solid nothing")
    arguments = ["import", "keypoints", str(folder), "--side", "right", "--db", str(tmp_path / "grasps")]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 1
    assert "4 trials (4 added), 0 new grasps" in done.stdout
    assert "rejected keypoints/left: " in done.stdout
    assert "declared to be of the right hand are those of a left one" in done.stdout
    assert "would be 7." in done.stdout
    assert "rejected keypoints/box: object box: " in done.stdout
    assert "Traceback" not in done.output
    with graspdb.open(tmp_path / "grasps") as database:
        assert database.sql("SELECT trial FROM trials WHERE status = 'ok'").rows() == [
            ("keypoints/postures",)
        ]
        assert database.sql("SELECT count(*) FROM frames").rows() == [(5,)]


def test_another_data_set_is_recognised(data: Path) -> None:
    with pytest.raises(ImportSourceError) as caught:
        import_data_set("contactpose", data, data / "nowhere")
    message = str(caught.value)
    assert "annotations.json" in message
    assert message.endswith(f"This looks like keypoints: graspdb import keypoints {data}")
    assert not (data / "nowhere").exists()
    with pytest.raises(ParameterError, match="did you mean 'contactpose'"):
        import_data_set("contactpos", data, data / "nowhere")


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--units", "inch", "allowed: mm, cm, dm, m"),
        ("--order", "man0", "mano"),
        ("--rate", "0", "above zero"),
        ("--session", "a/b", "without slash"),
        ("--objects", "/nowhere", "exists"),
        ("--side", "both", "right or left"),
    ],
)
def test_options_are_checked_before_anything_is_written(
    data: Path, tmp_path: Path, option: str, value: str, said: str
) -> None:
    arguments = ["import", "keypoints", str(data), "--db", str(tmp_path / "grasps"), option, value]
    with pytest.raises(ParameterError, match=said):
        CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert not (tmp_path / "grasps").exists()


def reaching(n: int = 240, rate: float = 60.0) -> dict[str, Any]:
    """Return a hand that comes to a box at rest, holds it, lifts it and puts it down, by its parts."""
    hand = grasping(1, 0)[0]
    time = np.arange(n) / rate
    away = np.interp(time, [0, 1.0, 3.2, 4.0], [0.3, 0.0, 0.0, 0.3])
    raised = np.interp(time, [0, 1.6, 2.0, 2.4, 2.8], [0, 0, 0.1, 0.1, 0])
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 2, 3] = raised
    points = hand + np.column_stack([away, np.zeros(n), raised])[:, None]
    return {"box.key_points": points, "poses": poses, "rate": rate, "up": [0, 0, 2.0]}


@pytest.fixture(scope="module")
def lifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("lift")
    box(folder, "box")
    moving = reaching()
    moving["box.key_points"][30:36] = np.nan
    np.savez(folder / "lift.npz", **moving)
    import_data_set("keypoints", folder, folder / "grasps", options=OPTIONS)
    return folder / "grasps"


def touching() -> np.ndarray:
    """Return in which frames any sphere is nearer than 4 mm to the box, by the box's own formula."""
    moving = reaching()
    points, poses = moving["box.key_points"], moving["poses"]
    radii = dimensions_of(points[:1]).radii
    outside = np.abs(points[:, 1:] - poses[:, None, :3, 3]) - np.array(BOX) / 2
    distance = np.linalg.norm(np.maximum(outside, 0), axis=2) + np.minimum(outside.max(axis=2), 0)
    return np.asarray((distance - radii < 0.004).any(axis=1))


def test_a_moving_clip_has_events_holds_and_a_lift(lifted: Path) -> None:
    contact = np.flatnonzero(touching()) / 60.0
    with graspdb.open(lifted) as database:
        grasps = database.sql("SELECT snapshot_kind, onset_time, lift_time, release_time FROM grasps").rows()
        assert len(grasps) == 1
        kind, onset, lift, release = grasps[0]
        assert kind == "lift_onset"
        assert onset == pytest.approx(contact[0], abs=0.02)
        assert lift == pytest.approx(1.6, abs=0.1)
        assert release == pytest.approx(contact[-1], abs=0.02)
        first, last = database.sql("SELECT min(onset_time), max(release_time) FROM contact_events").rows()[0]
        assert first == onset
        assert last == pytest.approx(release, abs=0.05)  # a site lets go some millimetres above h
        assert database.sql("SELECT count(*) FROM contact_events WHERE grasp IS NULL").rows() == [(0,)]
        flags = database.sql("SELECT frame FROM frames WHERE flags = ['not_tracked'] ORDER BY frame").rows()
        assert [frame for (frame,) in flags] == list(range(30, 36))


def test_fitted_joint_angles_are_those_of_the_hand(tmp_path: Path) -> None:
    configurations, points = movement(Side.RIGHT, 200)
    noisy = points + np.random.default_rng(0).normal(0, 5e-4, points.shape)
    np.savez(tmp_path / "hand.npz", key_points=noisy, side="right", rate=60.0)
    import_data_set("keypoints", tmp_path, tmp_path / "grasps", fit=True)
    with graspdb.open(tmp_path / "grasps") as database:
        table = database.sql("SELECT q, sites, residual FROM frames ORDER BY frame").arrow()
        labels = database.sql("SELECT labels FROM markers LIMIT 1").rows()[0][0]
        mjcf = database.sql("SELECT mjcf FROM hands").rows()[0][0]
    q, sites = np.array(table["q"].to_pylist()), np.array(table["sites"].to_pylist())
    # No key point tells the wrist's angles from the forearm's pose.
    angles = np.rad2deg(np.abs(q[:, 9:] - configurations[:, 9:]))
    assert np.median(angles) < 2.0
    assert np.quantile(angles, 0.95) < 6.0
    assert np.sqrt(np.mean(np.sum((sites - points[:, 1:]) ** 2, axis=2))) < 1e-3
    assert max(table["residual"].to_pylist()) < 3e-3
    assert labels[0] == "wrist"
    assert "<mujoco" in mjcf


def test_static_postures_and_few_of_them_are_fitted_too(tmp_path: Path) -> None:
    points = postures(Side.LEFT, 3)
    np.savez(tmp_path / "hand.npz", key_points=points, side="left")
    import_data_set("keypoints", tmp_path, tmp_path / "grasps", fit=True)
    with graspdb.open(tmp_path / "grasps") as database:
        residuals = database.sql("SELECT residual, q FROM frames").rows()
        notes = database.sql("SELECT calibration_notes FROM hands").rows()[0][0]
    assert all(residual < 3e-3 and len(q) == 30 for residual, q in residuals)
    assert "too few to calibrate on" in notes[0]


def test_clips_do_not_pile_up_in_memory(tmp_path: Path) -> None:
    np.savez(tmp_path / "hand.npz", key_points=np.resize(postures(Side.RIGHT, 5), (8000, 21, 3)))
    alive = []

    def count(_report: object, _total: int) -> None:
        if len(alive) % 10 == 0:
            gc.collect()
            alive.append(sum(isinstance(thing, TrialTables) for thing in gc.get_objects()))
        else:
            alive.append(0)

    report = import_data_set("keypoints", tmp_path, tmp_path / "grasps", options=OPTIONS, progress=count)
    assert len(report.trials) == 80
    assert 0 < max(alive) <= 3 * (CLIPS_PER_COMMIT + 1)


def test_an_export_carries_licences_and_can_refuse_rows(data: Path, tmp_path: Path) -> None:
    db = tmp_path / "grasps"
    for name, licence in (("box", "CC BY-NC 4.0"), ("brick", "MIT license")):
        options = ImportOptions(side=Side.RIGHT, session=name, licence=licence, objects=data)
        import_data_set("keypoints", data / f"{name}.npz", db, options=options)
    refuse = ["export", "duckdb", str(tmp_path / "open.duckdb"), "--db", str(db), "--refuse-licence", "nc"]
    assert CliRunner().invoke(app, refuse, catch_exceptions=False).exit_code == 0
    with graspdb.open(db) as database:
        database.export("duckdb", tmp_path / "all.duckdb")
        with pytest.raises(ParameterError, match="empty"):
            database.export("duckdb", tmp_path / "none.duckdb", refuse_licences=[" "])
    statement = "SELECT DISTINCT session, licence FROM grasps JOIN trials USING (trial, session) ORDER BY 1"
    tables = "SELECT DISTINCT session FROM {} ORDER BY 1"
    with duckdb.connect(str(tmp_path / "all.duckdb"), read_only=True) as whole:
        assert whole.execute(statement).fetchall() == [("box", "CC BY-NC 4.0"), ("brick", "MIT license")]
    with duckdb.connect(str(tmp_path / "open.duckdb"), read_only=True) as free:
        assert free.execute(statement).fetchall() == [("brick", "MIT license")]
        for name in ("objects", "object_points", "sessions", "subjects", "hands", "grasps", "features"):
            assert free.execute(tables.format(name)).fetchall() == [("brick",)], name


def test_the_list_says_all_that_is_needed() -> None:
    told = CliRunner().invoke(app, ["import", "--list"], catch_exceptions=False).stdout
    listed = json.loads(CliRunner().invoke(app, ["import", "--list", "--json"]).stdout)
    assert [entry["name"] for entry in listed] == list(IMPORTERS)
    for entry in listed:
        assert entry["version"]
        assert entry["needs"]
        assert entry["documentation"].startswith(("https://", "docs/"))
        assert all(part in told for part in (entry["title"], *entry["needs"], entry["documentation"]))
    assert CliRunner().invoke(app, ["import"]).exit_code == 2
    assert CliRunner().invoke(app, ["import", "keypoints"]).exit_code == 2
