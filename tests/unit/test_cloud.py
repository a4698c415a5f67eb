"""Clouds: as even as they say, as large as the surface, the same for the same seed."""

import time

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.scatter import thin
from graspdb_ingest.parameters import CloudParameters
from graspdb_schemas.errors import ParameterError


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return Surface(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces),
        normals=None,
        area=float(mesh.area),
        volume=None,
        extents=np.array(mesh.extents),
        watertight=bool(mesh.is_watertight),
        sha256="",
        warnings=(),
    )


def bare(points: np.ndarray, normals: np.ndarray | None = None) -> Surface:
    return Surface(points, None, normals, None, None, np.ptp(points, axis=0), False, "", ())


def neighbour_distances(cloud: ObjectCloud) -> np.ndarray:
    return cKDTree(cloud.points).query(cloud.points, k=2)[0][:, 1]


def sheet(size: float = 0.08) -> trimesh.Trimesh:
    corners = np.array([[0, 0, 0], [size, 0, 0], [size, size, 0], [0, size, 0]])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


SHAPES = {
    "box": trimesh.creation.box((0.05, 0.07, 0.1)),
    "sphere": trimesh.creation.icosphere(4, 0.05),
    "cylinder": trimesh.creation.cylinder(0.03, 0.12),
    "torus": trimesh.creation.torus(0.05, 0.015, major_sections=64, minor_sections=48),
    "sheet": sheet(),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("spacing", [0.002, 0.004])
def test_neighbours_are_the_spacing_apart(shape: str, spacing: float) -> None:
    cloud = sample_cloud(surface_of(SHAPES[shape]), CloudParameters(spacing=spacing))
    distances = neighbour_distances(cloud) / spacing
    assert distances.mean() == pytest.approx(1.0, abs=0.04)
    assert (distances < 0.9 - 1e-4).mean() < 0.002  # only across edges sharper than 60 degrees
    assert np.percentile(distances, 95) < 1.25
    assert cloud.spacing == spacing


@pytest.mark.parametrize("shape", SHAPES)
def test_no_part_of_the_surface_is_far_from_a_point(shape: str) -> None:
    cloud = sample_cloud(surface_of(SHAPES[shape]), CloudParameters(spacing=0.003))
    anywhere, _ = trimesh.sample.sample_surface(SHAPES[shape], 20_000, seed=5)
    assert cloud.tree.query(anywhere)[0].max() < 1.2 * 0.003


@pytest.mark.parametrize("shape", SHAPES)
def test_points_lie_on_the_surface_and_normals_are_its_own(shape: str) -> None:
    mesh = SHAPES[shape]
    cloud = sample_cloud(surface_of(mesh), CloudParameters(spacing=0.006))
    _, distance, face = trimesh.proximity.closest_point_naive(mesh, cloud.points)
    assert distance.max() < 5e-6  # what the library's search leaves
    assert np.median(distance) < 1e-8
    agreement = np.einsum("ij,ij->i", cloud.normals, mesh.face_normals[face])
    assert np.median(agreement) == pytest.approx(1)
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1)


@pytest.mark.parametrize("shape", SHAPES)
def test_areas_sum_to_the_area_of_the_surface(shape: str) -> None:
    cloud = sample_cloud(surface_of(SHAPES[shape]))
    assert cloud.areas.sum() == pytest.approx(SHAPES[shape].area, rel=1e-12)
    assert cloud.areas.min() > 0
    assert np.median(cloud.areas) == pytest.approx(1.35 * 0.002**2, rel=0.1)


def test_every_part_of_the_surface_has_its_share_of_the_area() -> None:
    cloud = sample_cloud(surface_of(SHAPES["box"]))
    for axis, area in ((0, 0.07 * 0.1), (1, 0.05 * 0.1), (2, 0.05 * 0.07)):
        for side in (-1, 1):
            face = cloud.normals[:, axis] * side > 0.9
            assert cloud.areas[face].sum() == pytest.approx(area, rel=0.03)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5, deadline=None)
def test_the_same_seed_gives_the_same_bits(seed: int) -> None:
    parameters = CloudParameters(spacing=0.004, seed=seed)
    first, second = (sample_cloud(surface_of(SHAPES["torus"]), parameters) for _ in range(2))
    other = sample_cloud(surface_of(SHAPES["torus"]), CloudParameters(spacing=0.004, seed=seed + 1))
    for field in ("points", "normals", "areas"):
        assert getattr(first, field).tobytes() == getattr(second, field).tobytes()
        assert getattr(first, field).tobytes() != getattr(other, field).tobytes()


def test_points_survive_storage_in_single_precision() -> None:
    cloud = sample_cloud(surface_of(SHAPES["sphere"]))
    assert np.array_equal(cloud.points.astype(np.float32).astype(np.float64), cloud.points)


@pytest.mark.parametrize("thickness", [0.0002, 0.001, 0.003])
def test_both_sides_of_a_thin_plate_get_all_their_points(thickness: float) -> None:
    cloud = sample_cloud(surface_of(trimesh.creation.box((0.08, 0.08, thickness))))
    one_sided = len(sample_cloud(surface_of(sheet())).points)
    for side in (-1, 1):
        face = cloud.normals[:, 2] * side > 0.9
        assert face.sum() == pytest.approx(one_sided, rel=0.08)  # its rim competes
        assert cloud.areas[face].sum() == pytest.approx(0.08**2, rel=0.03)
        within = cKDTree(cloud.points[face]).query(cloud.points[face], k=2)[0][:, 1]
        assert within.min() >= 0.9 * 0.002 - 1e-7


