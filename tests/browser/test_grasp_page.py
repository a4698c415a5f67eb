"""The page of a grasp in a real browser: it opens from disk, alone, and does what it says."""

import base64
import io
from collections.abc import Callable
from pathlib import Path

import held_can
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

import graspdb
from graspdb.view import palette
from graspdb.view.write import write_page

Open = Callable[..., Page]


@pytest.fixture(scope="module")
def pages(can_database: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the pages of a moving grasp, of a still one with HTML for names, and of both."""
    folder = tmp_path_factory.mktemp("pages")
    with graspdb.open(can_database) as database:
        return {
            "moving": write_page(database, folder / "moving.html", held_can.LIFTED),
            "named": write_page(database, folder / "named.html", held_can.NAMED),
            "both": write_page(database, folder / "both.html", held_can.LIFTED, held_can.NAMED),
        }


def shown(opened: Open, path: Path, **options: object) -> Page:
    page = opened(path, **options)
    page.wait_for_selector("body[data-ready]")
    return page


def picture(page: Page) -> np.ndarray:
    """Return what is drawn on the canvas, on white, shape (height, width, 3)."""
    drawn = page.evaluate(
        "() => { shownPage.render(); return document.getElementById('picture').toDataURL('image/png'); }"
    )
    with Image.open(io.BytesIO(base64.b64decode(drawn.partition(",")[2]))) as image:
        pixels = np.asarray(image.convert("RGBA")).astype(int)
    return 255 + (pixels[..., :3] - 255) * pixels[..., 3:] // 255


def share(image: np.ndarray, colour: str) -> float:
    """Return the share of pixels of a colour's hue: strong, and within 12 degrees of it."""
    scaled = image / 255
    most, least = scaled.max(axis=-1), scaled.min(axis=-1)
    strong = most - least > 0.35
    return float((strong & (np.abs(hue(scaled) - hue(palette.rgb(colour))) < 12)).mean())


def hue(colour: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(colour, -1, 0)
    return np.degrees(np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue)) % 360


def set_time(page: Page, frame: int) -> None:
    page.locator("#time").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }", frame
    )


def test_the_picture_shows_object_feature_and_touching_spheres(
    open_page: Open, pages: dict[str, Path]
) -> None:
    page = shown(open_page, pages["moving"])
    image = picture(page)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 500
    assert share(image, palette.TOUCHING) > 0.001
    assert share(image, palette.FEATURE) > 0.001


@pytest.mark.parametrize(
    ("layer", "key", "colour"),
    [("spheres", "3", palette.TOUCHING), ("feature", "5", palette.FEATURE)],
)
def test_a_layer_goes_and_comes_by_box_and_by_key(
    open_page: Open, pages: dict[str, Path], layer: str, key: str, colour: str
) -> None:
    page = shown(open_page, pages["moving"])
    before = share(picture(page), colour)
    page.locator(f"#layer-{layer}").uncheck()
    assert share(picture(page), colour) < before / 10
    page.keyboard.press(key)
    assert page.locator(f"#layer-{layer}").is_checked()
    assert share(picture(page), colour) == pytest.approx(before, rel=0.01)


def test_every_layer_changes_the_picture(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["moving"])
    before = picture(page)
    for key in "1234567t":
        page.keyboard.press(key)
        assert (picture(page) != before).any(), key
        page.keyboard.press(key)
        assert (picture(page) == before).all(), key


def test_the_slider_moves_hand_and_object(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["moving"])
    assert int(page.locator("#time").get_attribute("max")) == held_can.N_FRAMES - 1
    assert int(page.locator("#time").input_value()) == held_can.LIFT
    assert "snapshot" in page.locator("#moment").inner_text()
    at_snapshot = picture(page)
    set_time(page, 0)
    assert "0.00 s, reach, 0 of 20 sites touch" in page.locator("#moment").inner_text()
    reaching = picture(page)
    assert share(reaching, palette.TOUCHING) < share(at_snapshot, palette.TOUCHING) / 10
    set_time(page, held_can.TOP)
    assert (picture(page) != at_snapshot).mean() > 0.05
    page.keyboard.press("s")
    assert (picture(page) == at_snapshot).all()


def test_where_things_are_drawn_is_where_they_were(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["moving"])
    grip = held_can.held()
    script = """() => { const view = new GraspView(page.grasps[0]); view.show(%f);
        return [view.object.matrix.elements, view.spheres.map(s => s.position.toArray())]; }"""
    for frame in (0, held_can.LIFT, held_can.TOP, held_can.N_FRAMES - 1):
        matrix, spheres = page.evaluate(script % ((frame - held_can.LIFT) / held_can.RATE))
        turn, place = held_can.can_pose(frame)
        pose = np.array(matrix).reshape(4, 4).T
        np.testing.assert_allclose(pose[:3, :3], turn.as_matrix(), atol=1e-6)
        np.testing.assert_allclose(pose[:3, 3], place, atol=1e-6)
        sites = turn.apply(grip.sites) + place + held_can.hand_away(frame)
        np.testing.assert_allclose(spheres, sites, atol=1e-6)


