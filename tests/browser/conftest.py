"""A real browser, and pages that fail their test on any error or network request."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import held_can
import pytest
from playwright.sync_api import Browser, Page, Request, Route, sync_playwright

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    # Three dimensions without a graphics card.
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Return a headless Chromium; where there is none, the test fails and says what to install."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.fail("needs Chromium: apt-get install chromium (make test does it)")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=list(ARGUMENTS))
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Return a function that opens a file or an address.

    Once the test is over it fails if a page wrote an error or a warning, opened a dialog, or asked for
    anything but itself or, where it came from a server, that server.
    """
    contexts = []
    complaints: list[str] = []

    def opened(where: Path | str, *, dark: bool = False, width: int = 800, height: int = 500) -> Page:
        address = where.resolve().as_uri() if isinstance(where, Path) else where
        origin = address if isinstance(where, Path) else "/".join(address.split("/")[:3])
        context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
        )
        contexts.append(context)
        page = context.new_page()

        def check(route: Route, request: Request) -> None:
            if request.url.startswith((origin, "data:", "blob:")):
                route.continue_()
            else:
                complaints.append(f"asked for {request.url}")
                route.abort()

        page.route("**/*", check)
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on(
            "console",
            lambda message: (
                complaints.append(f"{message.type}: {message.text}")
                if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text
                else None
            ),
        )
        page.on("dialog", lambda dialog: (complaints.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.goto(address)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture(scope="session")
def can_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a database of a hand that lifts a can, and of a grasp whose names are HTML."""
    return held_can.build(tmp_path_factory.mktemp("held") / "grasps")
