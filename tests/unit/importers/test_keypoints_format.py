"""Key points in NPZ, CSV and Parquet: the same hands in each of them, and bad files named."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
import trimesh
from posed_hands import postures
from scipy.spatial.transform import Rotation

from graspdb_ingest.importers import keypoints
from graspdb_ingest.importers.base import Clip, ImportOptions
from graspdb_ingest.importers.order import ORDERS, key_point_names
from graspdb_schemas.errors import GraspDBError, ImportSourceError, ParameterError
from graspdb_schemas.vocabulary import KEY_POINTS, Side

N = 6
RIGHT, LEFT = postures(Side.RIGHT, N), postures(Side.LEFT, N, seed=1)
ROTATIONS = Rotation.random(N, rng=np.random.default_rng(2))
POSES = np.tile(np.eye(4), (N, 1, 1))
POSES[:, :3, :3], POSES[:, :3, 3] = ROTATIONS.as_matrix(), RIGHT[:, 0] + 0.05
RATE = 50.0


def mesh(folder: Path, name: str = "mug") -> Path:
    path = folder / f"{name}.obj"
    trimesh.creation.box((0.06, 0.06, 0.1)).export(path)
    return path


def table(scale: float = 1.0, unit: str = "", order: np.ndarray | None = None) -> pa.Table:
    """Return both hands and the object's pose in each frame, as columns."""
    rows = []
    for side, points in (("right", RIGHT), ("left", LEFT)):
        for i in range(N):
            row = {
                "side": side,
                "time": i / RATE,
                "object": "mug",
                "subject": "ada",
                "clip": "lift",
                "task": "t",
            }
            for name, place in zip(KEY_POINTS, points[i], strict=True):
                row |= {f"{name}_{axis}{unit}": scale * v for axis, v in zip("xyz", place, strict=True)}
            row |= dict(zip(("object_x", "object_y", "object_z"), scale * POSES[i, :3, 3], strict=True))
            quaternion = ROTATIONS[i].as_quat(scalar_first=True)
            row |= {f"object_q{axis}": v for axis, v in zip("wxyz", quaternion, strict=True)}
            rows.append(row)
    found = pa.Table.from_pylist(rows)
    return found if order is None else found.take(pa.array(order))


def write(path: Path, scale: float = 1.0, unit: str = "") -> Path:
    """Write the same two hands with an object in any of the three forms."""
    mesh(path.parent)
    if path.suffix == ".npz":
        poses = POSES.copy()
        poses[:, :3, 3] *= scale
        np.savez(
            path,
            **{f"mug.right_key_points{unit}": scale * RIGHT, f"mug.left_key_points{unit}": scale * LEFT},
            poses=poses,
            rate=RATE,
            subject="ada",
            task="t",
        )
    elif path.suffix == ".csv":
        pyarrow.csv.write_csv(table(scale, unit, np.random.default_rng(0).permutation(2 * N)), path)
    else:
        pyarrow.parquet.write_table(table(scale, unit), path)
    return path


def only(path: Path, options: ImportOptions | None = None) -> Clip:
    options = options or ImportOptions()
    sources = list(keypoints.find(path, options))
    assert len(sources) == 1
    return keypoints.read(sources[0], options)


@pytest.mark.parametrize("ending", keypoints.ENDINGS)
@pytest.mark.parametrize(("scale", "unit"), [(1.0, ""), (1000.0, "_mm"), (10.0, "_dm")])
def test_every_form_brings_the_same_clip(tmp_path: Path, ending: str, scale: float, unit: str) -> None:
    path = write(tmp_path / f"hands{ending}", scale, unit)
    source = next(iter(keypoints.find(path, ImportOptions())))
    assert (source.subject, source.object.name if source.object else None) == ("ada", "mug")
    clip = only(path)
    points = {hand.side: hand.key_points for hand in clip.hands}
    np.testing.assert_allclose(points[Side.RIGHT], RIGHT, atol=1e-9)
    np.testing.assert_allclose(points[Side.LEFT], LEFT, atol=1e-9)
    assert clip.poses is not None
    np.testing.assert_allclose(clip.poses, POSES, atol=1e-9)
    assert clip.rate == pytest.approx(RATE)
    assert clip.task == "t"
    assert keypoints.recognises(path)
    assert keypoints.recognises(tmp_path)


def test_units_may_be_declared_once_alone(tmp_path: Path) -> None:
    path = write(tmp_path / "hands.npz", 1000.0)
    clip = only(path, ImportOptions(units="mm"))
    np.testing.assert_allclose(clip.hands[0].key_points, RIGHT, atol=1e-9)
    with pytest.raises(ParameterError, match="units"):
        only(path, ImportOptions(units="inch"))


@pytest.mark.parametrize("order", ["mano", ",".join(reversed(ORDERS["usual"]))])
def test_any_order(tmp_path: Path, order: str) -> None:
    places = [KEY_POINTS.index(name) for name in key_point_names(order)]
    np.savez(tmp_path / "hands.npz", key_points=RIGHT[:, places], side="right")
    clip = only(tmp_path / "hands.npz", ImportOptions(order=order))
    np.testing.assert_array_equal(clip.hands[0].key_points, RIGHT)
    np.savez(tmp_path / "hands.npz", key_points=RIGHT[:, places], side="right", order=order)
    np.testing.assert_array_equal(only(tmp_path / "hands.npz").hands[0].key_points, RIGHT)


