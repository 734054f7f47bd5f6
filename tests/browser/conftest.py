"""One headless browser for all tests of pages; where there is none, the skip says so loudly, and CI fails."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Playwright, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = [
    "--no-sandbox",  # CI runs as root
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--force-device-scale-factor=1",
]
HOW = "install Chromium (Debian: apt-get install chromium), or name one in BGARS_BROWSER"
CHARTS = "[data-figure]:not([data-figure=scene])"


def find_browser() -> str | None:
    """The same places as .ci/find-browser, which `make test` runs before."""
    named = os.environ.get("BGARS_BROWSER", "")
    return next((path for name in (named, *NAMES) if name and (path := shutil.which(name))), None)


@pytest.fixture(scope="session")
def playwright_driver() -> Iterator[Playwright]:
    with sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="session")
def browser(playwright_driver: Playwright) -> Iterator[Browser]:
    path = find_browser()
    if path is None:
        if os.environ.get("BGARS_REQUIRE_BROWSER") == "1":
            pytest.fail(f"BGARS_REQUIRE_BROWSER is set, but there is no browser: {HOW}")
        pytest.skip(f"NO BROWSER, SO report.html IS NOT TESTED: {HOW}")
    chosen = playwright_driver.chromium.launch(executable_path=path, args=OPTIONS)
    yield chosen
    chosen.close()


class Opened:
    """A page, what its console said, and every address it asked for."""

    def __init__(self, browser: Browser, path: Path, **options: object) -> None:
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})  # type: ignore[arg-type]
        self.page: Page = self.context.new_page()
        self.page.set_default_timeout(90_000)
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda r: self.requests.append(r.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-usable]", state="attached")

    def wait(self, stage: str) -> Opened:
        """Until what is near the first screen ("settled") or the 3-D view ("drawn") is there."""
        self.page.wait_for_selector(f"html[data-{stage}]", state="attached")
        return self

    def scroll_through(self) -> Opened:
        """As a reader does: each chart is drawn when it comes near. Then back to the top."""
        self.wait("settled")
        for name in self.page.eval_on_selector_all(CHARTS, "all => all.map(node => node.dataset.figure)"):
            self.page.locator(f"[data-figure={name}]").evaluate("node => node.scrollIntoView({ block: 'center' })")
            self.page.wait_for_selector(f"[data-figure={name}] .main-svg", state="attached")
        self.wait("charted")
        self.page.evaluate("scrollTo(0, 0)")
        return self

    def open_scene(self) -> Opened:
        """Ask for the 3-D view, which is a still until then."""
        self.scroll_through()
        self.page.click("#open-scene")
        return self.wait("drawn")


@pytest.fixture
def open_page(browser: Browser) -> Iterator[type]:
    opened: list[Opened] = []

    def open_it(path: Path, **options: object) -> Opened:
        opened.append(Opened(browser, path, **options))
        return opened[-1]

    yield open_it  # type: ignore[misc]
    for page in opened:
        page.context.close()
