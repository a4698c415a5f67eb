"""Surfaces from files: closed forms, every format, and everything that can be wrong with a mesh."""

import hashlib
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from graspdb_ingest.objects.mesh import Surface, load_surface
from graspdb_schemas.errors import ObjectError, ParameterError

FORMATS = ["stl", "obj", "ply", "glb", "off"]


def write(mesh: trimesh.Trimesh | trimesh.Scene, path: Path) -> Path:
    mesh.export(path)
    return path


def box(size: tuple[float, float, float] = (0.04, 0.06, 0.1)) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


def outward_flow(surface: Surface) -> float:
    """Return three times the volume that the faces enclose, negative for an inside-out mesh."""
    assert surface.faces is not None
    a, b, c = surface.vertices[surface.faces].transpose(1, 0, 2)
    return float(np.sum(np.cross(b - a, c - a) / 2 * (a + b + c) / 3))


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_a_box_has_its_area_volume_and_extents_in_every_format(
    tmp_path: Path, suffix: str, scale: float
) -> None:
    mesh = box()
    mesh.apply_scale(1 / scale)
    path = write(mesh, tmp_path / f"box.{suffix}")
    surface = load_surface(path, scale)
    assert surface.area == pytest.approx(2 * (0.04 * 0.06 + 0.06 * 0.1 + 0.1 * 0.04), rel=1e-6)
    assert surface.volume == pytest.approx(0.04 * 0.06 * 0.1, rel=1e-6)
    assert surface.extents == pytest.approx([0.04, 0.06, 0.1], rel=1e-6)
    assert surface.watertight
    assert surface.warnings == ()
    assert surface.vertices.shape == (8, 3)
    assert surface.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_cylinder_and_sphere_approach_their_formulas_from_below(tmp_path: Path) -> None:
    cylinder = load_surface(write(trimesh.creation.cylinder(0.03, 0.12, sections=200), tmp_path / "c.stl"))
    assert cylinder.volume is not None
    assert cylinder.area is not None
    assert 0.999 < cylinder.volume / (np.pi * 0.03**2 * 0.12) < 1
    assert 0.999 < cylinder.area / (2 * np.pi * 0.03 * (0.03 + 0.12)) < 1
    sphere = load_surface(write(trimesh.creation.icosphere(4, 0.05), tmp_path / "s.ply"))
    assert sphere.volume is not None
    assert 0.99 < sphere.volume / (4 / 3 * np.pi * 0.05**3) < 1


