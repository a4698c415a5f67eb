"""An object that nobody has modelled: depth-camera clouds alone, from the file to the grasp."""

import json
import shutil
from pathlib import Path

import numpy as np
import open3d
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import graspdb
from graspdb.cli import app
from graspdb.ingestion import ingest
from graspdb.simulate import simulate_session
from graspdb.simulate.truth import load_truth
from graspdb_ingest.check import check_session
from graspdb_ingest.objects.live import read_cloud_times
from graspdb_ingest.objects.live_surface import NO_CLOUD, follow_surface
from graspdb_ingest.objects.mesh import load_surface
from graspdb_ingest.parameters import CloudParameters, RegistrationParameters
from graspdb_schemas.errors import ManifestError, QueryError, RecordingError
from graspdb_schemas.manifest_reader import parse_manifest

CAMERAS = np.array([[0.9, -0.9, 0.7], [-0.9, 0.9, 0.7]])
"""Two cameras on two sides of the table, lab frame [m]."""
BOX = trimesh.creation.box([0.05, 0.08, 0.12])


def seen(mesh: trimesh.Trimesh, others: list[trimesh.Trimesh], camera: np.ndarray) -> np.ndarray:
    """Return what a depth camera sees of a mesh, past everything that stands before it: a ray every 2 mm."""
    scene = open3d.t.geometry.RaycastingScene()
    for thing in (mesh, *others):
        vertices = np.asarray(thing.vertices, dtype=np.float32)
        scene.add_triangles(vertices, np.asarray(thing.faces, dtype=np.uint32))
    middle = mesh.bounds.mean(axis=0)
    forward = (middle - camera) / np.linalg.norm(middle - camera)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    reach = np.linalg.norm(mesh.extents) / 2
    steps = np.arange(-reach, reach, 0.002)
    across, up = (axis.ravel() for axis in np.meshgrid(steps, steps))
    targets = middle + across[:, None] * right + up[:, None] * np.cross(right, forward)
    directions = targets - camera
    rays = np.concatenate([np.broadcast_to(camera, targets.shape), directions], axis=1)
    found = scene.cast_rays(rays.astype(np.float32))
    hit = found["geometry_ids"].numpy() == 0
    return camera + directions[hit] * found["t_hit"].numpy()[hit, None].astype(np.float64)


def write_cloud(path: Path, points: np.ndarray) -> None:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    open3d.io.write_point_cloud(str(path), cloud)


def write_list(folder: Path, rows: list[str], title: str = "time,file") -> Path:
    path = folder / "clouds.csv"
    path.write_text("\n".join([title, *rows]) + "\n")
    return path


def placed(mesh: trimesh.Trimesh, turn: np.ndarray, shift: np.ndarray) -> trimesh.Trimesh:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, shift
    return mesh.copy().apply_transform(matrix)


def box_pose(time: float) -> tuple[np.ndarray, np.ndarray]:
    return Rotation.from_rotvec([0, 0.3 * time, 1.5 * time]).as_matrix(), np.array([0.2 * time, 0, 0.1])


def test_a_box_that_turns_half_round_is_followed_by_its_clouds(tmp_path: Path) -> None:
    rng, times, noise = np.random.default_rng(0), np.arange(0, 2.2, 0.1), 0.0005
    for i, time in enumerate(times):
        points = seen(placed(BOX, *box_pose(time)), [], CAMERAS[0])
        write_cloud(tmp_path / f"{i}.pcd", points + noise * rng.normal(size=points.shape))
    camera = ",".join(f"{x}" for x in CAMERAS[0])
    rows = [f"{time},{i}.pcd,{camera}" for i, time in enumerate(times)]
    listed = read_cloud_times(write_list(tmp_path, rows, "time,file,camera_x,camera_y,camera_z"))
    frames = np.arange(0, 2.09, 0.02)
    live = follow_surface(listed, 1.0, frames, CloudParameters(), RegistrationParameters())
    assert live.track.known.all()
    assert not live.notes
    start, middle = box_pose(0.0)[0], live.track.positions[0]
    errors = []
    for i, time in enumerate(frames):
        turn, shift = box_pose(time)
        # the object frame is that of the first cloud
        expected = turn @ start.T
        here = expected @ (middle - box_pose(0.0)[1]) + shift
        errors.append((live.track.rotations[i], expected, live.track.positions[i] - here))
    angles = [Rotation.from_matrix(a @ b.T).magnitude() for a, b, _ in errors]
    offsets = [np.linalg.norm(offset) for *_, offset in errors]
    print(f"\n{1e3 * max(offsets):.2f} mm, {np.degrees(max(angles)):.2f} degrees (greatest)")
    assert max(offsets) < 0.006
    assert max(angles) < np.radians(2)
    # every frame's points lie on the box as it truly is then, and their normals face out of it
    for i in range(0, len(frames), 10):
        cloud = live.clouds[live.of_frame[i]].cloud
        turn, shift = box_pose(frames[i])
        world = cloud.points @ live.track.rotations[i].T + live.track.positions[i]
        inside = (world - shift) @ turn
        off = np.abs(np.abs(inside) - BOX.extents / 2).min(axis=1)
        assert np.median(off) < 0.001 + noise
        outward = np.einsum("ni,ni->n", cloud.normals @ live.track.rotations[i].T @ turn, inside)
        assert np.mean(outward > 0) > 0.95


