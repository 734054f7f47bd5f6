"""report.html in a real browser: what people see, sort, choose and print is the result."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.report.html.units import with_micro
from bgars.report.html.words import QUANTITIES, expanded, number
from report_parts import RESULTS, failing, hostile, inspected, passing, simulated
from test_report_budget import budgeted

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from playwright.sync_api import Locator, Page

    from .conftest import Opened

    Open = Callable[..., Opened]


@pytest.fixture(scope="module")
def failed_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "report.html"
    bgars.write_report(failing(), path, capture=simulated("bad")[0])
    return path


def names(page: Page) -> list[str]:
    """Balls of the table that are shown, from the top."""
    return page.eval_on_selector_all(
        "#balls tbody tr", "rows => rows.filter(r => !r.hidden).map(r => r.cells[0].textContent)"
    )


def pixels(node: Locator) -> NDArray[np.uint8]:
    return iio.imread(io.BytesIO(node.screenshot()), extension=".png")[..., :3]


@pytest.mark.parametrize("kind", RESULTS)
def test_every_kind_of_result_opens_in_silence_and_alone(kind: str, tmp_path: Path, open_page: Open) -> None:
    result = RESULTS[kind]()
    path = tmp_path / "report.html"
    bgars.write_report(result, path)
    opened = open_page(path).scroll_through()
    if kind in {"undecided", "list of positions"}:
        opened.open_scene()
    assert opened.errors == []
    outside = [url for url in opened.requests if not url.startswith(("data:", "blob:"))]
    assert outside == [path.as_uri()], "nothing but the file itself"
    page = opened.page
    assert page.title() == f"{result.name}: {result.verdict}"
    assert result.verdict.upper() in page.inner_text("#verdict")
    assert page.eval_on_selector_all("ul.reasons li", "all => all.map(each => each.textContent)") == with_micro(
        list(result.reasons)
    )
    assert names(page) == [ball.name for ball in result.balls]
    assert json.loads(page.text_content("#result") or "") == result.to_dict()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing sticks out sideways"


def test_numbers_are_those_of_the_result(failed_page: Path, open_page: Open) -> None:
    page = open_page(failed_page).page
    result = failing()
    for index, ball in enumerate(result.balls):
        cells = page.eval_on_selector_all(f"#ball-{index} > *", "all => all.map(each => each.textContent)")
        for at, quantity in enumerate(QUANTITIES):
            value = ball.to_dict()[quantity.name]
            u = expanded(ball.to_dict()[quantity.u_name]) if quantity.u_name and value is not None else None
            shown = number(value, quantity.digits) + ("" if u is None else f" ± {number(u, quantity.digits)}")
            assert cells[4 + at] == shown
    for check in result.checks:
        cells = page.eval_on_selector_all(
            f"tr[data-check={check.name}] > *", "all => all.map(each => each.textContent)"
        )
        assert cells[2:4] == [number(check.value_um), number(expanded(check.u_um))]
        assert (check.verdict or "not judged") in cells[1]


def test_hostile_texts_are_only_texts(tmp_path: Path, open_page: Open) -> None:
    path = tmp_path / "report.html"
    bgars.write_report(hostile(), path)
    opened = open_page(path).scroll_through()
    page = opened.page
    assert "owned" not in page.title().split("document.title='owned'")[0]
    assert page.evaluate("document.scripts.length") == 5
    assert page.evaluate("document.querySelectorAll('main img:not(#scene-still)').length") == 0
    page.locator("#balls button.choose").first.click()
    assert page.inner_text("#chosen h3") == hostile().balls[0].name
    assert page.evaluate("document.querySelector('#chosen img, #chosen script')") is None
    assert opened.errors == []


def test_sorting_by_every_column(failed_page: Path, open_page: Open) -> None:
    page = open_page(failed_page).page
    balls = failing().balls
    for quantity in QUANTITIES:
        known = [ball for ball in balls if ball.to_dict()[quantity.name] is not None]
        rest = [ball.name for ball in balls if ball.to_dict()[quantity.name] is None]
        head = page.locator(f"#balls th:has(button[data-sort='{quantity.name}'])")
        for down in (False, True):
            head.locator("button").press("Enter")
            assert head.get_attribute("aria-sort") == ("descending" if down else "ascending")
            shown = names(page)
            values = {ball.name: ball.to_dict()[quantity.name] for ball in known}
            order = [values[name] for name in shown[: len(known)]]
            assert order == sorted(order, reverse=down)
            assert shown[len(known) :] == rest, "what was not measured stays last"
    page.locator("#balls button[data-sort='verdict']").click()
    verdicts = page.eval_on_selector_all("#balls tbody tr", "rows => rows.map(r => r.dataset.verdict)")
    assert verdicts == sorted(verdicts, key=["fail", "undecided", "pass"].index)
    assert page.locator("#balls thead th:not([aria-sort='none'])").count() == 1
    page.locator("#balls button[data-sort='index']").click()
    assert names(page) == [ball.name for ball in balls]


def test_filtering_by_verdict_and_by_words(failed_page: Path, open_page: Open) -> None:
    page = open_page(failed_page).page
    balls = failing().balls
    page.get_by_role("button", name="not passed").click()
    open_ = [ball.name for ball in balls if ball.verdict != "pass"]
    assert 0 < len(open_) < len(balls)
    assert names(page) == open_
    assert page.inner_text("#shown") == f"{len(open_)} of {len(balls)} balls"
    page.fill("#filter", "missing")
    assert names(page) == ["B2"]
    page.fill("#filter", "no such word")
    assert names(page) == []
    page.fill("#filter", "DIAMETER fail")
    assert names(page) == ["D1"]
    page.get_by_role("button", name="all", exact=True).click()
    page.fill("#filter", "")
    assert names(page) == [ball.name for ball in balls]


def test_a_ball_is_chosen_in_picture_table_and_charts(failed_page: Path, open_page: Open) -> None:
    opened = open_page(failed_page).open_scene()
    page = opened.page
    balls = failing().balls
    index = next(at for at, ball in enumerate(balls) if ball.name == "A3")
    page.locator(f".mark[data-ball='{index}'] circle").click()
    row = page.locator(f"#ball-{index}")
    assert row.get_attribute("aria-current") == "true"
    assert page.inner_text("#chosen h3") == "A3"
    assert number(balls[index].true_position_um) in page.inner_text("#chosen")
    visible = "row => { const f = row.closest('.scroll').getBoundingClientRect(), r = row.getBoundingClientRect();"
    assert row.evaluate(visible + "return r.top >= f.top && r.bottom <= f.bottom; }"), "scrolled into the table's frame"
    for name in ("coplanarity", "offsets", "scene"):
        marked = f"document.querySelector('[data-figure={name}]').data.at(-1).x.length"
        page.wait_for_function(f"() => {marked} > 0")
    page.locator("#ball-0 button.choose").press("Enter")
    assert page.inner_text("#chosen h3") == balls[0].name
    assert page.locator("tr.chosen").count() == page.locator(".mark.chosen").count() == 1
    page.locator(f"#ball-{index}").hover()
    assert "hover" in (page.locator(f".mark[data-ball='{index}']").get_attribute("class") or "")
    point = page.locator("[data-figure=coplanarity] .scatterlayer .trace").first.locator(".point").nth(2)
    point.scroll_into_view_if_needed()
    box = point.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    known = [ball.name for ball in balls if np.isfinite(ball.seating_deviation_um)]
    page.wait_for_function(f"() => document.querySelector('#chosen h3').textContent === {json.dumps(known[2])}")
    page.keyboard.press("Escape")
    assert page.locator(".chosen").count() == 0
    assert page.inner_text("#chosen h3") == "Select a ball"
    assert opened.errors == []


def test_a_chosen_ball_tells_what_its_height_is_uncertain_by(tmp_path: Path, open_page: Open) -> None:
    result = budgeted()
    path = tmp_path / "report.html"
    bgars.write_report(result, path)
    opened = open_page(path, viewport={"width": 390, "height": 844})
    page = opened.page
    for index, ball in enumerate(result.balls):
        page.locator(f"#ball-{index} button.choose").press("Enter")
        told = page.eval_on_selector_all("#chosen h4 + dl > div", "all => all.map(each => each.textContent)")
        assert told == [f"{cause}{2 * u:.2f} µm" for cause, u in ball.budget.get("top_um", {}).items()]
        assert page.locator("#chosen h4").count() == bool(told)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    table = page.locator(".budget")
    assert table.bounding_box()["width"] <= 390, "no column is out of sight"  # type: ignore[index]
    assert opened.errors == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_3d_view_draws_balls(scheme: str, failed_page: Path, open_page: Open) -> None:
    opened = open_page(failed_page, color_scheme=scheme).scroll_through()
    assert opened.page.evaluate("document.querySelectorAll('canvas').length") == 0, (
        "nothing is drawn before it is asked for"
    )
    assert opened.page.locator("#scene-still").is_visible()
    opened.open_scene()
    assert not opened.page.locator("#scene-still").is_visible()
    buttons = opened.page.eval_on_selector_all(".modebar-btn", "all => all.map(each => each.dataset.title)")
    assert len(buttons) == 5
    assert not any("share" in title.lower() or "cloud" in title.lower() for title in buttons), "nothing leaves the page"
    scene = opened.page.locator("[data-figure=scene]")
    scene.scroll_into_view_if_needed()
    opened.page.wait_for_timeout(300)
    shown = pixels(scene).astype(int)
    saturation = shown.max(axis=2) - shown.min(axis=2)
    assert (saturation > 60).mean() > 0.03, "coloured caps are there"
    assert np.unique(shown.reshape(-1, 3), axis=0).shape[0] > 1000
    background = opened.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    assert opened.errors == []


def test_on_a_phone_nothing_sticks_out(failed_page: Path, open_page: Open) -> None:
    opened = open_page(failed_page, viewport={"width": 390, "height": 844}, has_touch=True).scroll_through()
    page = opened.page
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert page.locator("#verdict").bounding_box()["y"] < 300  # type: ignore[index]
    named = "document.querySelector('[data-figure=coplanarity]')._fullLayout.xaxis.tickvals.length"
    few = page.evaluate(named)
    assert 2 <= few <= 390 / 28, "names of balls have room"
    page.set_viewport_size({"width": 700, "height": 844})
    page.wait_for_function("() => document.querySelector('[data-figure=coplanarity] .main-svg').clientWidth > 500")
    page.wait_for_function(f"() => {named} > {few}")
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_function("() => document.querySelector('[data-figure=coplanarity] .main-svg').clientWidth < 390")
    wide = page.eval_on_selector_all(".js-plotly-plot", "all => all.filter(c => c.scrollWidth > 390).length")
    assert wide == 0
    assert opened.errors == []


@pytest.mark.parametrize("opened_before", [False, True])
def test_on_paper_charts_and_the_3d_view_are_there(
    opened_before: bool, failed_page: Path, open_page: Open, tmp_path: Path
) -> None:
    opened = open_page(failed_page, color_scheme="dark").scroll_through()
    page = opened.page
    if opened_before:
        opened.open_scene()
    page.emulate_media(media="print", color_scheme="light")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("#scene-still").is_visible()
    assert page.locator("#scene-keys").is_visible()
    heads = page.eval_on_selector_all("#balls thead button", "all => all.map(b => getComputedStyle(b).display)")
    assert set(heads) == {"contents"}, "a button would not be painted in the heads of further sheets"
    assert not page.locator("[data-figure=scene]").is_visible()
    data = page.evaluate("document.getElementById('scene-still').src").partition("base64,")[2]
    picture = iio.imread(io.BytesIO(base64.b64decode(data)), extension=".png")[..., :3].astype(int)
    assert ((picture.max(axis=2) - picture.min(axis=2)) > 60).mean() > 0.03, "coloured caps on paper, too"
    assert page.evaluate("document.getElementById('scene-still').naturalWidth") >= 800
    assert not page.locator(".tools").first.is_visible()
    widest = "Math.max(...[...document.querySelectorAll('.chart:not(.scene) .main-svg')].map(s => s.clientWidth))"
    page.wait_for_function(f"() => {widest} <= 700", timeout=30_000)
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.wait_for_function(f"() => {widest} > 700")
    # Last: the browser's own events of printing come when it likes.
    paper = page.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True)
    assert paper.startswith(b"%PDF")
    assert opened.errors == []


def test_without_webgl_the_page_says_so(failed_page: Path, browser: object, open_page: Open) -> None:
    opened = open_page(failed_page)
    assert browser is not None
    context = opened.context
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = context.new_page()
    page.goto(failed_page.as_uri())
    page.wait_for_selector("html[data-usable]", state="attached")
    page.click("#open-scene")
    page.wait_for_selector(".missing-view")
    assert page.locator("#scene-still").is_visible(), "the still remains"
    assert "WebGL is off" in page.inner_text(".missing-view")


def test_colour_is_never_alone(tmp_path: Path, open_page: Open) -> None:
    path = tmp_path / "report.html"
    bgars.write_report(inspected("bad", None), path)
    page = open_page(path).page
    for mark in page.locator("#balls .verdict").all():
        assert any(word in mark.inner_text() for word in ("✓ pass", "✕ fail", "? undecided"))
    styles = page.eval_on_selector_all(
        ".mark circle", "all => all.map(c => [c.parentNode.classList[1], getComputedStyle(c).strokeDasharray])"
    )
    assert len(styles) == len(failing().balls)
    assert page.locator("[role=img]:not([aria-label]):not([aria-labelledby])").count() == 0
    assert page.locator("img:not([alt])").count() == 0
    assert passing().verdict == "pass"
