"""Meshes of real objects load, and what is wrong with them is known."""

from pathlib import Path

import pytest

from graspdb_ingest.objects.mesh import load_surface

PROBLEMS = {
    "bowl": ("not watertight: no volume",),
    "phone": ("not watertight: no volume",),
    "waterbottle": ("68 faces without area",),
}


def test_sixteen_objects_load(shared_data: Path) -> None:
    surfaces = {
        path.stem: load_surface(path) for path in sorted((shared_data / "object-meshes").glob("*.stl"))
    }
    assert len(surfaces) == 16
    assert {name: s.warnings for name, s in surfaces.items() if s.warnings} == PROBLEMS
    assert all(0.03 < s.extents.max() < 0.3 for s in surfaces.values())


def test_objects_whose_names_say_their_shape_have_its_volume(shared_data: Path) -> None:
    cube = load_surface(shared_data / "object-meshes" / "cubemedium.stl")
    assert cube.volume == pytest.approx(cube.extents.prod(), rel=0.001)
    pillow = load_surface(shared_data / "pillow-recording" / "pillow_small.stl")
    assert pillow.extents == pytest.approx([0.336, 0.358, 0.090], abs=0.001)
    assert pillow.watertight


def test_a_mesh_with_texture_and_node_scale_is_one_closed_body_in_metres(shared_data: Path) -> None:
    camera = load_surface(shared_data / "contactpose-camera" / "camera.glb")
    assert camera.vertices.shape == (3497, 3)
    assert camera.watertight
    assert camera.warnings == ()
    assert camera.extents == pytest.approx([0.115, 0.047, 0.067], abs=0.001)


@pytest.mark.parametrize("name", ["cup1", "mug1", "wineglass3"])
def test_decimetres_declared_give_objects_of_the_right_size(shared_data: Path, name: str) -> None:
    surface = load_surface(shared_data / "manipnet" / name / f"{name}.obj", 0.1)
    assert 0.1 < surface.extents.max() < 0.15
