"""The page of an inspection: whole, escaped, the same each time, and its numbers are those of the result."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from unittest.mock import patch

import bgars
import numpy as np
import plotly.graph_objects
import pytest
from bgars.cli.app import app
from bgars.records.reflectance_fit import loss_in_words
from bgars.report import painter
from bgars.report.html.material import material_facts
from bgars.report.html.mesh import unpacked
from bgars.report.html.page import page_text
from bgars.report.html.photograph import photograph_of
from bgars.report.html.source import PageSource, read_page_source
from bgars.report.html.units import with_micro
from bgars.report.html.words import QUANTITIES, expanded, number
from hypothesis import given, settings
from hypothesis import strategies as st
from report_parts import NASTY, RESULTS, failing, hostile, passing, simulated
from typer.testing import CliRunner


class Page(HTMLParser):
    """Scripts, elements with their attributes, and cells of the table of balls."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts: dict[str, str] = {}
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self._script = ""
        self._cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.elements.append((tag, values))
        if tag == "script":
            self._script = values.get("id") or f"script {len(self.scripts)}"
            self.scripts[self._script] = ""
        if tag == "tr":
            self.rows.append([] if "data-ball" in values else ["-"])
        if tag in {"td", "th"} and self.rows:
            self.rows[-1].append("")
            self._cell = True

    def handle_endtag(self, tag: str) -> None:
        if tag == "script":
            self._script = ""
        if tag in {"td", "th"}:
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._script:
            self.scripts[self._script] += data
        elif self._cell:
            self.rows[-1][-1] += data

    @property
    def balls(self) -> list[list[str]]:
        return [row for row in self.rows if row and row[0] != "-"]


@pytest.fixture(params=RESULTS)
def result(request: pytest.FixtureRequest) -> bgars.PartResult:
    return RESULTS[request.param]()


def test_every_kind_of_result_makes_a_page_with_its_own_numbers(result: bgars.PartResult) -> None:
    text = page_text(PageSource(result.to_dict()))
    assert text == page_text(PageSource(result.to_dict())), "the same result, the same page"
    page = Page(text)
    assert json.loads(page.scripts["result"]) == result.to_dict()
    assert [row[0] for row in page.balls] == [ball.name for ball in result.balls]
    first = 4
    for row, ball in zip(page.balls, result.balls, strict=True):
        for at, quantity in enumerate(QUANTITIES):
            shown, _, u = row[first + at].partition(" ± ")
            value = ball.to_dict()[quantity.name]
            assert shown == number(value, quantity.digits)
            if u:
                assert u == number(expanded(ball.to_dict()[quantity.u_name]), quantity.digits)
        assert row[-1] == with_micro("; ".join(ball.reasons))
    assert f"</span> {result.verdict.upper()}</p>" in text


def test_every_chart_is_a_valid_plotly_figure(result: bgars.PartResult) -> None:
    page = Page(page_text(PageSource(result.to_dict())))
    figures = json.loads(page.scripts["page-data"])["figures"]
    if "scene-data" in page.scripts:
        figures["scene"] = json.loads(page.scripts["scene-data"])
    for figure in figures.values():
        plotly.graph_objects.Figure(figure)
    assert {tag["data-figure"] for _, tag in page.elements if "data-figure" in tag} == set(figures)


def test_no_text_becomes_markup() -> None:
    plain, page = (Page(page_text(PageSource(made().to_dict()))) for made in (failing, hostile))
    assert [tag for tag, _ in page.elements].count("script") == [tag for tag, _ in plain.elements].count("script") == 5
    pictures = [values["src"] or "" for tag, values in page.elements if tag == "img"]
    assert [picture[:22] for picture in pictures] == ["data:image/png;base64,"], "the still of the 3-D view"
    assert not any(name.startswith("on") for _, values in page.elements for name in values)
    assert NASTY in page.balls[0][0], "shown as it is"
    for figure in json.loads(page.scripts["page-data"])["figures"].values():
        assert "<img" not in json.dumps(figure).lower()


def test_the_page_names_no_address_and_allows_none() -> None:
    page = Page(page_text(PageSource(failing().to_dict())))
    policy = next(v["content"] for tag, v in page.elements if tag == "meta" and v.get("http-equiv"))
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-eval" not in policy
    assert "unsafe-inline" not in policy.split("style-src")[0]
    for _, values in page.elements:
        for name in ("src", "href", "action"):
            assert re.match(r"#|data:|$", values.get(name) or ""), values


