"""The report in a real browser: it opens from disk, alone, in light, in dark and on paper."""

from collections.abc import Callable
from pathlib import Path

import held_can
import hostile_database
import pytest
from playwright.sync_api import Browser, Page

import graspdb
from graspdb.report import write_report

Open = Callable[..., Page]


@pytest.fixture(scope="module")
def report(can_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the report on a session, with the pages of its grasps."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    with graspdb.open(can_database) as database:
        write_report(database, "made", path, pages=True)
    return path


def test_it_opens_from_disk_with_all_its_pictures(open_page: Open, report: Path) -> None:
    page = open_page(report)
    assert page.locator("h1").inner_text() == "made"
    assert page.locator("#grasps img").count() == 2
    assert page.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")


def test_every_part_is_led_to(open_page: Open, report: Path) -> None:
    page = open_page(report)
    for link in page.locator("nav a").all():
        link.click()
        assert page.locator(":target").count() == 1


def test_a_picture_leads_to_the_page_of_its_grasp(open_page: Open, report: Path) -> None:
    page = open_page(report)
    keys = page.locator("#grasps figcaption b").all_inner_texts()
    assert sorted(f"made/{key}" for key in keys) == sorted([held_can.LIFTED, held_can.NAMED])
    named = next(i for i, key in enumerate(keys) if f"made/{key}" == held_can.NAMED)
    address = page.locator("#grasps a").nth(named).evaluate("link => link.href")
    other = open_page(address)
    other.wait_for_selector("body[data-ready]")
    assert held_can.NAMED in other.title()


def test_the_time_line_of_a_lift_rises(open_page: Open, report: Path) -> None:
    page = open_page(report)
    height = page.locator("#events polyline.s5").first.get_attribute("points")
    assert height is not None
    rows = [float(point.split(",")[1]) for point in height.split()]
    # Rows are counted downwards.
    assert rows[0] - min(rows) > 20
    assert page.locator("#events line.lift").count() >= 1


def test_names_are_shown_and_do_nothing(open_page: Open, tmp_path: Path) -> None:
    with graspdb.open(hostile_database.build(tmp_path / "db")) as database:
        write_report(database, "s", tmp_path / "report.html")
    page = open_page(tmp_path / "report.html")
    text = page.locator("body").inner_text()
    for name in (hostile_database.SCRIPT, hostile_database.IMAGE):
        assert name in text
    assert page.locator("script, [onerror]").count() == 0


def test_dark_pages_are_dark_and_paper_is_white(open_page: Open, report: Path) -> None:
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    page = open_page(report, dark=True)
    assert page.evaluate(ground) == "rgb(20, 24, 31)"
    page.emulate_media(media="print")
    assert page.evaluate(ground) == "rgb(255, 255, 255)"
    assert not page.locator("nav").is_visible()


def test_it_prints_on_a4(browser: Browser, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    pdf = page.pdf(prefer_css_page_size=True)
    page.close()
    assert pdf.startswith(b"%PDF")
    # A4 in points.
    assert b"/MediaBox [0 0 594.95996 841.91998]" in pdf or b"/MediaBox [0 0 595" in pdf
    assert 1 <= pdf.count(b"/Type /Page\n") <= 6
