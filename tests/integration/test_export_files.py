"""Exports for other tools, read back by the formats' own libraries: values as the database has them."""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ezc3d
import mujoco
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import trimesh
import webdataset
from held_database import (
    GRASPS,
    IMPORTED,
    LOST,
    MARKERS,
    N_FRAMES,
    RATE,
    SNAPSHOT,
    STATIC,
    TOUCHING,
    TRACKED,
    UNTRACKED,
    build,
    hand,
    motion,
)
from scipy.spatial.transform import Rotation

import graspdb
from graspdb.export.held import HeldObject, HeldReader
from graspdb_ingest.readers.trc import read_trc
from graspdb_schemas.errors import MissingLibraryError
from graspdb_schemas.vocabulary import CONFIGURATION, JOINT_ANGLES, KEY_POINTS, SITES

MOVING = ("lab/a mug%3F.1/right", "set/clip/right")
"""Files of the hands in motion: the tracked one, and the imported one."""


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    with graspdb.open(build(tmp_path_factory.mktemp("held") / "db")) as opened:
        yield opened


@pytest.fixture(scope="module")
def held(database: graspdb.Database) -> dict[str, HeldObject]:
    found = HeldReader(database).read([database.grasp(key) for key in GRASPS])
    return {item.grasp.id: item for item in found}


@pytest.fixture(scope="module")
def moved() -> dict[str, np.ndarray]:
    return motion()


def stem(grasp: str) -> str:
    return grasp.replace("?", "%3F")


def rows_but(unknown: slice, values: np.ndarray) -> np.ndarray:
    """Return values with NaN in some frames."""
    whole = values.astype(float).copy()
    whole[unknown] = np.nan
    return whole


def object_points(poses: np.ndarray) -> np.ndarray:
    """Return origin and axes' points of the object, shape (n, 4, 3)."""
    ends = np.vstack([np.zeros(3), 0.1 * np.eye(3)])
    return ends @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]


def expected_points(moved: dict[str, np.ndarray]) -> np.ndarray:
    """Return markers, sites and the object's points of the tracked trial, shape (n, 26, 3)."""
    markers = rows_but(slice(7, 8), moved["markers"])
    sites = rows_but(UNTRACKED, moved["sites"])
    return np.concatenate([markers, sites, rows_but(LOST, object_points(moved["object"]))], axis=1)


POINT_LABELS = (*MARKERS, *(f"site_right_{site}" for site in SITES))


def test_trc_has_markers_sites_and_object(
    database: graspdb.Database, moved: dict[str, np.ndarray], tmp_path: Path
) -> None:
    report = database.export("trc", tmp_path / "out")
    assert report.left_out == {"hands without a frame rate (static grasps)": 1}
    read = read_trc(tmp_path / "out" / f"{MOVING[0]}.trc", 1.0)
    assert read.labels[:22] == POINT_LABELS
    assert read.rate == RATE
    assert read.start_time == pytest.approx(2.0)
    np.testing.assert_allclose(read.positions, expected_points(moved), atol=1e-9)
    imported = read_trc(tmp_path / "out" / f"{MOVING[1]}.trc", 1.0)
    np.testing.assert_allclose(imported.positions[:, :20], moved["sites"], atol=1e-9)


def test_c3d_has_them_too_with_events(
    database: graspdb.Database, moved: dict[str, np.ndarray], tmp_path: Path
) -> None:
    database.export("c3d", tmp_path / "out")
    file = ezc3d.c3d(str(tmp_path / "out" / f"{MOVING[0]}.c3d"))
    points = file["data"]["points"]
    missing = np.isnan(expected_points(moved)).any(axis=2)
    np.testing.assert_array_equal(file["data"]["meta_points"]["residuals"][0].T < 0, missing)
    values = points[:3].transpose(2, 1, 0)[~missing]
    wanted = 1000 * expected_points(moved)[~missing]
    np.testing.assert_allclose(values, wanted, rtol=2**-22)  # ezc3d may round the last bit of a float32
    parameters = file["parameters"]
    assert parameters["POINT"]["LABELS"]["value"][:22] == list(POINT_LABELS)
    assert file["header"]["points"]["first_frame"] == 2 * RATE
    assert parameters["EVENT"]["LABELS"]["value"] == ["contact", "lift"]
    times = parameters["EVENT"]["TIMES"]["value"]
    np.testing.assert_allclose(60 * times[0] + times[1], moved["time"][[15, SNAPSHOT]], rtol=1e-6)


def read_mot(path: Path) -> pd.DataFrame:
    lines = path.read_text().splitlines()
    end = lines.index("endheader")
    assert {"version=1", "inDegrees=no"} <= set(lines[:end])
    table = pd.read_csv(path, sep="\t", skiprows=end + 1)
    assert f"nRows={len(table)}" in lines
    assert f"nColumns={len(table.columns)}" in lines
    return table