def test_the_material_is_told_parameter_by_parameter() -> None:
    result = failing()
    page = Page(page_text(PageSource(result.to_dict())))
    rows = [row[1:] for row in page.rows if row[0] == "-" and row[-1] in {"ratio", "grey levels of 255"}]
    assert result.material is not None
    assert [row[1] for row in rows] == [row.name for row in result.material.parameters]
    told = {row[1]: row[2:] for row in rows}
    assert told["diffuse_level"] == ["31.50", "0.21", "grey levels of 255"]
    assert told["roughness_1"] == ["0.2000", "0.0012", "ratio"]
    assert told["strength_1_level"] == ["255.0", "1.9", "grey levels of 255"]
    assert told["gain_0"] == ["1.000", "not fitted", "ratio"]
    assert rows[-1][0].startswith("brightness of light 3")
    for loss, accepted in ((0.102, True), (0.6, True), (2.5, False)):
        other = replace(result, material=replace(result.material, loss=loss, accepted=accepted)).to_dict()
        words = f"{loss:.3f}: one material explains the balls {loss_in_words(loss, accepted=accepted)}"
        assert ("loss", words) in material_facts(other), "as bgars calibrate material says"
    without = page_text(PageSource(replace(result, material=None).to_dict()))
    assert "No material was fitted" in without


def test_histograms_count_every_measured_ball() -> None:
    result = failing()
    figures = json.loads(Page(page_text(PageSource(result.to_dict()))).scripts["page-data"])["figures"]
    whole = [ball for ball in result.balls if ball.present and ball.kind == "ball"]
    assert sum(figures["diameter_um"]["data"][0]["y"]) == len(whole)
    limits = {shape["x0"] for shape in figures["diameter_um"]["layout"]["shapes"] if shape["type"] == "line"}
    assert limits == {560.0, 640.0}


def test_the_3d_view_is_the_measurement() -> None:
    """Caps reach from the equator to the measured top, skirts end on the board, planes touch the seats."""
    result = failing()
    scene = json.loads(Page(page_text(PageSource(result.to_dict()))).scripts["scene-data"])
    traces = {trace["name"]: trace for trace in scene["data"]}
    cap, skirt = traces["balls, measured (equator up)"], traces["below the equator: drawn, not measured"]
    drawn = [ball for ball in result.balls if np.isfinite(ball.top_um)]
    assert {ball.name for ball in result.balls} - {ball.name for ball in drawn} == {"B2", "C2", "C3"}
    c = result.board_coefficients_um
    for trace, low, high in ((cap, "centre_z_um", "top_um"), (skirt, "", "centre_z_um")):
        x, y, z = (unpacked(trace[axis]).reshape(len(drawn), -1) for axis in "xyz")
        z = z - (c[0] + c[1] * x + c[2] * y + c[3] * x**2 + c[4] * x * y + c[5] * y**2)
        np.testing.assert_allclose(z.max(axis=1), [getattr(ball, high) for ball in drawn], atol=0.05)
        np.testing.assert_allclose(z.min(axis=1), [getattr(ball, low) if low else 0 for ball in drawn], atol=0.05)
        faces = np.stack([unpacked(trace[axis]) for axis in "ijk"])
        assert faces.max() == x.size - 1
    for name, key in (("seating plane", "seating_deviation_um"), ("regression plane", "regression_deviation_um")):
        plane = traces[name]
        corners = np.array([(x, y) for y in unpacked(plane["y"]) for x in unpacked(plane["x"])])
        terms = np.column_stack([np.ones(4), corners])
        fit = np.linalg.lstsq(terms, np.ravel(unpacked(plane["z"])), rcond=None)[0]
        below = [fit @ [1, ball.x_um, ball.y_um] - ball.top_um for ball in drawn]
        np.testing.assert_allclose(below, [getattr(ball, key) for ball in drawn], atol=0.05)


def test_report_again_from_the_folder(tmp_path: Path) -> None:
    capture, _ = simulated("bad")
    result = failing()
    (tmp_path / "result.json").write_text(result.to_json(), encoding="utf-8")
    files = bgars.write_report(result, tmp_path / "report.html", capture=capture)
    assert set(files) == {"report.html", "photograph.jpg", "report.json"}
    first = (tmp_path / "report.html").read_bytes()
    for place in (tmp_path, tmp_path / "result.json"):
        run = CliRunner().invoke(app, ["report", str(place), "-o", str(tmp_path / "again.html")])
        assert run.exit_code == 0
        assert (tmp_path / "again.html").read_bytes() == first
    (tmp_path / "photograph.jpg").unlink()
    bgars.write_report(tmp_path, tmp_path / "again.html")
    assert "No photograph is stored with" in (tmp_path / "again.html").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.iterdir()} == {"result.json", "report.html", "report.json", "again.html"}


def test_the_photograph_lies_under_the_balls() -> None:
    """A simulated ball is brighter or darker than its board; its centre in the picture is where the result says."""
    capture, _ = simulated("good")
    source = PageSource(passing().to_dict(), photograph_of(capture))
    page = Page(page_text(source))
    image = next(values for tag, values in page.elements if tag == "image")
    rows, cols = capture.mask.shape
    assert float(image["width"] or 0) == pytest.approx(cols * 25.0)
    assert float(image["height"] or 0) == pytest.approx(rows * 25.0)
    circles = [values for tag, values in page.elements if tag == "circle"]
    for circle, ball in zip(circles, passing().balls, strict=True):
        # From the picture's corner, through the photograph's corner, to the image's centre.
        x_um = float(circle["cx"] or 0) - float(image["x"] or 0) - cols * 25.0 / 2
        y_um = rows * 25.0 / 2 - (float(circle["cy"] or 0) - float(image["y"] or 0))
        assert (x_um, y_um) == pytest.approx((ball.x_um, ball.y_um), abs=0.02)


