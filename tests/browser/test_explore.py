"""`graspdb explore` in a real browser: filters, pictures, search, SQL and keys, without an error."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import held_can
import hostile_database
import pytest
import worked_example
from playwright.sync_api import Page

import graspdb
from graspdb.explore import Server

Open = Callable[..., Page]


def served(database: graspdb.Database) -> Iterator[str]:
    """Serve a database from a thread, and yield the address."""
    server = Server(database)
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        yield server.address
    finally:
        server.stop()
        thread.join()


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    folder = tmp_path_factory.mktemp("explore") / "db"
    worked_example.build(folder)
    with graspdb.open(folder) as opened:
        yield opened


@pytest.fixture(scope="module")
def address(database: graspdb.Database) -> Iterator[str]:
    yield from served(database)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = hostile_database.build(tmp_path_factory.mktemp("hostile") / "db")
    with graspdb.open(folder) as opened:
        yield from served(opened)


@pytest.fixture(scope="module")
def can(can_database: Path) -> Iterator[str]:
    with graspdb.open(can_database) as opened:
        yield from served(opened)


def grasps_on(page: Page) -> list[str]:
    """Return the grasps that a page shows, in order."""
    return page.locator("figure.grasp figcaption b").all_inner_texts()


def test_a_filter_chosen_by_hand_shows_what_the_api_gives(
    open_page: Open, address: str, database: graspdb.Database
) -> None:
    page = open_page(address)
    assert len(grasps_on(page)) == 6
    page.get_by_label("subject").select_option("ben")
    page.get_by_label("thumb").check()
    page.get_by_label("and, in SQL").fill("hull_volume > 3e-5")
    page.get_by_role("button", name="Filter").click()
    where = "subject = 'ben' AND list_contains(digits, 'thumb') AND hull_volume > 3e-5"
    wanted = [row[0] for row in database.sql(f"SELECT grasp FROM grasps WHERE {where} ORDER BY grasp").rows()]
    assert sorted(grasps_on(page)) == wanted
    # The form still says what was asked.
    assert page.get_by_label("subject").input_value() == "ben"
    assert page.get_by_label("thumb").is_checked()


def test_pictures_are_there_and_not_empty(open_page: Open, can: str) -> None:
    page = open_page(can)
    page.evaluate("() => Promise.all([...document.images].map(image => image.decode()))")
    opaque = page.evaluate(
        """() => {
            const canvas = document.createElement("canvas");
            canvas.width = canvas.height = 160;
            const pen = canvas.getContext("2d");
            pen.drawImage(document.images[0], 0, 0);
            const bytes = pen.getImageData(0, 0, 160, 160).data;
            return bytes.filter((value, i) => i % 4 == 3 && value > 250).length;
        }"""
    )
    assert 0.1 < opaque / 160**2 < 0.95


def test_from_a_picture_to_the_grasp_its_viewer_and_those_like_it(
    open_page: Open, can: str, can_database: Path
) -> None:
    page = open_page(f"{can}?where=grasp = '{held_can.LIFTED}'")
    page.locator("figure.grasp a").first.click()
    assert page.locator("h1").inner_text() == held_can.LIFTED
    page.get_by_label("posture").check()
    page.get_by_role("button", name="Search").click()
    with graspdb.open(can_database) as database:
        expected = database.similar(held_can.LIFTED, k=12, by="posture")
    assert grasps_on(page) == [hit.grasp for hit in expected.hits]
    page.get_by_role("link", name="Turn it and play its motion").click()
    page.wait_for_selector("body[data-ready]")
    assert held_can.LIFTED in page.title()


def test_a_named_query_and_its_chart(open_page: Open, address: str, database: graspdb.Database) -> None:
    page = open_page(f"{address}queries")
    page.get_by_role("link", name="How often does each site of the hand touch each object?").click()
    page.get_by_label("object").first.fill("mug")
    page.get_by_role("button", name="Answer").click()
    cells = page.locator("tbody tr").evaluate_all(
        "rows => rows.map(row => [...row.cells].map(c => c.innerText))"
    )
    expected = database.query("contact_frequency", object="mug").rows()
    assert [(row[0], row[1], int(row[3])) for row in cells] == [(row[0], row[1], row[3]) for row in expected]
    assert page.locator("svg[role=img] rect").count() == len(expected)


def test_sql_by_keys_alone(open_page: Open, address: str) -> None:
    page = open_page(f"{address}sql")
    page.keyboard.press("/")
    page.keyboard.press("Control+A")
    page.keyboard.type("SELECT grasp, hull_volume AS v, grip_aperture FROM grasps WHERE object = 'jug'")
    page.keyboard.press("Control+Enter")
    page.wait_for_selector("tbody tr")
    assert page.locator("tbody tr").count() == 2
    page.get_by_label("kind of chart").select_option("points")
    page.get_by_role("button", name="Draw").click()
    assert page.locator("svg[role=img] circle").count() == 2


def test_names_in_the_data_are_shown_and_do_nothing(open_page: Open, hostile: str) -> None:
    page = open_page(hostile)
    assert any(hostile_database.SCRIPT in key for key in grasps_on(page))
    page.locator("figure.grasp a").first.click()
    assert hostile_database.SCRIPT in page.locator("h1").inner_text()
    assert page.locator("dd", has_text=hostile_database.IMAGE).count() >= 1


@pytest.mark.parametrize("dark", [False, True])
def test_text_stands_out_from_its_ground(open_page: Open, address: str, dark: bool) -> None:
    page = open_page(address, dark=dark)
    for selector in ("body", "a", ".soft", "button"):
        assert page.locator(selector).first.evaluate(CONTRAST) >= 4.5, selector


CONTRAST = """
element => {
    const luminance = colour => {
        const [r, g, b] = colour.match(/[\\d.]+/g).map(v => v / 255)
            .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    let ground = element;
    const clear = /rgba\\(.*, 0\\)|transparent/;
    while (clear.test(getComputedStyle(ground).backgroundColor) && ground.parentElement)
        ground = ground.parentElement;
    const [a, b] = [getComputedStyle(element).color, getComputedStyle(ground).backgroundColor].map(luminance);
    return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}
"""
"""Contrast of an element's text as the Web Content Accessibility Guidelines define it."""
