"""Public data sets and a recording in one database: what they brought, asked of all of them at once."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

import graspdb
from graspdb.importing import import_data_set
from graspdb.ingestion import IngestReport, ingest
from graspdb_ingest.importers import bvh
from graspdb_ingest.importers.base import ClipSource, ImportOptions
from graspdb_ingest.importers.plausible import chirality
from graspdb_schemas.vocabulary import DIGITS, Side

SIG18 = Path(__file__).parents[1] / "fixtures" / "sig18" / "session.yaml"
OBJECTS = ("005_tomato_soup_can", "009_gelatin_box")
PER_OBJECT = 4


def few_grasps(data: Path, folder: Path) -> Path:
    """Write some grasps of two objects of DexYCB, as they stand in its file."""
    with np.load(data / "dexycb-grasps" / "grasps.npz") as arrays:
        some = {f"{name}.joints_m": arrays[f"{name}.joints_m"][:PER_OBJECT] for name in OBJECTS}
    np.savez(folder / "grasps.npz", **some)
    return folder / "grasps.npz"


def one_trial(folder: Path) -> Path:
    """Write the manifest of the recorded hands with its shortest trial alone."""
    manifest = yaml.safe_load(SIG18.read_text())
    manifest["trials"] = [trial for trial in manifest["trials"] if trial["subject"] == "User2"]
    manifest["subjects"] = {"User2": manifest["subjects"]["User2"]}
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
    return folder


@pytest.fixture(scope="module")
def reports(
    shared_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, IngestReport]]:
    folder: Path = tmp_path_factory.mktemp("all")
    db, right = folder / "grasps", Side.RIGHT
    nc = ImportOptions(
        session="dexycb", side=right, licence="CC BY-NC 4.0", objects=shared_data / "dexycb-grasps"
    )
    video = ImportOptions(session="video", side=right, licence="MIT")
    found = [
        import_data_set("keypoints", few_grasps(shared_data, folder), db, options=nc),
        import_data_set("keypoints", shared_data / "keypoints", db, options=video),
        import_data_set("contactpose", shared_data / "contactpose-camera", db),
        import_data_set("manipnet", shared_data / "manipnet" / "mug1", db),
        ingest(one_trial(folder), db, data_root=shared_data),
    ]
    return db, {report.session: report for report in found}


@pytest.fixture(scope="module")
def database(reports: tuple[Path, dict[str, IngestReport]]) -> Iterator[graspdb.Database]:
    with graspdb.open(reports[0]) as opened:
        yield opened


def test_everything_is_in_one_database(database: graspdb.Database) -> None:
    found = database.sql(
        "SELECT session, count(*), sum(n_grasps)::INT, count(*) FILTER (status = 'ok'), any_value(licence) "
        "FROM trials GROUP BY ALL"
    ).rows()
    by_session = {row[0]: row[1:] for row in found}
    assert by_session["contactpose"][:3] == (2, 2, 2)
    assert by_session["dexycb"] == (2, 2 * PER_OBJECT, 2, "CC BY-NC 4.0")
    assert by_session["video"] == (7, 0, 7, "MIT")
    assert by_session["sig18"] == (1, 0, 1, None)
    assert by_session["manipnet"][0] == 1
    assert 8 <= by_session["manipnet"][1] <= 13


def test_one_query_runs_over_all_of_them(database: graspdb.Database) -> None:
    grasps = database.sql(
        "SELECT session, count(*), avg(n_contacts), avg(grip_aperture), count(q) FROM grasps GROUP BY ALL"
    ).rows()
    assert {row[0] for row in grasps} == {"contactpose", "dexycb", "manipnet"}
    assert all(row[2] >= 2 and 0.01 < row[3] < 0.15 and row[4] == 0 for row in grasps)
    frames = database.sql(
        "SELECT split_part(trial, '/', 1) AS session, count(*), count(sites), count(gap) FROM frames "
        "GROUP BY ALL"
    ).rows()
    by_session = {row[0]: row[1:] for row in frames}
    assert by_session["video"] == (621, 621, 0)
    assert by_session["manipnet"] == (8000, 8000, 8000)
    # 248 frames that the cameras kept of the 459 that they took
    assert by_session["contactpose"] == (2 + 2 * 459, 2 + 2 * 246, 2)


def test_one_similarity_search_runs_over_all_of_them(database: graspdb.Database) -> None:
    total = database.sql("SELECT count(*) FROM grasps").rows()[0][0]
    for by in ("feature", "posture"):
        found = database.similar("contactpose/full1_use_camera/right/0", k=total, by=by)
        assert found.searched + found.left_out >= total - 1
        sessions = {hit.grasp.partition("/")[0] for hit in found.hits}
        assert sessions == {"contactpose", "dexycb", "manipnet"}


def test_the_thermal_map_is_kept_and_agrees_with_the_hands(database: graspdb.Database) -> None:
    kind, points, contact = database.sql("SELECT kind, points, contact FROM measured_maps").rows()[0]
    assert kind == "thermal"
    assert max(contact) == pytest.approx(1, abs=0.1)
    touched = {point for point, heat in zip(points, contact, strict=True) if heat > 0.4}
    near: set[int] = set()
    for found, gaps in database.sql(
        "SELECT points, gaps FROM contact_maps WHERE session = 'contactpose'"
    ).rows():
        near |= {point for point, gap in zip(found, gaps, strict=True) if gap < 0.01}
    n_points = database.sql("SELECT n_points FROM objects WHERE object = 'camera'").rows()[0][0]
    # Where the camera saw heat there is a hand nearby, and much more often so than anywhere on it.
    assert len(touched & near) / len(touched) > 2 * len(near) / n_points


def test_manipnet_is_the_world_that_it_was_recorded_in(shared_data: Path, database: graspdb.Database) -> None:
    folder = shared_data / "manipnet" / "mug1"
    source: ClipSource = next(bvh.find_manipnet(folder, ImportOptions()))
    clip = bvh.read_manipnet(source, ImportOptions())
    for hand in clip.hands:
        assert (chirality(hand.key_points) > 0) == (hand.side is Side.RIGHT)
        assert hand.extrapolated == tuple(f"{digit}_tip" for digit in DIGITS)
    flags = database.sql(
        "SELECT DISTINCT flags FROM frames WHERE trial = 'manipnet/mug1' AND side = 'left'"
    ).rows()
    assert flags == [
        ([f"extrapolated:{digit}_tip" for digit in ("thumb", "index", "middle", "ring", "little")],)
    ]
    lifts = database.sql("SELECT count(*) FROM grasps WHERE session = 'manipnet' AND lift_time > 0").rows()
    assert lifts[0][0] >= 3


def test_what_has_no_mesh_is_told(reports: tuple[Path, dict[str, IngestReport]]) -> None:
    moving = next(t for t in reports[1]["contactpose"].trials if "ps_controller" in t.trial)
    assert moving.status == "ok"
    assert any("no mesh of object 'ps_controller'" in reason for reason in moving.reasons)
