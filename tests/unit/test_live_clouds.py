"""The object as a live cloud: lists of clouds read, poses between clouds, bad clouds with a reason."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

import graspdb
from graspdb.ingestion import ingest
from graspdb.simulate import simulate_session
from graspdb.simulate.truth import load_truth
from graspdb_ingest.objects.cloud import sample_cloud
from graspdb_ingest.objects.live import follow_clouds, read_cloud_times
from graspdb_ingest.objects.mesh import load_surface
from graspdb_ingest.parameters import RegistrationParameters
from graspdb_schemas.errors import ManifestError, RecordingError
from graspdb_schemas.manifest_reader import parse_manifest

BOX = trimesh.creation.box([0.05, 0.08, 0.12])


def write_cloud(path: Path, points: np.ndarray) -> None:
    lines = [f"{x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += ["property float x", "property float y", "property float z", "end_header"]
    path.write_text("\n".join([*head, *lines]) + "\n")


def write_list(folder: Path, rows: list[tuple[float, str]]) -> Path:
    path = folder / "clouds.csv"
    path.write_text("time,file\n" + "".join(f"{time},{name}\n" for time, name in rows))
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.mktemp("box") / "box.stl"
    BOX.export(path)
    return sample_cloud(load_surface(path))


def pose(time: float) -> tuple[np.ndarray, np.ndarray]:
    return Rotation.from_rotvec([0, 0.2 * time, 0.5 * time]).as_matrix(), np.array([0.2 * time, 0, 0.1])


def visible(model, time, rng, noise=0.001):
    turn, shift = pose(time)
    points = model.points @ turn.T + shift
    seen = (model.normals @ turn.T) @ np.array([0.5, -0.7, 0.5]) > 0.1
    return points[seen] + noise * rng.normal(size=(int(seen.sum()), 3))


def test_poses_between_clouds_and_none_where_they_are_missing(tmp_path, model):
    rng = np.random.default_rng(0)
    times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.9, 1.0]
    for i, time in enumerate(times):
        write_cloud(tmp_path / f"{i}.ply", 1000 * visible(model, time, rng))
    write_cloud(tmp_path / "3.ply", np.full((50, 3), np.nan))
    listed = read_cloud_times(write_list(tmp_path, [(t, f"{i}.ply") for i, t in enumerate(times)]))
    frames = np.linspace(-0.1, 1.1, 121)
    found = follow_clouds(listed, 0.001, model, frames, RegistrationParameters())
    known = found.track.known
    told = ((frames >= 0) & (frames <= 0.2)) | ((frames >= 0.4) & (frames <= 0.6)) | (frames >= 0.9)
    told &= frames <= 1.0
    inner = np.abs(frames[:, None] - [0, 0.2, 0.4, 0.6, 0.9, 1.0]).min(axis=1) > 1e-6
    assert np.array_equal(known[inner], told[inner])
    assert np.isfinite(found.fitness[known]).all()
    assert np.isnan(found.fitness[~known]).all()
    assert len(found.notes) == 1
    assert "1 of 9 clouds tell no pose; 3.ply: the cloud has no finite point" in found.notes[0]
    for i in np.flatnonzero(known):
        turn, shift = pose(frames[i])
        assert np.linalg.norm(found.track.positions[i] - shift) < 0.0015
        assert Rotation.from_matrix(found.track.rotations[i] @ turn.T).magnitude() < np.radians(2)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the file is empty"),
        (b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "neither faces nor points"),
        (b"nonsense", "not readable as PLY"),
    ],
)
def test_a_bad_cloud_is_a_reason_and_stops_no_other(tmp_path, model, content, reason):
    rng = np.random.default_rng(1)
    for i in range(3):
        write_cloud(tmp_path / f"{i}.ply", visible(model, 0.1 * i, rng))
    (tmp_path / "bad.ply").write_bytes(content)
    rows = [(0.0, "0.ply"), (0.1, "1.ply"), (0.2, "2.ply"), (0.3, "bad.ply")]
    listed = read_cloud_times(write_list(tmp_path, rows))
    found = follow_clouds(listed, 1.0, model, np.array([0.05, 0.15, 0.25]), RegistrationParameters())
    assert found.track.known.tolist() == [True, True, False]
    assert reason in found.notes[0]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "no columns time and file"),
        ("time,cloud\n0,a.ply\n", "no columns time and file"),
        ("time,file\n", "lists no cloud"),
        ("time,file\nsoon,a.ply\n", "line 2: the time 'soon'"),
        ("time,file\n0,../a.ply\n", "no name of a file beside it"),
        ("time,file\n0,/etc/passwd\n", "no name of a file beside it"),
        ("time,file\n0,none.ply\n", "'none.ply' does not exist"),
        ("time,file\n0.1,a.ply\n0.1,a.ply\n", "line 3: the time does not increase"),
    ],
)
def test_a_bad_list_says_what_is_wrong(tmp_path, text, found):
    (tmp_path / "a.ply").write_text("")
    path = tmp_path / "clouds.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=found):
        read_cloud_times(path)


def test_a_link_that_leads_out_of_the_folder_of_the_list_is_refused(tmp_path):
    (tmp_path / "secret.ply").write_text("")
    folder = tmp_path / "clouds"
    folder.mkdir()
    (folder / "a.ply").symlink_to(tmp_path / "secret.ply")
    path = folder / "clouds.csv"
    path.write_text("time,file\n0,a.ply\n")
    with pytest.raises(RecordingError, match="no name of a file beside it"):
        read_cloud_times(path)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulated trial in which a depth camera sees the milk jug, which has no markers."""
    folder = tmp_path_factory.mktemp("live") / "session"
    simulate_session(folder, subjects=1, trials=1, seed=3, objects=["jug"], kinds=["handle"])
    (true,) = load_truth(folder).trials.values()
    manifest = yaml.safe_load((folder / "session.yaml").read_text())
    del manifest["objects"]["jug"]["markers"]
    manifest["trials"][0]["clouds"] = "clouds/clouds.csv"
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
    (folder / "clouds").mkdir()
    jug = sample_cloud(load_surface(folder / "objects/jug.stl", 0.001))
    rng, rows = np.random.default_rng(0), []
    rotations = Rotation.from_quat(true.object_rotation, scalar_first=True).as_matrix()
    for frame in range(0, len(true.times), 12):  # 10 clouds a second
        turn, shift = rotations[frame], true.object_position[frame]
        seen = (jug.normals @ turn.T) @ np.array([0.6, -0.6, 0.5]) > 0.1
        points = jug.points[seen] @ turn.T + shift + 0.001 * rng.normal(size=(int(seen.sum()), 3))
        write_cloud(folder / f"clouds/{frame}.ply", 1000 * points)
        rows.append((float(true.times[frame]), f"{frame}.ply"))
    write_list(folder / "clouds", rows)
    return folder