def test_a_frame_without_clouds_near_it_has_no_object(tmp_path: Path) -> None:
    times = [0.0, 0.1, 0.2, 0.6, 0.7]
    for i, time in enumerate(times):
        write_cloud(tmp_path / f"{i}.ply", seen(placed(BOX, *box_pose(time)), [], CAMERAS[0]))
    write_cloud(tmp_path / "2.ply", np.full((50, 3), np.nan))
    listed = read_cloud_times(write_list(tmp_path, [f"{t},{i}.ply" for i, t in enumerate(times)]))
    frames = np.array([-0.1, 0.04, 0.06, 0.15, 0.4, 0.64, 0.66, 0.8])
    live = follow_surface(listed, 1.0, frames, CloudParameters(), RegistrationParameters())
    assert live.of_frame.tolist() == [NO_CLOUD, 0, 1, NO_CLOUD, NO_CLOUD, 2, 3, NO_CLOUD]
    assert np.array_equal(live.track.known, live.of_frame != NO_CLOUD)
    assert "1 of 5 clouds tell no pose; 2.ply: " in live.notes[0]
    assert "0 finite points" in live.notes[0]


def test_points_that_are_not_finite_or_stand_twice_change_nothing(tmp_path: Path) -> None:
    points = seen(BOX, [], CAMERAS[0])
    broken = points.copy()
    broken[3] = np.nan
    write_cloud(tmp_path / "a.ply", np.delete(points, 3, axis=0))
    write_cloud(tmp_path / "b.ply", np.concatenate([broken, points[10:600]]))
    read = {}
    for name in "ab":
        listed = read_cloud_times(write_list(tmp_path, [f"0,{name}.ply", f"0.1,{name}.ply"]))
        live = follow_surface(listed, 1.0, np.array([0.05]), CloudParameters(), RegistrationParameters())
        read[name] = live.clouds[0]
    distance = read["a"].cloud.tree.query(read["b"].cloud.points)[0]
    assert distance.max() < 0.003
    assert abs(len(read["a"].cloud.points) / len(read["b"].cloud.points) - 1) < 0.05
    assert any("1 of" in warning and "not finite" in warning for warning in read["b"].warnings)


def test_clouds_in_another_unit_are_left_out_with_a_hint(tmp_path: Path) -> None:
    for i in range(2):
        write_cloud(tmp_path / f"{i}.ply", 1000 * seen(BOX, [], CAMERAS[0]))
    listed = read_cloud_times(write_list(tmp_path, ["0,0.ply", "0.1,1.ply"]))
    live = follow_surface(listed, 1.0, np.array([0.05]), CloudParameters(), RegistrationParameters())
    assert not live.clouds
    assert not live.track.known.any()
    assert "2 of 2 clouds tell no pose" in live.notes[0]
    assert "With units mm" in live.notes[0]


