"""Pages of a store take plotly.js from the file beside them, and nothing else from anywhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.line.lot_page import write_lot_page
from bgars.line.pages import write_part_page
from stored_parts import filled_store

if TYPE_CHECKING:
    from .conftest import Opened

    Open = Callable[..., Opened]


def test_charts_are_drawn_with_the_shared_copy(open_page: Open, tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    write_part_page(store, "SN0001")
    pages = store.folder / "pages"
    opened = open_page(pages / "SN0001.html").scroll_through()
    assert opened.errors == []
    assert opened.page.evaluate("Boolean(window.Plotly)")
    assert {Path(url).name for url in opened.requests if url.startswith("file:")} == {"SN0001.html", "plotly.min.js"}
    assert "SN0001" in opened.page.inner_text("header h1")


def test_the_overview_links_to_the_pages_that_are_there(browser: object, tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    write_part_page(store, "SN0003")
    write_lot_page(store, store.folder / "pages" / "index.html")
    page = browser.new_page()  # type: ignore[attr-defined]
    page.goto((store.folder / "pages" / "index.html").as_uri())
    page.click("a:text('SN0003')")
    page.wait_for_selector("html[data-usable]", state="attached")
    assert page.url.endswith("/SN0003.html")
    page.close()
