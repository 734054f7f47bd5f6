"""Charts of report.html are drawn when the reader comes near them, and all of them on paper."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
import pytest
from report_parts import failing

if TYPE_CHECKING:
    from playwright.sync_api import Page

    from .conftest import Opened

    Open = Callable[..., Opened]

CHARTS = "[data-figure]:not([data-figure=scene])"
SHORT = {"width": 1280, "height": 300}  # the charts are screens away


@pytest.fixture(scope="module")
def page_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "report.html"
    bgars.write_report(failing(), path)
    return path


def drawn(page: Page) -> dict[str, bool]:
    """Which charts are there."""
    found = page.eval_on_selector_all(
        CHARTS, "all => all.map(n => [n.dataset.figure, Boolean(n.querySelector('svg'))])"
    )
    return dict(found)


def places(page: Page) -> list[list[float]]:
    """Where charts and sections begin on the page, and how high they are."""
    return page.evaluate(
        "[...document.querySelectorAll('[data-figure], section')]"
        ".map(n => n.getBoundingClientRect()).map(r => [r.top + scrollY, r.height])"
    )


def test_a_chart_far_below_waits_and_then_bears_what_was_chosen(page_path: Path, open_page: Open) -> None:
    opened = open_page(page_path, viewport=SHORT).wait("settled")
    page = opened.page
    assert len(drawn(page)) > 3
    assert not any(drawn(page).values())
    assert page.evaluate("typeof Plotly") == "undefined", "nothing needed it"
    told = page.eval_on_selector_all(CHARTS, "all => all.map(n => getComputedStyle(n, '::before').content)")
    assert set(told) == {'"drawn when you come near"'}
    index = next(at for at, ball in enumerate(failing().balls) if ball.name == "A3")
    page.locator(f"#ball-{index} button.choose").evaluate("button => button.click()")  # no scrolling
    before = places(page)

    page.locator("[data-figure=coplanarity]").evaluate("node => node.scrollIntoView()")
    page.wait_for_selector("[data-figure=coplanarity] .main-svg", state="attached")
    marked = "name => document.querySelector(`[data-figure=${name}]`).data.at(-1).x"
    assert page.evaluate(marked, "coplanarity") == [index, index], "below both planes"
    later = [name for name, there in drawn(page).items() if not there]
    assert "flat_top_depth_um" in later, "the last is still far away"
    assert page.locator("html[data-charted]").count() == 0

    opened.scroll_through()
    assert all(drawn(page).values())
    assert len(page.evaluate(marked, "offsets")) == 1
    assert places(page) == before, "a chart takes the place that was kept for it"
    page.keyboard.press("Escape")
    assert [page.evaluate(marked, name) for name in ("coplanarity", "offsets")] == [[], []]
    assert page.evaluate("document.scripts.length") == 5, "the library took the place of its text"
    assert opened.errors == []


def test_paper_draws_what_nobody_scrolled_to(page_path: Path, open_page: Open) -> None:
    opened = open_page(page_path, viewport=SHORT, color_scheme="dark").wait("settled")
    page = opened.page
    page.locator("#ball-0 button.choose").evaluate("button => button.click()")  # no scrolling
    assert not any(drawn(page).values())
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert all(drawn(page).values()), "before the browser goes on to print"
    widths = page.eval_on_selector_all(f"{CHARTS} .main-svg", "all => all.map(s => s.getAttribute('width'))")
    assert {int(width) for width in widths} == {228, 690}, "paper has sizes of its own"
    ink = "document.querySelector('[data-figure=offsets]')._fullLayout.font.color"
    assert page.evaluate(ink) == "#16202b", "and no dark colours"
    assert page.evaluate("document.querySelector('[data-figure=offsets]').data.at(-1).x.length") == 1
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.wait_for_function(f"() => {ink} === '#e8edf2'")
    opened.scroll_through()
    assert opened.errors == []


def test_print_without_a_reader_has_every_chart(page_path: Path, open_page: Open, tmp_path: Path) -> None:
    opened = open_page(page_path, viewport=SHORT).wait("settled")
    opened.page.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True)
    assert all(drawn(opened.page).values())
    assert opened.errors == []


def test_a_browser_that_cannot_watch_draws_all(page_path: Path, open_page: Open) -> None:
    opened = open_page(page_path, viewport=SHORT)
    opened.context.add_init_script("delete window.IntersectionObserver")
    opened.page.reload()
    opened.wait("charted")
    assert all(drawn(opened.page).values())
    assert opened.errors == []


def test_a_library_that_was_changed_is_not_run_and_the_charts_say_so(
    page_path: Path, open_page: Open, tmp_path: Path
) -> None:
    text = page_path.read_text(encoding="utf-8")
    library = re.search(r'<script type="text/plain" id="plotly">(.*?)</script>', text, re.DOTALL)
    assert library is not None
    digest = base64.b64encode(hashlib.sha256(library[1].encode()).digest()).decode()
    assert f"'sha256-{digest}'" in text.split("style-src")[0]
    path = tmp_path / "changed.html"
    path.write_text(text.replace(library[1], library[1] + "document.title = 'owned'"), encoding="utf-8")
    opened = open_page(path, viewport=SHORT).wait("settled")
    page = opened.page
    page.locator("[data-figure=coplanarity]").evaluate("node => node.scrollIntoView()")
    page.wait_for_selector("html[data-chartless]", state="attached")
    told = page.locator("[data-figure=coplanarity]").evaluate("node => getComputedStyle(node, '::before').content")
    assert "cannot be drawn" in told
    assert page.title() != "owned"
    page.locator("#balls button[data-sort='verdict']").click()
    assert page.locator("#ball-0").is_visible(), "tables go on"
    assert any("Content Security Policy" in error for error in opened.errors), json.dumps(opened.errors)