@pytest.mark.parametrize(
    ("title", "row", "found"),
    [
        ("time,file,camera_x", "0,0.ply,1", "it has camera_x alone"),
        ("time,file,camera_x,camera_y,camera_z", "0,0.ply,1,2", "line 2: the camera's place is not three"),
        (
            "time,file,camera_x,camera_y,camera_z",
            "0,0.ply,1,2,here",
            "line 2: the camera's place is not three",
        ),
    ],
)
def test_a_camera_without_a_place_is_refused(tmp_path: Path, title: str, row: str, found: str) -> None:
    (tmp_path / "0.ply").write_text("")
    with pytest.raises(RecordingError, match=found):
        read_cloud_times(write_list(tmp_path, [row], title))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulated trial in which two depth cameras see the milk jug past the hand."""
    folder = tmp_path_factory.mktemp("live") / "session"
    simulate_session(folder, subjects=1, trials=1, seed=3, objects=["jug"], kinds=["side_power"], rate=60.0)
    (true,) = load_truth(folder).trials.values()
    manifest = yaml.safe_load((folder / "session.yaml").read_text())
    (trial,) = manifest["trials"]
    again = Path(trial["file"]).with_name("again.c3d")
    shutil.copy(folder / trial["file"], folder / again)
    manifest["objects"]["unknown"] = {"category": "jug", "mass": 1.0}
    shown = {"file": str(again), "object": "unknown", "clouds": "clouds/clouds.csv"}
    manifest["trials"].append(trial | shown)
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
    (folder / "clouds").mkdir()
    surface = load_surface(folder / "objects/jug.stl", 0.001)
    jug = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    ball = trimesh.creation.icosphere(2, 0.008)
    rng, rows = np.random.default_rng(0), []
    rotations = Rotation.from_quat(true.object_rotation, scalar_first=True).as_matrix()
    for frame in range(0, len(true.times), 6):  # 10 clouds a second
        here = placed(jug, rotations[frame], true.object_position[frame])
        hand = [placed(ball, np.eye(3), site) for site in true.sites[frame]]
        points = np.concatenate([seen(here, hand, camera) for camera in CAMERAS])
        points += 0.0005 * rng.normal(size=points.shape)
        write_cloud(folder / f"clouds/{frame}.ply", 1000 * points)
        rows.append(f"{true.times[frame]},{frame}.ply")
    write_list(folder / "clouds", rows)
    return folder


@pytest.fixture(scope="module")
def database(session: Path) -> Path:
    report = ingest(session, session.parent / "db")
    assert not report.rejected, report
    return session.parent / "db"


def test_a_grasp_without_a_model_is_that_with_the_model(database: Path) -> None:
    with graspdb.open(database) as db:
        rows = db.sql("SELECT * FROM grasps ORDER BY object").df()
        assert rows.object.tolist() == ["jug", "unknown"]
        model, live = (row for _, row in rows.iterrows())
        grasp = db.grasp(live.grasp)
        objects = db.sql("SELECT * FROM grasp_objects WHERE grasp = $g", g=live.grasp).df().iloc[0]
        maps = db.sql("SELECT points FROM contact_maps WHERE grasp = $g", g=live.grasp).rows()
        n = db.sql(
            "SELECT count(*) FROM object_points WHERE ingest_id = $i", i=objects.object_ingest_id
        ).rows()
    near = np.asarray(model.gap) < 0.01
    difference = np.asarray(live.gap)[near] - np.asarray(model.gap)[near]
    print(
        f"gaps differ by {1e3 * np.median(np.abs(difference)):.2f} mm (median), feature {live.feature_points}"
    )
    assert abs(live.lift_time - model.lift_time) < 0.1
    both = set(model.contact_sites) & set(live.contact_sites)
    assert len(both) >= 0.7 * len(model.contact_sites)
    assert live.hull_volume == pytest.approx(model.hull_volume, rel=0.3)
    assert live.feature_points > 30
    assert np.isnan(live.object_volume_in_hull)
    assert n == [(objects.n_points,)]
    assert max(maps[0][0]) < objects.n_points
    assert grasp.feature_cloud.shape == (live.feature_points, 3)
    assert np.isfinite(grasp.feature_cloud).all()
    # The feature lies in the hull that is stored beside it.
    low, high = grasp.hull_vertices.min(axis=0), grasp.hull_vertices.max(axis=0)
    assert ((grasp.feature_cloud >= low - 1e-6) & (grasp.feature_cloud <= high + 1e-6)).all()


@pytest.mark.parametrize(
    ("key", "value"),
    [("markers", {"a": [0, 0, 0], "b": [50, 0, 0], "c": [0, 50, 0]}), ("mesh_units", "m"),
     ("center_of_mass", [0, 0, 50])],
)  # fmt: skip
def test_what_refers_to_a_mesh_needs_one(session: Path, key: str, value: object) -> None:
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    manifest["objects"]["unknown"][key] = value
    (session / "other.yaml").write_text(yaml.safe_dump(manifest))
    with pytest.raises(ManifestError, match=f"objects.unknown.{key}: .*nothing without a mesh"):
        parse_manifest(session / "other.yaml")


def test_an_object_without_a_mesh_needs_clouds(session: Path) -> None:
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    del manifest["trials"][1]["clouds"]
    (session / "other.yaml").write_text(yaml.safe_dump(manifest))
    with pytest.raises(ManifestError, match="'unknown', which has no mesh"):
        parse_manifest(session / "other.yaml")


def test_check_says_what_is_wrong_with_a_list_of_clouds(session: Path) -> None:
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    (session / "clouds/empty.csv").write_text("time,file\n")
    manifest["trials"][1]["clouds"] = "clouds/empty.csv"
    (session / "other.yaml").write_text(yaml.safe_dump(manifest))
    first, second = check_session(session / "other.yaml").trials
    assert not [warning for warning in first.warnings if "clouds" in warning]
    assert any("it lists no cloud" in warning for warning in second.warnings)


def test_a_hand_that_never_reaches_the_object_says_how_near_it_came(session: Path, tmp_path: Path) -> None:
    """Cut the trial before the hand comes: it has no grasp, and a stored reason."""
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    del manifest["trials"][1]
    (true,) = load_truth(session).trials.values()
    manifest["trials"][0]["end"] = true.events.reach + 0.2
    (session / "early.yaml").write_text(yaml.safe_dump(manifest))
    (trial,) = ingest(session / "early.yaml", tmp_path / "db").trials
    assert trial.status == "ok", trial.reasons
    assert trial.n_grasps == 0
    assert any("it comes no nearer to the object than" in reason for reason in trial.reasons)


def map_file(database: Path, path: Path, grasp: str) -> Path:
    """Write an object's points as measured, touched where the stored contact map says up to 2 mm."""
    with graspdb.open(database) as db:
        thing = (
            db.sql("SELECT object_ingest_id AS id FROM grasp_objects WHERE grasp = $g", g=grasp).df().id[0]
        )
        points = db.sql(
            "SELECT point, position, normal FROM object_points WHERE ingest_id = $i ORDER BY point", i=thing
        ).rows()
        ((near, gaps),) = db.sql("SELECT points, gaps FROM contact_maps WHERE grasp = $g", g=grasp).rows()
    touched = {point for point, gap in zip(near, gaps, strict=True) if gap < 0.002}
    lines = ["x,y,z,contact,nx,ny,nz"]
    lines += [
        ",".join(str(v) for v in (*position, float(point in touched), *normal))
        for point, position, normal in points
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_map_made_of_a_stored_grasp_agrees_with_that_grasp(database: Path, tmp_path: Path) -> None:
    with graspdb.open(database) as db:
        grasp = db.sql("SELECT grasp FROM grasps WHERE object = 'jug'").rows()[0][0]
    file = map_file(database, tmp_path / "measured.csv", grasp)
    command = ["validate", "contact-map", str(file), "--db", str(database)]
    told = CliRunner().invoke(
        app, [*command, "--grasp", grasp, "--surface", "spheres", "--gap", "2", "--json"]
    )
    assert told.exit_code == 0, told.output
    by_distance = json.loads(told.output)[0]
    assert by_distance["auc"] == pytest.approx(1, abs=1e-6)
    assert by_distance["at"][0]["f1"] == pytest.approx(1, abs=1e-3)
    unknown = CliRunner().invoke(app, [*command, "--grasp", f"{grasp}0"])
    assert isinstance(unknown.exception, QueryError)
    missing = CliRunner().invoke(app, command)
    assert missing.exit_code == 2
    assert "name the grasps" in " ".join(missing.output.split())