def test_mot_gives_the_configuration_back(
    database: graspdb.Database, moved: dict[str, np.ndarray], tmp_path: Path
) -> None:
    report = database.export("mot", tmp_path / "out")
    assert report.left_out == {"hands without joint angles": 2, "frames without joint angles": 2}
    table = read_mot(tmp_path / "out" / f"{MOVING[0]}_hand.mot")
    kept = slice(UNTRACKED.stop, None)
    np.testing.assert_allclose(table["time"], moved["time"][kept], atol=1e-8)
    q = moved["q"][kept]
    np.testing.assert_allclose(table[[f"forearm_t{axis}" for axis in "xyz"]], q[:, :3], atol=1e-8)
    np.testing.assert_allclose(table[list(JOINT_ANGLES)], q[:, 7:], atol=1e-8)
    turns = Rotation.from_euler("XYZ", table[[f"forearm_r{axis}" for axis in "xyz"]])
    wanted = Rotation.from_quat(q[:, 3:7], scalar_first=True)
    assert (turns.inv() * wanted).magnitude().max() < 1e-7
    held_object = read_mot(tmp_path / "out" / f"{MOVING[0]}_object.mot")
    assert len(held_object) == N_FRAMES - 3
    assert not held_object.isna().to_numpy().any()


def ply_vertices(path: Path) -> Any:
    """Return the vertices of a PLY file as trimesh reads them."""
    return trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]["data"]


def test_ply_has_clouds_hulls_contacts_and_sites(
    database: graspdb.Database, held: dict[str, HeldObject], tmp_path: Path
) -> None:
    report = database.export("ply", tmp_path / "out")
    assert report.counts == {"grasps": 3, "files": 12}
    for key in GRASPS:
        item, name = held[key], stem(key)
        grasp = item.grasp
        cloud = ply_vertices(tmp_path / "out" / f"{name}_cloud.ply")
        for axes, values in (("xyz", item.cloud.points), (("nx", "ny", "nz"), item.cloud.normals)):
            read = np.column_stack([cloud[axis] for axis in axes])
            np.testing.assert_array_equal(read, values.astype(np.float32))
        assert np.flatnonzero(cloud["feature"]).tolist() == grasp.feature_points.tolist()
        near = np.isfinite(cloud["gap"])
        assert np.flatnonzero(near).tolist() == list(range(0, 200, 2))
        np.testing.assert_array_equal(cloud["gap"][near], item.map_gaps.astype(np.float32))
        hull = trimesh.load(tmp_path / "out" / f"{name}_hull.ply", process=False)
        np.testing.assert_array_equal(hull.faces, grasp.hull_faces)
        contacts = ply_vertices(tmp_path / "out" / f"{name}_contacts.ply")
        assert tuple(contacts["site"].ravel().tolist()) == TOUCHING
        sites = ply_vertices(tmp_path / "out" / f"{name}_sites.ply")
        np.testing.assert_array_equal(sites["radius"], item.radii.astype(np.float32))


def test_obj_has_clouds_hulls_and_contacts(
    database: graspdb.Database, held: dict[str, HeldObject], tmp_path: Path
) -> None:
    database.export("obj", tmp_path / "out")
    grasp = held[TRACKED].grasp
    hull = trimesh.load(tmp_path / "out" / f"{stem(TRACKED)}_hull.obj", process=False)
    np.testing.assert_allclose(hull.vertices, grasp.hull_vertices, atol=1e-9)
    np.testing.assert_array_equal(hull.faces, grasp.hull_faces)
    lines = (tmp_path / "out" / f"{stem(TRACKED)}_contacts.obj").read_text().splitlines()
    for kind, wanted in (("v ", grasp.contact_points), ("vn ", grasp.contact_normals)):
        read = [line.split()[1:] for line in lines if line.startswith(kind)]
        np.testing.assert_allclose(np.array(read, dtype=float), wanted, atol=1e-8)
    assert [line for line in lines if line.startswith("p ")] == ["p 1", "p 2", "p 3"]