def test_a_capture_that_is_not_the_results_is_refused(tmp_path: Path) -> None:
    capture, _ = simulated("good")
    with pytest.raises(bgars.InputError, match="must have the 4 lights"):
        bgars.write_report(passing(), tmp_path / "a.html", capture=replace(capture, images=capture.images[:3]))
    with pytest.raises(bgars.InputError, match="pixel_pitch_um"):
        bgars.write_report(passing(), tmp_path / "a.html", capture=replace(capture, pixel_pitch_um=None))
    with pytest.raises(bgars.InputError, match=r"must end in \.html"):
        bgars.write_report(passing(), tmp_path / "result.json")
    with pytest.raises(bgars.InputError, match="must not be given with the path"):
        bgars.write_report(tmp_path, tmp_path / "a.html", capture=capture)
    assert list(tmp_path.iterdir()) == []


def broken(**changes: object) -> str:
    values = passing().to_dict()
    for path, value in changes.items():
        place, *keys = path.split("__")
        target: Any = values
        for key in [place, *keys][:-1]:
            target = target[int(key) if key.isdigit() else key]
        last = [place, *keys][-1]
        if value is Ellipsis:
            del target[last]
        else:
            target[int(last) if last.isdigit() else last] = value
    return json.dumps(values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "JSON"),
        ('{"name": NaN}', "NaN"),
        ("[" * 100_000, "JSON"),
        (broken(pitch_um="wide"), "pitch_um"),
        (broken(balls__2__top_um=...), "balls.*top_um"),
        (broken(balls__0__verdict="perhaps"), "balls.*verdict"),
        (broken(light_directions=[[1, 2]]), "light_directions"),
        (broken(recipe="part.toml"), "recipe"),
    ],
)
def test_a_result_that_is_none_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "result.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match=words) as caught:
        bgars.write_report(tmp_path, tmp_path / "report.html")
    assert str(file) in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just([]), st.just({}),
    st.sampled_from([[None], 0, 0.0, -1.0, 1e-300, 1e300, 10**400, "pass", [1.0, 2.0]]),
    st.sampled_from([{"limits": 3}, {"limits": {"aspect_ratio": [1]}}]),
)  # fmt: skip


@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_a_damaged_result_makes_a_page_or_a_clear_error(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """One value anywhere becomes any other: never a traceback of anything but the file's own error."""
    values: Any = json.loads(failing().to_json())
    target = values
    while True:
        keys = list(target) if isinstance(target, dict) else list(range(len(target)))
        key = data.draw(st.sampled_from(keys))
        child = target[key]
        if not isinstance(child, dict | list) or not child or data.draw(st.integers(0, 5)) == 0:
            break
        target = child
    target[key] = data.draw(VALUES)
    file = tmp_path_factory.mktemp("damaged") / "result.json"
    file.write_text(json.dumps(values), encoding="utf-8")
    # Of as many pixels as are shown: that nothing breaks is asked, not how smooth edges are.
    with patch.object(painter, "SUPERSAMPLE", 1), suppress(bgars.FileFormatError):
        json.loads(Page(page_text(read_page_source(file))).scripts["page-data"])


def test_a_board_at_an_absurd_height_has_no_still() -> None:
    """All its places fall together in floating point: the still has no width to divide by."""
    values = failing().to_dict()
    values["board_coefficients_um"][0] = 2.2353734930616452e21
    tags = [tag for tag, _ in Page(page_text(PageSource(values))).elements]
    assert "svg" in tags
    assert "img" not in tags


def test_what_lies_beside_a_result_is_checked(tmp_path: Path) -> None:
    capture, _ = simulated("good")
    (tmp_path / "result.json").write_text(passing().to_json(), encoding="utf-8")
    bgars.write_report(passing(), tmp_path / "report.html", capture=capture)
    assert read_page_source(tmp_path).photograph is not None
    jpeg = (tmp_path / "photograph.jpg").read_bytes()
    (tmp_path / "photograph.jpg").write_bytes(jpeg[:-50])
    with pytest.raises(bgars.FileFormatError, match=r"photograph\.jpg: must be a whole JPEG"):
        bgars.write_report(tmp_path, tmp_path / "report.html")
    (tmp_path / "report.json").write_text('{"photograph": 3}', encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match=r"report\.json: is not what"):
        bgars.write_report(tmp_path, tmp_path / "report.html")


def test_without_a_result_the_message_says_who_writes_one(tmp_path: Path) -> None:
    with pytest.raises(
        bgars.FileFormatError, match=r"holds no result\.json: neither a folder that bgars inspect wrote"
    ):
        bgars.write_report(tmp_path, tmp_path / "report.html")
