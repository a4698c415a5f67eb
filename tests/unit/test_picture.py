"""Pictures drawn by ray casting, against closed forms; figures, read back by others' libraries."""

import io

import held_can
import numpy as np
import pytest
from PIL import Image

import graspdb
from graspdb.view import palette
from graspdb.view.camera import FIELD_OF_VIEW, Camera
from graspdb.view.picture import Shown, best_camera, object_colours, picture, png
from graspdb.view.reading import read_scene
from graspdb.view.scene import Scene
from graspdb.view.shapes import capsule, sphere


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = held_can.build(tmp_path_factory.mktemp("held") / "grasps")
    with graspdb.open(folder) as db:
        return read_scene(db, held_can.LIFTED, motion=False)


def hue(colour: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(colour.astype(float), -1, 0)
    return np.degrees(np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue)) % 360


def of_colour(image: np.ndarray, colour: str) -> np.ndarray:
    """Return which pixels have a colour's hue, strongly."""
    pixels = image[..., :3] / 255
    strong = pixels.max(axis=-1) - pixels.min(axis=-1) > 0.3
    return strong & (np.abs(hue(pixels) - hue(palette.rgb(colour))) < 14) & (image[..., 3] > 0)


def test_the_middle_ray_meets_the_target_and_the_corner_ray_has_the_field_of_view() -> None:
    camera = Camera(np.array([1.0, 0, 0]), np.zeros(3), np.array([0.0, 0, 1]))
    rays = camera.rays(1, 1)[0, 0]
    np.testing.assert_allclose(rays, [1, 0, 0, -1, 0, 0], atol=1e-12)
    tall = camera.rays(1, 1001)
    angle = np.arccos(tall[0, 0, 3:] @ tall[-1, 0, 3:])
    assert angle == pytest.approx(FIELD_OF_VIEW, rel=2e-3)
    # The first row is the top, and the first column the left.
    assert camera.rays(3, 3)[0, 1, 5] > 0
    assert camera.rays(3, 3)[1, 0, 4] < 0


@pytest.mark.parametrize(("r0", "r1"), [(0.01, 0.01), (0.02, 0.01), (0.005, 0.012)])
def test_a_capsule_is_the_surface_of_the_spheres_between_its_ends(r0: float, r1: float) -> None:
    start, end = np.array([0.0, 0.01, 0.02]), np.array([0.05, -0.02, 0.03])
    shape = capsule(start, end, r0, r1, np.ones(3))
    shares = np.linspace(0, 1, 4001)[:, None]
    centres, radii = start + shares * (end - start), r0 + shares[:, 0] * (r1 - r0)
    distance = (np.linalg.norm(shape.vertices[:, None] - centres, axis=2) - radii).min(axis=1)
    np.testing.assert_allclose(distance, 0, atol=2e-7)
    corners = shape.vertices[shape.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", cross, shape.normals[shape.faces].sum(axis=1)) >= -1e-15).all()


def test_one_sphere_in_another_is_the_larger_one() -> None:
    shape = capsule(np.zeros(3), np.array([0.001, 0, 0]), 0.01, 0.002, np.ones(3))
    np.testing.assert_allclose(np.linalg.norm(shape.vertices, axis=1), 0.01)
    alone = sphere(np.ones(3), 0.5, np.ones(3))
    np.testing.assert_allclose(np.linalg.norm(alone.vertices - 1, axis=1), 0.5)


def test_a_picture_shows_what_is_asked_for(scene: Scene) -> None:
    camera = best_camera(scene)
    whole = picture(scene, 120, 120, camera=camera)
    assert whole.shape == (120, 120, 4)
    assert 0.05 < (whole[..., 3] > 0).mean() < 0.95
    assert of_colour(whole, palette.TOUCHING).sum() > 20
    assert of_colour(whole, palette.FEATURE).sum() > 20
    plain = picture(
        scene, 120, 120, camera=camera, shown=Shown(hand=False, hull=False, feature=False, contacts=False)
    )
    assert of_colour(plain, palette.FEATURE).sum() < 3
    assert (plain[..., 3] > 0).sum() < (whole[..., 3] > 0).sum()


def test_the_same_grasp_gives_the_same_picture(scene: Scene) -> None:
    first, second = (picture(scene, 60, 60) for _ in range(2))
    assert (first == second).all()
    with Image.open(io.BytesIO(png(first))) as image:
        assert (np.asarray(image) == first).all()


def test_the_contact_map_is_bright_where_the_hand_is_near(scene: Scene) -> None:
    colours = object_colours(scene, Shown(contact_map=True))
    assert scene.contact_map is not None
    order = np.argsort(scene.contact_map.gaps)
    luminance = colours[scene.contact_map.points] @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[order]) <= 1e-9).all()
    far = np.setdiff1d(np.arange(len(colours)), scene.contact_map.points)
    np.testing.assert_allclose(colours[far], np.tile(palette.rgb(palette.SCALE[0]), (len(far), 1)))


def test_the_scale_rises_in_lightness() -> None:
    luminance = palette.scale_colours(np.linspace(0, 1, 50)) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance) > 0).all()