def test_a_wire_thinner_than_the_spacing_is_covered_along_its_length() -> None:
    wire = trimesh.creation.cylinder(0.0003, 0.1)
    cloud = sample_cloud(surface_of(wire))
    assert np.diff(np.sort(cloud.points[:, 2])).max() < 0.004
    assert cloud.areas.sum() == pytest.approx(wire.area)


def test_a_surface_smaller_than_the_spacing_has_points() -> None:
    cloud = sample_cloud(
        surface_of(trimesh.creation.box((0.002, 0.002, 0.002))), CloudParameters(spacing=0.01)
    )
    assert len(cloud.points) >= 1
    assert cloud.areas.sum() == pytest.approx(6 * 0.002**2)


def test_triangles_of_any_size_give_the_same_density() -> None:
    coarse = sheet()
    fine = coarse.subdivide().subdivide().subdivide().subdivide()
    counts = [len(sample_cloud(surface_of(mesh)).points) for mesh in (coarse, fine)]
    assert counts[0] == pytest.approx(counts[1], rel=0.03)


def test_a_tenth_of_a_square_metre_at_2_mm_takes_well_under_a_second() -> None:
    surface = surface_of(trimesh.creation.box((0.12, 0.13, 0.14)))
    start = time.process_time()
    cloud = sample_cloud(surface)
    assert time.process_time() - start < 1.5  # 0.4 s on one idle core
    assert len(cloud.points) > 15_000


@pytest.mark.parametrize("spacing", [0.0, -0.002, float("nan"), float("inf"), 1e-6])
def test_a_spacing_that_cannot_be_is_an_error(spacing: float) -> None:
    with pytest.raises(ParameterError, match=r"cloud\.spacing"):
        sample_cloud(surface_of(SHAPES["box"]), CloudParameters(spacing=spacing))


def on_sphere(n: int, radius: float = 0.05) -> np.ndarray:
    points = np.random.default_rng(7).normal(size=(n, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


def test_a_bare_cloud_is_thinned_to_the_spacing_with_outward_normals() -> None:
    points = on_sphere(60_000) + np.array([0.3, 0, 0])
    cloud = sample_cloud(bare(points))
    assert neighbour_distances(cloud).mean() == pytest.approx(0.002, rel=0.05)
    assert neighbour_distances(cloud).min() >= 0.9 * 0.002 - 1e-7
    outward = (cloud.points - [0.3, 0, 0]) / 0.05
    assert np.einsum("ij,ij->i", cloud.normals, outward).min() > 0.95
    assert cloud.areas.sum() == pytest.approx(4 * np.pi * 0.05**2, rel=0.05)
    again = sample_cloud(bare(points))
    assert again.points.tobytes() == cloud.points.tobytes()
    assert again.normals.tobytes() == cloud.normals.tobytes()


def test_points_that_stand_twice_change_nothing() -> None:
    points = on_sphere(20_000)
    once, twice = sample_cloud(bare(points)), sample_cloud(bare(np.concatenate([points, points[::3]])))
    assert neighbour_distances(twice).min() >= 0.9 * 0.002 - 1e-7
    assert len(twice.points) == pytest.approx(len(once.points), rel=0.02)
    assert twice.areas.sum() == pytest.approx(once.areas.sum(), rel=0.02)


def test_a_sparse_cloud_keeps_all_its_points() -> None:
    points = on_sphere(800)
    cloud = sample_cloud(bare(points), CloudParameters(spacing=1e-6))
    assert len(cloud.points) == 800
    assert cloud.areas.sum() == pytest.approx(4 * np.pi * 0.05**2, rel=0.06)


def test_normals_of_a_bare_mug_wall_point_away_from_the_wall() -> None:
    mug = trimesh.creation.annulus(0.03, 0.034, 0.09)
    points, face = trimesh.sample.sample_surface(mug, 60_000, seed=3)
    cloud = sample_cloud(bare(np.array(points)))
    truth = mug.face_normals[face[cKDTree(points).query(cloud.points)[1]]]
    assert (np.einsum("ij,ij->i", cloud.normals, truth) < 0).mean() < 0.005


def test_the_normals_of_the_file_are_kept() -> None:
    points = on_sphere(5000)
    cloud = sample_cloud(bare(points, points / 0.05), CloudParameters(spacing=0.004))
    assert np.einsum("ij,ij->i", cloud.normals, cloud.points / 0.05).min() > 0.999


def test_a_cloud_thinned_to_nothing_is_an_error() -> None:
    with pytest.raises(ParameterError, match=r"cloud\.spacing"):
        sample_cloud(bare(on_sphere(100, 0.005)), CloudParameters(spacing=0.5))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_a_point_stays_unless_one_before_it_is_near_and_on_its_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 1, (200, 3))
    normals = rng.choice([-1.0, 1.0], 200)[:, None] * [0.0, 0.0, 1.0]
    turns = np.argsort(np.random.default_rng(seed).permutation(200))
    chosen: list[int] = []
    for i in turns:
        near = np.linalg.norm(points[chosen] - points[i], axis=1) <= 0.2
        if not (near & (normals[chosen] @ normals[i] > 0)).any():
            chosen.append(i)
    assert thin(points, normals, 0.2, np.random.default_rng(seed)).tolist() == sorted(chosen)
