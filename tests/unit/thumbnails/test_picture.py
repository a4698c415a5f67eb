"""Pictures of grasps: what they show, that they stay the same when hand and object are moved together."""

import io
from dataclasses import replace
from pathlib import Path

import mug_database
import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import graspdb
from graspdb.thumbnails import GraspShape, ObjectShape, ShapeReader, draw, draw_shaded
from graspdb.view.palette import FEATURE, TOUCHING, rgb
from graspdb_schemas.vocabulary import N_SITES, SITES


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> graspdb.Database:
    return graspdb.open(mug_database.build(tmp_path_factory.mktemp("mug") / "db"))


def ball_in_hand() -> GraspShape:
    """Return a hand of straight digits over a ball of 3 cm, which the tips of thumb and index touch."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(6000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    centre = np.array([0.12, 0.0, -0.03])
    sites = np.empty((N_SITES, 3))
    for digit in range(5):
        for joint in range(4):
            sites[4 * digit + joint] = [0.05 + 0.03 * joint, 0.06 - 0.03 * digit, 0.012]
    touching = np.isin(SITES, ["thumb_tip", "index_tip"])
    return GraspShape(
        grasp="g",
        side="right",
        object=ObjectShape(centre + 0.03 * directions, directions),
        feature=np.flatnonzero(directions[:, 2] > 0.2),
        sites=sites,
        radii=np.full(N_SITES, 0.009),
        wrist=np.zeros(3),
        touching=touching,
        hull=sites[touching][0] + 0.02 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    )


def moved(shape: GraspShape, rotation: np.ndarray, offset: np.ndarray) -> GraspShape:
    body = ObjectShape(shape.object.points @ rotation.T + offset, shape.object.normals @ rotation.T)
    return replace(
        shape,
        object=body,
        sites=shape.sites @ rotation.T + offset,
        wrist=rotation @ shape.wrist + offset,
        hull=shape.hull @ rotation.T + offset,
    )


def share_like(pixels: np.ndarray, colour: str) -> float:
    """Return the share of opaque pixels whose hue is that of a colour."""
    shown = pixels[pixels[..., 3] > 250][:, :3].astype(float)
    wanted = rgb(colour) / np.linalg.norm(rgb(colour))
    return float(np.mean(shown @ wanted / np.maximum(np.linalg.norm(shown, axis=1), 1) > 0.995))


def test_it_shows_feature_and_touching_spheres_and_nothing_at_the_corners() -> None:
    pixels = draw(ball_in_hand(), 120).pixels
    assert share_like(pixels, FEATURE) > 0.02
    assert share_like(pixels, TOUCHING) > 0.01
    assert not pixels[[0, 0, -1, -1], [0, -1, 0, -1], 3].any()


def test_without_feature_and_touch_these_colours_are_gone() -> None:
    shape = replace(ball_in_hand(), feature=np.zeros(0, int), touching=np.zeros(N_SITES, bool))
    pixels = draw(shape, 120).pixels
    assert share_like(pixels, FEATURE) == 0
    assert share_like(pixels, TOUCHING) == 0


def test_moving_hand_and_object_together_leaves_the_picture() -> None:
    shape = ball_in_hand()
    still = draw(shape, 120).pixels.astype(int)
    for rotation in Rotation.random(3, random_state=1):
        other = draw(moved(shape, rotation.as_matrix(), np.array([0.3, -0.2, 0.1])), 120).pixels.astype(int)
        # Rounding may change single pixels at edges.
        assert (np.abs(still - other).max(axis=2) > 8).mean() < 0.005


def test_a_mirrored_hand_gives_a_mirrored_view_from_its_own_radial_side() -> None:
    shape = ball_in_hand()
    mirror = np.diag([1.0, -1.0, 1.0])
    left = replace(moved(shape, mirror, np.zeros(3)), side="left")
    right_pixels, left_pixels = (draw(one, 120).pixels for one in (shape, left))
    # The fingers of a right hand point to the left of the picture, those of a left hand to its right.
    assert centre_of(right_pixels, TOUCHING) < 60 < centre_of(left_pixels, TOUCHING)


def centre_of(pixels: np.ndarray, colour: str) -> float:
    """Return the mean column of the pixels that have the hue of a colour."""
    wanted = rgb(colour) / np.linalg.norm(rgb(colour))
    hue = pixels[..., :3] @ wanted / np.maximum(np.linalg.norm(pixels[..., :3].astype(float), axis=2), 1)
    return float(np.nonzero((hue > 0.995) & (pixels[..., 3] > 250))[1].mean())


def test_what_is_not_known_is_not_drawn() -> None:
    shape = ball_in_hand()
    unknown = np.full((N_SITES, 3), np.nan)
    handless = replace(shape, sites=unknown, wrist=np.full(3, np.nan), hull=np.zeros((0, 3)))
    assert draw(handless, 60).pixels[..., 3].any()
    body = ObjectShape(np.zeros((0, 3)), np.zeros((0, 3)))
    nothing = replace(handless, object=body, feature=np.zeros(0, int))
    assert not draw(nothing, 60).pixels.any()


def test_a_picture_is_a_file_that_others_read() -> None:
    picture = draw(ball_in_hand(), 96)
    with Image.open(io.BytesIO(picture.webp())) as read:
        assert (read.format, read.size, read.mode) == ("WEBP", (96, 96), "RGBA")
        difference = np.abs(np.asarray(read).astype(int) - picture.pixels)[picture.pixels[..., 3] == 255]
    assert difference.mean() < 12


def test_a_scale_is_bright_where_values_are_high() -> None:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(5000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pixels = draw_shaded(0.03 * directions, directions, (directions[:, 2] + 1) / 2, 0.0, 100).pixels
    grey, there = pixels[..., :3].mean(axis=2), pixels[..., 3] == 255
    assert grey[:40][there[:40]].mean() > grey[60:][there[60:]].mean() + 40


def test_shapes_are_those_of_the_database(database: graspdb.Database) -> None:
    keys = [row[0] for row in database.sql("SELECT grasp FROM grasps ORDER BY grasp").rows()]
    shapes = {shape.grasp: shape for shape in ShapeReader(database).shapes([*keys, "no/such/grasp"])}
    assert sorted(shapes) == keys
    for key, shape in shapes.items():
        grasp = database.grasp(key)
        np.testing.assert_array_equal(shape.sites, grasp.sites)
        np.testing.assert_array_equal(shape.feature, grasp.feature_points)
        np.testing.assert_allclose(shape.object.points[shape.feature], grasp.feature_cloud)
        assert {site for site, touches in zip(SITES, shape.touching, strict=True) if touches} == set(
            grasp.contact_sites
        )
    assert len({id(shape.object) for shape in shapes.values()}) == 1


def test_the_module_needs_no_display_and_no_renderer() -> None:
    import subprocess
    import sys

    statement = "import sys, graspdb.thumbnails; assert 'open3d' not in sys.modules, 'open3d'"
    subprocess.run([sys.executable, "-c", statement], check=True, cwd=Path(__file__).parents[3])
