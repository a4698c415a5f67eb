"""ContactPose in its documented layout: what was written is read again, in metres and the world's frame."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from posed_hands import postures
from scipy.spatial.transform import Rotation

from graspdb_ingest.importers import contactpose
from graspdb_ingest.importers.base import ClipSource, ImportOptions
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.vocabulary import Side

N = 5
PERIOD = 0.033
DROPPED = (0, 1, 2, 5, 6)
"""Places of the recorded frames on the cameras' clock: two were lost."""
OPTIONS = ImportOptions()


def pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    return matrix


def written(matrix: np.ndarray) -> dict[str, list[float]]:
    quaternion = Rotation.from_matrix(matrix[:3, :3]).as_quat(scalar_first=True)
    return {"rotation": quaternion.tolist(), "translation": matrix[:3, 3].tolist()}


class Grasp:
    """A grasp of both hands: the left one still in the object, the right one moving; and its files."""

    def __init__(self, root: Path) -> None:
        self.world_from_object = [pose(i) for i in range(N)]
        self.object_from_hand = [pose(100 + i) for i in range(N)]
        self.left, self.right = postures(Side.LEFT, 1)[0], postures(Side.RIGHT, 1)[0]
        self.folder = root / "full7_handoff" / "mug"
        self.folder.mkdir(parents=True)
        self.write()

    def write(self, **changes: object) -> None:
        """Write the annotations, with some of their entries changed."""
        hands = [
            {"valid": True, "moving": False, "joints": self.left.tolist()},
            {"valid": True, "moving": True, "joints": self.right.tolist()},
        ]
        frames = []
        for i, place in enumerate(DROPPED):
            hand_from_object = np.linalg.inv(self.object_from_hand[i])
            frames.append(
                {
                    "oTw": written(np.linalg.inv(self.world_from_object[i])),
                    "hTo": [written(np.eye(4)), written(hand_from_object)],
                    "object_pose_optimized": True,
                    "time": {
                        f"kinect2_{camera}": {"sec": 100, "nsec": int(1e9 * (place * PERIOD + shift))}
                        for camera, shift in (("left", 0.001), ("middle", 0.0), ("right", 0.002))
                    },
                }
            )
        whole = {"cameras": {}, "frames": frames, "hands": hands, "object": "mug", "participant": 7}
        (self.folder / "annotations.json").write_text(json.dumps({**whole, **changes}))

    def contact_map(self) -> np.ndarray:
        """Write the contact map beside it, and return the heat of its vertices."""
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
        heat = np.clip(mesh.vertices[:, 2] / 0.04, 0, 1)
        colours = np.repeat(np.round(255 * heat)[:, None], 4, axis=1).astype(np.uint8)
        trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colours, process=False).export(
            self.folder / "mug.ply"
        )
        return heat


@pytest.fixture
def grasp(tmp_path: Path) -> Grasp:
    return Grasp(tmp_path)


def only(path: Path, options: ImportOptions = OPTIONS) -> ClipSource:
    sources = list(contactpose.find(path, options))
    assert len(sources) == 1
    return sources[0]


@pytest.mark.parametrize("depth", range(3))
def test_it_is_found_from_any_of_its_folders(tmp_path: Path, grasp: Grasp, depth: int) -> None:
    path = (grasp.folder, grasp.folder.parent, tmp_path)[depth]
    source = only(path)
    assert (source.name, source.subject) == ("full7_handoff_mug", "7")
    assert contactpose.recognises(path)


def test_hands_and_object_are_where_they_were(tmp_path: Path, grasp: Grasp) -> None:
    clip = contactpose.read(only(tmp_path), OPTIONS)
    assert clip.rate == pytest.approx(1 / PERIOD)
    assert clip.n_frames == DROPPED[-1] + 1
    assert clip.task == "handoff"
    left, right = (hand.key_points for hand in clip.hands)
    assert clip.poses is not None
    for i, place in enumerate(DROPPED):
        world = grasp.world_from_object[i]
        np.testing.assert_allclose(clip.poses[place], world, atol=1e-9)
        np.testing.assert_allclose(left[place], grasp.left @ world[:3, :3].T + world[:3, 3], atol=1e-9)
        moved = world @ grasp.object_from_hand[i]
        np.testing.assert_allclose(right[place], grasp.right @ moved[:3, :3].T + moved[:3, 3], atol=1e-9)
    assert np.isnan(left[[3, 4]]).all()
    assert np.isnan(clip.poses[[3, 4], :3]).all()


def test_heat_is_measured_contact_and_its_mesh_the_object(tmp_path: Path, grasp: Grasp) -> None:
    heat = grasp.contact_map()
    source = only(tmp_path)
    assert source.object is not None
    assert source.object.file == grasp.folder / "mug.ply"
    measured = contactpose.read(source, OPTIONS).measured
    assert measured is not None
    assert measured.kind == "thermal"
    np.testing.assert_allclose(measured.contact, heat, atol=0.5 / 255 + 1e-9)
    assert np.linalg.norm(measured.positions, axis=1) == pytest.approx(0.04, abs=1e-6)


def test_models_of_their_own_folder_come_first(tmp_path: Path, grasp: Grasp) -> None:
    grasp.contact_map()
    (tmp_path / "object_models").mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "object_models" / "mug.ply")
    source = only(tmp_path)
    assert source.object is not None
    assert source.object.file.parent.name == "object_models"


def test_without_a_mesh_there_are_postures_and_a_note(tmp_path: Path, grasp: Grasp) -> None:
    assert grasp.folder.is_dir()
    source = only(tmp_path)
    assert source.object is None
    (note,) = contactpose.read(source, OPTIONS).notes
    assert "no mesh of object 'mug'" in note
    assert "--objects" in note


def test_a_hand_that_is_not_valid_is_left_out(tmp_path: Path, grasp: Grasp) -> None:
    right = {"valid": True, "moving": False, "joints": grasp.right.tolist()}
    grasp.write(hands=[{"valid": False}, right], frames=[])
    clip = contactpose.read(only(tmp_path), OPTIONS)
    assert [hand.side for hand in clip.hands] == [Side.RIGHT]
    np.testing.assert_allclose(clip.hands[0].key_points[0], grasp.right)
    assert (clip.rate, clip.n_frames) == (None, 1)
    grasp.write(hands=[{"valid": False}, {"valid": False}])
    with pytest.raises(ImportSourceError, match="no hand in it is valid"):
        contactpose.read(only(tmp_path), OPTIONS)


@pytest.mark.parametrize("cut", [0, 1, 200, -30])
def test_half_a_file_is_named(tmp_path: Path, grasp: Grasp, cut: int) -> None:
    file = grasp.folder / "annotations.json"
    file.write_bytes(file.read_bytes()[:cut])
    with pytest.raises(ImportSourceError, match=r"annotations.json: .*Download it again"):
        contactpose.read(only(tmp_path), OPTIONS)


def test_half_a_contact_map_is_named(tmp_path: Path, grasp: Grasp) -> None:
    grasp.contact_map()
    file = grasp.folder / "mug.ply"
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(ImportSourceError, match="not a contact map"):
        contactpose.read(only(tmp_path), OPTIONS)


def test_another_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ImportSourceError, match="no annotations of ContactPose"):
        list(contactpose.find(tmp_path, OPTIONS))
    assert not contactpose.recognises(tmp_path)