def test_shards_have_every_grasp_with_fixed_shapes(
    database: graspdb.Database, held: dict[str, HeldObject], tmp_path: Path
) -> None:
    database.export("grasps", tmp_path / "npz")
    shard = np.load(tmp_path / "npz" / "grasps-00000.npz", allow_pickle=False)
    assert shard["grasp"].tolist() == sorted(GRASPS)
    for row, key in enumerate(sorted(GRASPS)):
        item = held[key]
        for name, wanted in (
            ("sites", item.grasp.sites),
            ("object_from_hand", item.grasp.object_from_hand),
            ("gap", item.grasp.gap),
            ("radii", item.radii),
            ("joint_angles", item.grasp.q[7:]),
        ):
            np.testing.assert_array_equal(shard[name][row], wanted.astype(np.float32))
        assert tuple(np.flatnonzero(shard["touching"][row])) == TOUCHING
        touched = shard["contact_points"][row]
        np.testing.assert_array_equal(touched[list(TOUCHING)], item.grasp.contact_points.astype(np.float32))
        assert np.isnan(np.delete(touched, TOUCHING, axis=0)).all()
        feature = {tuple(point) for point in shard["feature_cloud"][row].tolist()}
        assert feature == {tuple(point) for point in item.grasp.feature_cloud.astype(np.float32).tolist()}
        cloud = np.load(tmp_path / "npz" / str(shard["cloud"][row]))
        numbers = cloud["object_points"]
        np.testing.assert_array_equal(cloud["object_cloud"], item.cloud.points[numbers].astype(np.float32))
        np.testing.assert_array_equal(
            shard["contact_map"][row], item.point_gaps()[numbers].astype(np.float32)
        )
        mesh = trimesh.load(tmp_path / "npz" / str(shard["mesh"][row]))
        assert np.abs(mesh.bounds - [p(item.cloud.points, 0) for p in (np.min, np.max)]).max() < 0.004


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # webdataset leaves the closing to the collector
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_webdataset_reads_the_same_from_tar(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("grasps", tmp_path / "npz")
    database.export("webdataset", tmp_path / "tar")
    shard = np.load(tmp_path / "npz" / "grasps-00000.npz")
    url = str(tmp_path / "tar" / "grasps-00000.tar")
    samples = list(webdataset.WebDataset(url, shardshuffle=False).decode())
    assert [sample["json"]["grasp"] for sample in samples] == shard["grasp"].tolist()
    arrays = [name for name in shard.files if shard[name].dtype.kind != "U"]
    for row, sample in enumerate(samples):
        for name in arrays:
            np.testing.assert_array_equal(sample[f"{name}.npy"], shard[name][row])


def test_glb_stands_upright_and_shows_hand_and_object(
    database: graspdb.Database, held: dict[str, HeldObject], tmp_path: Path
) -> None:
    database.export("glb", tmp_path / "out")
    item = held[TRACKED]
    scene = trimesh.load_scene(tmp_path / "out" / f"{stem(TRACKED)}.glb")
    assert set(scene.geometry) == {
        "object", "hand", "sites_touching", "sites_free", "hull", "feature", "contacts"
    }  # fmt: skip
    read = np.asarray(scene.geometry["hull"].vertices)
    wanted = item.grasp.hull_vertices[np.unique(item.grasp.hull_faces)].astype(np.float32)
    assert {tuple(v) for v in read.astype(np.float32).tolist()} == {tuple(v) for v in wanted.tolist()}
    assert item.up is not None
    assert item.world_from_object is not None
    upright = scene.graph.get("object")[0][:3, :3]
    up_in_object = item.world_from_object[:3, :3].T @ item.up
    np.testing.assert_allclose(upright @ up_in_object, [0, 1, 0], atol=1e-6)
    spheres = scene.geometry["sites_touching"]
    assert len(trimesh.Trimesh(spheres.vertices, spheres.faces).split()) == len(TOUCHING)


@pytest.fixture(scope="module")
def scenes(database: graspdb.Database, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("mjcf") / "out"
    report = database.export("mjcf", folder)
    assert report.counts == {"grasps": 3, "hands fitted to sites": 2}
    return folder


def in_object_frame(data: mujoco.MjData) -> np.ndarray:
    """Return the 20 sites in the frame of the object, as MuJoCo has them."""
    body = data.body("object")
    sites = np.array([data.site(site).xpos for site in SITES])
    return (sites - body.xpos) @ body.xmat.reshape(3, 3)


@pytest.mark.parametrize(("key", "off"), [(TRACKED, 1e-9), (IMPORTED, 0.004), (STATIC, 0.004)])
def test_mujoco_has_the_hand_where_the_grasp_has_it(
    scenes: Path, held: dict[str, HeldObject], key: str, off: float
) -> None:
    model = mujoco.MjModel.from_xml_path(str(scenes / f"{stem(key)}.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("grasp").id)
    mujoco.mj_forward(model, data)
    distances = np.linalg.norm(in_object_frame(data) - held[key].grasp.sites, axis=1)
    assert distances.max() < off


def test_mujoco_steps_a_grasp_stably(scenes: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(scenes / f"{stem(TRACKED)}.xml"))
    assert [model.key(i).name for i in range(model.nkey)] == ["grasp", "reach", "contact", "hold"]
    np.testing.assert_allclose(model.opt.gravity, [0, 0, -9.81])
    data = mujoco.MjData(model)
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        for _ in range(100):
            mujoco.mj_step(model, data)
        assert not data.warning.number.any()
        assert np.abs(data.qvel).max() < 20
    assert model.body("object").mass == pytest.approx(0.3)


def test_a_grasp_seen_in_no_lab_has_no_gravity(scenes: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(scenes / f"{stem(STATIC)}.xml"))
    assert not model.opt.gravity.any()
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "support") < 0


def test_keypoints_of_tracked_and_imported_hands(
    database: graspdb.Database, moved: dict[str, np.ndarray], tmp_path: Path
) -> None:
    report = database.export("keypoints", tmp_path / "out", missing="mask")
    assert report.counts == {"episodes": 3, "frames": 2 * N_FRAMES + 1}
    tracked, imported = (np.load(tmp_path / "out" / f"{name}.npz") for name in MOVING)
    pose = hand().forward(moved["q"])
    wrists = pose.positions[:, 1]
    valid = tracked["valid"]
    unknown = {*range(N_FRAMES)[LOST], *range(N_FRAMES)[UNTRACKED]}
    assert set(np.flatnonzero(~valid)) == unknown
    for file in (tracked, imported):
        assert tuple(file["key_point_names"]) == KEY_POINTS
        known = file["valid"]
        sites = file["key_points"][known][:, 1:]
        np.testing.assert_array_equal(sites, moved["sites"][known].astype(np.float32))
        np.testing.assert_allclose(file["key_points"][known][:, 0], wrists[known], atol=1e-6)
        turns = file["world_from_wrist"][known][:, :3, :3]
        np.testing.assert_allclose(turns, pose.rotations[known][:, 1], atol=1e-5)
        np.testing.assert_allclose(file["world_from_object"][known], moved["object"][known], atol=1e-6)
    assert np.isnan(tracked["key_points"][~valid]).all()


def test_keypoints_drops_what_is_not_known(database: graspdb.Database, tmp_path: Path) -> None:
    report = database.export("keypoints", tmp_path / "out")
    assert report.left_out == {"frames without hand or object": 5}
    assert len(np.load(tmp_path / "out" / f"{MOVING[0]}.npz")["time"]) == N_FRAMES - 5


def test_retargeting_names_what_is_not_installed(
    database: graspdb.Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingLibraryError, match=r"graspdb\[retarget\]"):
        database.export("keypoints", tmp_path / "out", retarget="allegro_{side}.yml")
    assert not list(tmp_path.rglob("*.npz"))


def test_flat_rows_are_those_of_the_database(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("parquet", tmp_path / "parquet")
    database.export("csv", tmp_path / "csv")
    table = pq.read_table(tmp_path / "parquet" / "grasps-00000.parquet")
    assert not any(field.type.num_fields for field in table.schema)
    assert table.schema.field("gap_index_tip").metadata[b"unit"] == b"m"
    rows = table.to_pylist()
    assert [row["grasp"] for row in rows] == sorted(GRASPS)
    for row in rows:
        grasp = database.grasp(row["grasp"])
        assert [
            [row[f"sites_object_{site}_{axis}"] for axis in "xyz"] for site in SITES
        ] == grasp.sites.tolist()
        assert [row[f"gap_{site}"] for site in SITES] == grasp.gap.tolist()
        values = np.array([row[f"q_{name}"] for name in CONFIGURATION], dtype=float)
        np.testing.assert_array_equal(values, grasp.q)
        assert row["contact_sites"] == "thumb_tip index_tip middle_tip"
        assert row["virtual_fingers"] == "thumb | index middle | "
        assert row["quality_epsilon"] == 0.1
    read = pd.read_csv(tmp_path / "csv" / "grasps-00000.csv")
    whole, read_back = (
        t.astype(object).where(t.notna() & (t != ""), None) for t in (table.to_pandas(), read)
    )
    pd.testing.assert_frame_equal(read_back, whole)
    with (tmp_path / "csv" / "columns.csv").open(newline="") as file:
        assert [row["column"] for row in csv.DictReader(file)] == table.column_names


def test_splits_lie_in_folders_and_shards_of_their_own(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("ply", tmp_path / "ply", split="random", seed=1)
    database.export("webdataset", tmp_path / "tar", split="random", seed=1)
    sides = {folder.name for folder in (tmp_path / "ply").iterdir() if folder.is_dir()}
    assert sides == {"train", "valid"}
    assert {file.name.partition("-")[0] for file in (tmp_path / "tar").glob("*.tar")} == sides


def test_a_card_lists_what_the_files_hold(database: graspdb.Database, tmp_path: Path) -> None:
    database.export("grasps", tmp_path / "out", where="session = 'set'")
    card = (tmp_path / "out" / "README.md").read_text()
    assert "feature_cloud" in card
    assert "CC BY-NC 4.0" in card