def test_a_scene_is_flattened_with_its_transforms_and_mirrors(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scale = np.diag([0.001, 0.001, 0.001, 1.0])
    mirrored = scale @ np.diag([-1.0, 1, 1, 1])
    mirrored[:3, 3] = [0.2, 0, 0]
    mesh = box((40, 60, 100))
    scene.add_geometry(mesh, node_name="a", geom_name="box", transform=scale)
    scene.add_geometry(mesh, node_name="b", geom_name="box", transform=mirrored)
    surface = load_surface(write(scene, tmp_path / "two.glb"))
    assert surface.extents == pytest.approx([0.24, 0.06, 0.1], rel=1e-5)
    assert surface.volume == pytest.approx(2 * 0.04 * 0.06 * 0.1, rel=1e-5)
    assert [warning[:33] for warning in surface.warnings] == ["1 piece up to 160 mm from the res"]


def test_textures_and_materials_do_not_matter(tmp_path: Path) -> None:
    plain = write(box(), tmp_path / "plain.obj").read_text()
    path = tmp_path / "textured.obj"
    path.write_text("mtllib ../not/there.mtl\nusemtl skin\nvt 0 0\n" + plain)
    surface = load_surface(path)
    assert surface.volume == pytest.approx(0.04 * 0.06 * 0.1)
    assert surface.warnings == ()


def test_a_texture_that_is_missing_from_a_glb_does_not_matter(tmp_path: Path) -> None:
    content = write(box(), tmp_path / "box.glb").read_bytes()
    length = struct.unpack("<I", content[12:16])[0]
    tree = json.loads(content[20 : 20 + length])
    tree["images"] = [{"uri": "not-there.png"}]
    tree["textures"] = [{"source": 0}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + content[20 + length :]
    path = tmp_path / "textured.glb"
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body)
    assert load_surface(path).volume == pytest.approx(0.04 * 0.06 * 0.1, rel=1e-6)


def test_an_open_mesh_is_loaded_with_a_warning_and_no_volume(tmp_path: Path) -> None:
    mesh = box()
    mesh.update_faces(np.arange(len(mesh.faces)) >= 2)
    surface = load_surface(write(mesh, tmp_path / "open.stl"))
    assert not surface.watertight
    assert surface.volume is None
    assert any("not watertight" in warning for warning in surface.warnings)


def test_an_inside_out_mesh_is_turned_outward(tmp_path: Path) -> None:
    mesh = box()
    mesh.invert()
    surface = load_surface(write(mesh, tmp_path / "inverted.ply"))
    assert surface.volume == pytest.approx(0.04 * 0.06 * 0.1)
    assert outward_flow(surface) > 0
    assert surface.warnings == ("all faces inside out: turned outward",)


def test_an_open_mesh_inside_out_is_turned_outward_too(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(3, 0.05)
    mesh.update_faces(mesh.triangles_center[:, 2] > -0.03)
    mesh.invert()
    surface = load_surface(write(mesh, tmp_path / "bowl.stl"))
    assert outward_flow(surface) > 0
    assert any("inside out" in warning for warning in surface.warnings)


def test_a_cavity_keeps_its_wall_and_a_stray_part_is_turned(tmp_path: Path) -> None:
    cavity = box((0.02, 0.02, 0.02))
    cavity.invert()
    hollow = trimesh.util.concatenate([box((0.05, 0.05, 0.05)), cavity])
    surface = load_surface(write(hollow, tmp_path / "hollow.stl"))
    assert surface.volume == pytest.approx(0.05**3 - 0.02**3)
    assert surface.warnings == ()
    aside = cavity.copy()
    aside.apply_translation([0.1, 0, 0])
    surface = load_surface(write(trimesh.util.concatenate([box((0.05,) * 3), aside]), tmp_path / "two.stl"))
    assert surface.volume == pytest.approx(0.05**3 + 0.02**3)
    assert surface.warnings[0] == "12 faces inside out: turned outward"
    assert surface.warnings[1].startswith("1 piece up to 65 mm from the rest, with 13.8% of the area")


def test_parts_that_meet_or_lie_in_each_other_are_no_stray_pieces(tmp_path: Path) -> None:
    lid = box((0.05, 0.05, 0.01))
    lid.apply_translation([0, 0, 0.032])  # 2 mm above the box
    whole = trimesh.util.concatenate([box((0.05,) * 3), lid])
    assert load_surface(write(whole, tmp_path / "lid.stl")).warnings == ()
    crumb = box((0.004,) * 3)
    crumb.apply_translation([0.2, 0, 0])
    (warning,) = load_surface(write(trimesh.util.concatenate([whole, crumb]), tmp_path / "c.stl")).warnings
    assert (
        warning == "1 piece up to 173 mm from the rest, with 0.4% of the area: taken for parts of the object"
    )


@pytest.mark.parametrize("seed", range(5))
def test_faces_turned_at_random_are_turned_back(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = trimesh.util.concatenate([trimesh.creation.torus(0.05, 0.02), box((0.01, 0.01, 0.01))])
    faces = np.array(mesh.faces)
    turned = rng.random(len(faces)) < rng.uniform(0.05, 0.95)
    faces[turned] = faces[turned, ::-1]
    expected = mesh.volume
    surface = load_surface(write(trimesh.Trimesh(mesh.vertices, faces, process=False), tmp_path / "m.ply"))
    assert surface.watertight
    assert surface.volume == pytest.approx(expected, rel=1e-6)
    assert any("turned to agree" in warning for warning in surface.warnings)


def test_doubled_and_degenerate_faces_add_nothing(tmp_path: Path) -> None:
    mesh = box()
    extra = [mesh.faces[0], mesh.faces[3][::-1], [0, 0, 1], [2, 3, 3]]
    broken = trimesh.Trimesh(mesh.vertices, np.vstack([mesh.faces, extra]), process=False)
    surface = load_surface(write(broken, tmp_path / "doubled.off"))
    assert surface.area == pytest.approx(box().area)
    assert surface.watertight
    assert surface.warnings == ("2 faces without area", "2 faces doubled: left out")


def test_vertices_apart_by_rounding_are_one(tmp_path: Path) -> None:
    mesh = box()
    soup = mesh.triangles.reshape(-1, 3) + np.random.default_rng(0).uniform(-1e-7, 1e-7, (36, 3))
    surface = load_surface(
        write(trimesh.Trimesh(soup, np.arange(36).reshape(-1, 3), process=False), tmp_path / "b.ply")
    )
    assert surface.watertight
    assert len(surface.vertices) == 8


@pytest.mark.parametrize(
    ("size", "scale", "words"),
    [
        (100.0, 1.0, r"100 m.*mesh_units mm \(0\.1 m\)"),
        (10.0, 1.0, r"10 m.*cm \(0\.1 m\) or mm \(0\.01 m\)"),
        (0.1, 0.001, r"0\.0001 m.*mesh_units m \(0\.1 m\)"),
        (1e-9, 1.0, r"1e-09 m.*Check mesh_units"),
    ],
)
def test_a_wrong_unit_is_an_error_that_names_the_right_one(
    tmp_path: Path, size: float, scale: float, words: str
) -> None:
    path = write(box((size, size, size)), tmp_path / "box.ply")
    with pytest.raises(ObjectError, match=words):
        load_surface(path, scale)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("content", [b"", b"\x00\xff not a mesh \x01", b"solid\nfacet normal"])
def test_files_that_are_no_meshes_are_errors_that_name_the_file(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    path = tmp_path / f"broken.{suffix}"
    path.write_bytes(content)
    with pytest.raises(ObjectError, match=f"broken.{suffix}"):
        load_surface(path)


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_truncated_file_is_an_error(tmp_path: Path, suffix: str) -> None:
    content = write(trimesh.creation.icosphere(2, 0.05), tmp_path / f"whole.{suffix}").read_bytes()
    path = tmp_path / f"half.{suffix}"
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(ObjectError, match=f"half.{suffix}"):
        load_surface(path)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("points.obj", "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n", "no faces"),
        ("points.off", "OFF\n3 0 0\n0 0 0\n0.1 0 0\n0 0.1 0\n", "no faces"),
        ("nan.obj", "v 0 0 nan\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n", "1 of its 3 vertices are not finite"),
        ("line.obj", "v 0 0 0\nv 0.1 0 0\nv 0.2 0 0\nf 1 2 3\n", "no area"),
        ("index.off", "OFF\n3 1 0\n0 0 0\n0.1 0 0\n0 0.1 0\n3 0 1 7\n", "index.off"),
        ("mesh.step", "anything", "unknown format '.step'.*.stl"),
        ("mesh", "anything", "no ending"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, content: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ObjectError, match=words):
        load_surface(path)


def test_a_missing_file_and_a_folder_are_errors(tmp_path: Path) -> None:
    with pytest.raises(ObjectError, match="No such file"):
        load_surface(tmp_path / "nothing.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(ObjectError, match="directory"):
        load_surface(tmp_path / "folder.stl")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_a_scale_that_is_no_factor_is_an_error(tmp_path: Path, scale: float) -> None:
    with pytest.raises(ParameterError, match="scale"):
        load_surface(tmp_path / "box.stl", scale)


def ply_cloud(points: np.ndarray, normals: np.ndarray | None = None) -> str:
    names = ["x", "y", "z"] + ([] if normals is None else ["nx", "ny", "nz"])
    rows = points if normals is None else np.hstack([points, normals])
    header = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    header += [f"property double {name}" for name in names] + ["end_header"]
    return "\n".join(header + [" ".join(map(repr, map(float, row))) for row in rows]) + "\n"


def pcd_cloud(points: np.ndarray) -> str:
    n = len(points)
    header = ["VERSION 0.7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", f"WIDTH {n}"]
    header += ["HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {n}", "DATA ascii"]
    return "\n".join(header + [" ".join(f"{x:.6g}" for x in row) for row in points]) + "\n"


def test_clouds_are_read_with_scale_and_normals(tmp_path: Path) -> None:
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    (tmp_path / "cloud.ply").write_text(ply_cloud(50 * directions, 3 * directions))
    surface = load_surface(tmp_path / "cloud.ply", 0.001)
    assert surface.faces is None
    assert surface.area is None
    assert surface.volume is None
    assert not surface.watertight
    assert surface.vertices == pytest.approx(0.05 * directions)
    assert surface.normals == pytest.approx(directions)
    (tmp_path / "cloud.pcd").write_text(pcd_cloud(0.05 * directions))
    surface = load_surface(tmp_path / "cloud.pcd")
    assert surface.normals is None
    assert surface.vertices == pytest.approx(0.05 * directions, abs=1e-6)


def test_normals_of_a_cloud_that_point_inward_are_turned(tmp_path: Path) -> None:
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    (tmp_path / "cloud.ply").write_text(ply_cloud(0.05 * directions, -directions))
    surface = load_surface(tmp_path / "cloud.ply")
    assert surface.normals == pytest.approx(directions)
    assert "all normals inside out: turned outward" in surface.warnings


def test_normals_of_a_flat_scan_are_left_as_they_are(tmp_path: Path) -> None:
    points = np.random.default_rng(1).uniform(0, 0.1, (200, 3)) * [1, 1, 0]
    (tmp_path / "cloud.ply").write_text(ply_cloud(points, np.tile([0.0, 0, -1], (200, 1))))
    surface = load_surface(tmp_path / "cloud.ply")
    assert surface.normals == pytest.approx(np.tile([0.0, 0, -1], (200, 1)))


def test_points_that_are_not_finite_are_left_out_of_a_cloud(tmp_path: Path) -> None:
    points = np.random.default_rng(2).uniform(0, 0.1, (50, 3))
    points[::10, 1] = np.nan
    (tmp_path / "cloud.pcd").write_text(pcd_cloud(points))
    surface = load_surface(tmp_path / "cloud.pcd")
    assert len(surface.vertices) == 45
    assert any("5 of 50 points not finite" in warning for warning in surface.warnings)


NO_POINTS = pcd_cloud(np.full((9, 3), np.nan))


@pytest.mark.parametrize(
    "content",
    ["", "VERSION 0.7\nFIELDS x y z\n", NO_POINTS, NO_POINTS.replace("POINTS 9", "POINTS 999999999")],
)
def test_clouds_without_points_are_errors(tmp_path: Path, content: str) -> None:
    path = tmp_path / "cloud.pcd"
    path.write_text(content)
    with pytest.raises(ObjectError, match=r"cloud.pcd"):
        load_surface(path)


def test_a_cloud_in_the_wrong_unit_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "cloud.ply").write_text(ply_cloud(np.random.default_rng(3).uniform(0, 90, (50, 3))))
    with pytest.raises(ObjectError, match="mesh_units mm"):
        load_surface(tmp_path / "cloud.ply")