def test_an_object_that_is_held_still_stays_and_the_hand_moves_about_it(
    open_page: Open, pages: dict[str, Path]
) -> None:
    page = shown(open_page, pages["moving"])
    script = """() => { const view = new GraspView(page.grasps[0]); view.show(%f, true);
        return [view.object.matrix.elements, view.spheres.map(s => s.position.toArray())]; }"""
    held = page.evaluate(script % 0.0)
    later = page.evaluate(script % ((held_can.TOP - held_can.LIFT) / held_can.RATE))
    # The hand goes with the can, so with the can held still it is still, too.
    np.testing.assert_allclose(later[0], held[0], atol=1e-6)
    np.testing.assert_allclose(later[1], held[1], atol=1e-5)


def test_pointing_names_a_site_with_its_gap_and_unit(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["moving"])
    for key in "1246":
        page.keyboard.press(key)
    image = picture(page)
    scaled = image / 255
    red = (scaled.max(-1) - scaled.min(-1) > 0.35) & (
        np.abs(hue(scaled) - hue(palette.rgb(palette.TOUCHING))) < 12
    )
    rows, columns = np.nonzero(red)
    middle = np.argmin(np.hypot(rows - np.median(rows), columns - np.median(columns)))
    page.locator("#picture").hover(position={"x": int(columns[middle]), "y": int(rows[middle])})
    page.wait_for_selector("#tip:not([hidden])")
    tip = page.locator("#tip").inner_text()
    grip = held_can.held()
    told = dict(zip(held_can.SITES, grip.gap, strict=True))
    site = tip.splitlines()[0]
    sign = "\N{MINUS SIGN}" if told[site] < 0 else ""
    assert f"gap {sign}{abs(1e3 * told[site]):.1f} mm, touches" in tip


def test_names_are_text(open_page: Open, pages: dict[str, Path]) -> None:
    for page in (shown(open_page, pages["named"]), shown(open_page, pages["both"])):
        assert "made/<script>alert(1)</script>/right/0" in page.locator("h1").inner_text()
        assert '<img src=x onerror="alert(2)">' in page.locator("aside").inner_text()
        assert "lift <b>up</b>" in page.locator("body").inner_text()
        assert page.locator("img, aside b:not(.cost b), header script").count() == 0


def test_one_instant_has_no_slider(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["named"])
    assert not page.locator("#timeline").is_visible()
    assert share(picture(page), palette.TOUCHING) > 0.001


def test_two_grasps_stand_side_by_side_laid_over_each_other(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["both"])
    image = picture(page)
    left, right = image[:, : image.shape[1] // 2], image[:, image.shape[1] // 2 :]
    for half in (left, right):
        assert share(half, palette.TOUCHING) > 0.001
    names = page.locator(".captions strong").all_inner_texts()
    assert names == [held_can.LIFTED, held_can.NAMED]
    # They are one grasp of one can, under two names.
    assert "Cost 0.00; 0 is the same grasp." in page.locator("aside").inner_text()
    assert page.locator(".cost").count() == 5


def test_keys_turn_the_view_and_reset_it(open_page: Open, pages: dict[str, Path]) -> None:
    page = shown(open_page, pages["moving"])
    before = picture(page)
    page.locator("#picture").focus()
    for key in ("ArrowLeft", "ArrowUp", "+"):
        page.keyboard.press(key)
    assert (picture(page) != before).mean() > 0.05
    page.keyboard.press("r")
    # The same but for rounding of the camera's place.
    assert np.abs(picture(page) - before).mean() < 0.5


def test_everything_that_acts_has_a_name_and_is_reached_by_tab(
    open_page: Open, pages: dict[str, Path]
) -> None:
    page = shown(open_page, pages["moving"])
    names = []
    for _ in range(20):
        page.keyboard.press("Tab")
        names.append(
            page.evaluate(
                "() => { const e = document.activeElement;"
                "return e.getAttribute('aria-label') || e.labels?.[0]?.innerText || e.innerText || ''; }"
            )
        )
    told = " ".join(names)
    for word in ("Reset", "Object", "Contact map", "Sites and gaps", "Play", "Snapshot", "Time in the trial"):
        assert word in told


def test_dark_and_light_differ_in_ground_alone(open_page: Open, pages: dict[str, Path]) -> None:
    pictures, grounds = [], []
    for dark in (False, True):
        page = shown(open_page, pages["moving"], dark=dark)
        pictures.append(picture(page))
        with Image.open(io.BytesIO(page.screenshot())) as image:
            grounds.append(np.asarray(image.convert("L"))[-3:, :3].mean())
    assert grounds[0] > 200
    assert grounds[1] < 80
    assert (pictures[0] == pictures[1]).mean() > 0.95