def test_a_grasp_of_an_object_without_markers(session: Path) -> None:
    report = ingest(session, session.parent / "db")
    assert not report.rejected
    (true,) = load_truth(session).trials.values()
    with graspdb.open(session.parent / "db") as database:
        frames = database.sql(
            "SELECT object_position, object_quaternion, object_fitness FROM frames ORDER BY frame"
        ).rows()
        grasps = database.sql("SELECT contact_sites FROM grasps").rows()
    known = [i for i, row in enumerate(frames) if row[0] is not None]
    assert len(known) > 0.9 * len(true.times)
    positions = np.array([frames[i][0] for i in known])
    turns = Rotation.from_quat([frames[i][1] for i in known], scalar_first=True)
    error = np.linalg.norm(positions - true.object_position[known], axis=1)
    angle = (turns * Rotation.from_quat(true.object_rotation[known], scalar_first=True).inv()).magnitude()
    print(f"\n{1e3 * np.median(error):.2f} mm, {np.degrees(np.median(angle)):.2f} degrees (medians)")
    assert np.median(error) < 0.002
    assert np.degrees(np.median(angle)) < 1.5
    assert min(frames[i][2] for i in known) > 0.5
    assert len(grasps) == 1
    assert set(true.contacts) & set(grasps[0][0])


def test_an_object_without_markers_needs_clouds(session: Path) -> None:
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    del manifest["trials"][0]["clouds"]
    (session / "other.yaml").write_text(yaml.safe_dump(manifest))
    with pytest.raises(ManifestError, match="which has no markers"):
        parse_manifest(session / "other.yaml")