def test_long_static_sets_come_in_parts(tmp_path: Path) -> None:
    n = 2 * keypoints.POSTURES_PER_CLIP + 1
    several = np.resize(RIGHT, (n, 21, 3))
    np.savez(tmp_path / "hands.npz", key_points=several, identifiers=[f"image {i}" for i in range(n)])
    options = ImportOptions(side=Side.RIGHT)
    sources = list(keypoints.find(tmp_path, options))
    clips = [keypoints.read(source, options) for source in sources]
    assert [clip.n_frames for clip in clips] == [keypoints.POSTURES_PER_CLIP] * 2 + [1]
    assert len({source.name for source in sources}) == 3
    together = np.concatenate([clip.hands[0].key_points for clip in clips])
    np.testing.assert_array_equal(together, several)
    assert clips[2].attributes["identifiers"] == [f"image {n - 1}"]
    assert clips[0].rate is None


def test_no_pickle_is_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "hands.npz", key_points=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ImportSourceError, match="objects are not read"):
        list(keypoints.find(tmp_path, ImportOptions()))


@pytest.mark.parametrize("ending", [".npz", ".parquet"])
def test_half_a_file_is_named(tmp_path: Path, ending: str) -> None:
    path = write(tmp_path / f"hands{ending}")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ImportSourceError, match=f"hands{ending}.*again"):
        list(keypoints.find(path, ImportOptions()))


def test_a_missing_mesh_is_named_with_what_there_is(tmp_path: Path) -> None:
    path = write(tmp_path / "hands.npz")
    (tmp_path / "mug.obj").rename(tmp_path / "mugg.obj")
    with pytest.raises(ImportSourceError, match="no mesh of object 'mug'; there is mugg; did you mean"):
        list(keypoints.find(path, ImportOptions()))
    (tmp_path / "models").mkdir()
    mesh(tmp_path / "models")
    assert only(path, ImportOptions(objects=tmp_path / "models"))
    assert only(path, ImportOptions(objects=tmp_path))
    with pytest.raises(ImportSourceError, match="no such folder"):
        list(keypoints.find(path, ImportOptions(objects=tmp_path / "nowhere")))


def broken(tmp_path: Path, **arrays: object) -> Path:
    path = tmp_path / "hands.npz"
    np.savez(path, **{"key_points": RIGHT, "side": "right", **arrays})
    return path


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"key_points": RIGHT[:, :20]}, r"key_points of shape \(6, 20, 3\)"),
        ({"side": "both"}, "side 'both'"),
        ({"poses": POSES[:3]}, r"poses of shape \(3, 4, 4\) for 6 frames"),
        ({"identifiers": ["a"]}, "1 identifiers for 6 frames"),
        ({"rate": [1.0, 2.0]}, "rate of shape"),
        ({"left_key_points": LEFT}, "do not belong together"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, arrays: dict[str, object], said: str) -> None:
    with pytest.raises(GraspDBError, match=said):
        only(broken(tmp_path, **arrays))


def test_hands_in_two_units_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "hands.npz", right_joints_mm=1000 * RIGHT, left_joints_m=LEFT)
    with pytest.raises(ImportSourceError, match="different units"):
        list(keypoints.find(tmp_path, ImportOptions()))


def test_an_unknown_side_is_asked_for(tmp_path: Path) -> None:
    np.savez(tmp_path / "hands.npz", key_points=RIGHT)
    with pytest.raises(ParameterError, match="--side"):
        only(tmp_path / "hands.npz")


def without(name: str) -> pa.Table:
    return table().drop_columns([name])


def with_times(times: list[float]) -> pa.Table:
    found = table().slice(0, N)
    return found.set_column(found.column_names.index("time"), "time", pa.array(times))


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (without("ring_dip_y"), "no column ring_dip_y"),
        (without("object_qz"), "a pose without column object_qz"),
        (table().slice(0, 0), "no rows"),
        (with_times([0.0, 0.02, 0.04, 0.06, 0.08, 0.5]), "gap of 0.42 s"),
        (with_times([0.0, 0.02, 0.04, 0.067, 0.08, 0.1]), "not evenly spaced"),
        (with_times([0.0, 0.02, 0.04, 0.04, 0.06, 0.08]), "two rows of one hand and frame"),
    ],
)
def test_tables_that_do_not_fit_are_named(tmp_path: Path, found: pa.Table, said: str) -> None:
    mesh(tmp_path)
    pyarrow.parquet.write_table(found, tmp_path / "hands.parquet")
    with pytest.raises(ImportSourceError, match=said):
        list(keypoints.find(tmp_path / "hands.parquet", ImportOptions()))


def test_missing_coordinates_are_frames_without_the_hand(tmp_path: Path) -> None:
    found = table()
    column = found.column_names.index("wrist_x")
    values = [None if i == 2 else v for i, v in enumerate(found["wrist_x"].to_pylist())]
    pyarrow.csv.write_csv(found.set_column(column, "wrist_x", pa.array(values)), tmp_path / "hands.csv")
    mesh(tmp_path)
    clip = only(tmp_path / "hands.csv")
    assert np.isnan(clip.hands[0].key_points[2, 0, 0])
    assert np.isnan(clip.hands[0].key_points).sum() == 1
