"""What a person reads: counts that add up, one micrometre, names of the page, marks that are explained."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import bgars
from bgars.cli.app import app
from bgars.report.figures.maps import deviation_figure
from bgars.report.figures.style import part_title
from bgars.report.html.page import page_text
from bgars.report.html.scene import view_words
from bgars.report.html.source import PageSource
from bgars.studies.characteristics import CHARACTERISTICS
from bgars.studies.pages import grr_page
from judged_parts import RECIPE, judged
from report_parts import failing, passing
from test_report import Page
from typer.testing import CliRunner


def test_the_banner_counts_every_ball_once() -> None:
    result = failing()
    missing = sum(not ball.present for ball in result.balls)
    assert missing
    text = page_text(PageSource(result.to_dict()))
    line = text[text.index('class="counts"') :].partition("</p>")[0]
    counts = [int(piece.partition("</b>")[0]) for piece in line.split("<b>")[1:]]
    assert sum(counts) == len(result.balls)
    assert f"<b>{missing}</b> missing" in line


def test_pages_say_the_micrometre_in_one_way_and_keep_the_result_as_it_is() -> None:
    result = failing()
    assert any(" um" in reason for reason in result.reasons)
    page = Page(page_text(PageSource(result.to_dict())))
    assert not [cell for row in page.rows for cell in row if " um" in cell]
    assert json.loads(page.scripts["result"])["reasons"] == list(result.reasons)


def test_small_uncertainties_are_not_rounded_to_nothing_in_the_table() -> None:
    result = passing()
    ball = replace(result.balls[0], u_aspect_ratio=0.000294, aspect_ratio=1.000105, u_top_um=0.00042)
    row = next(csv.DictReader(io.StringIO(replace(result, balls=(ball,)).to_csv())))
    assert (row["u_aspect_ratio"], row["aspect_ratio"], row["u_top_um"]) == ("0.000294", "1.000105", "0.00042")


def test_marks_of_the_deviations_are_explained() -> None:
    told = [
        {text.get_text() for text in axes.get_legend().get_texts()}
        for axes in deviation_figure(failing()).axes
        if axes.get_legend() is not None
    ]
    assert told == [
        {"filled: see the colour bar", "orange outline: fails", "white: no height measured", "dashed: missing"},
        {"offset of a ball", "of a ball that fails", "missing"},
    ]
    heights, offsets, *_ = deviation_figure(passing()).axes
    assert [text.get_text() for text in heights.get_legend().get_texts()] == ["filled: see the colour bar"]
    assert [text.get_text() for text in offsets.get_legend().get_texts()] == ["offset of a ball"]


def test_the_page_of_one_ball_counts_whole_balls_and_draws_no_plane_that_is_not_there() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture)
    source = PageSource(result.to_dict())
    text = page_text(source)
    figures = json.loads(Page(text).scripts["page-data"])["figures"]
    assert figures["top_um"]["layout"]["yaxis"]["dtick"] == 1
    assert "seating plane" not in [words for _, words in view_words(source).keys]
    assert "seating plane" in [words for _, words in view_words(PageSource(passing().to_dict())).keys]
    assert f"{result.balls[0].top_um:.2f} <span" not in text, "one value needs no ramp"


def study_of(folder: Path, recipe: bgars.PartRecipe | None) -> Path:
    """Three repeats of one part; without a recipe each result is named after its own folder."""
    for repeat in range(1, 4):
        result = judged(recipe, run=repeat)
        place = folder / str(repeat)
        place.mkdir(parents=True)
        named = result if recipe is not None else replace(result, name=str(repeat))
        (place / "result.json").write_text(named.to_json(), encoding="utf-8")
    return folder


def test_a_study_without_a_recipe_is_named_after_its_folder(tmp_path: Path) -> None:
    folder = study_of(tmp_path / "study", None)
    run = CliRunner().invoke(app, ["grr", str(folder), "-o", str(tmp_path / "out")])
    assert run.stdout.startswith("study: ")
    assert json.loads((tmp_path / "out/grr.json").read_text(encoding="utf-8"))["part"] == "study"
    assert "Gauge study of study" in (tmp_path / "out/grr.html").read_text(encoding="utf-8")
    assert bgars.gauge_rr(bgars.read_study(study_of(tmp_path / "other", RECIPE))).name == "two by three"


def test_warnings_of_a_study_speak_the_words_of_its_page(tmp_path: Path) -> None:
    found = bgars.gauge_rr(bgars.read_study(study_of(tmp_path / "study", RECIPE)))
    assert any("seating coplanarity (" in warning for warning in found.warnings)
    listed = grr_page(found).partition("Warnings:")[2].partition("</ul>")[0]
    assert not [each.name for each in CHARACTERISTICS if each.name.endswith("_um") and each.name in listed]


def test_every_limit_that_a_ball_breaks_is_named_and_places_without_a_ball_are_counted_apart() -> None:
    result = failing()
    broken = {
        ball.name: [reason for reason in ball.reasons if "is outside its limits" in reason]
        for ball in result.balls
        if ball.present and ball.verdict == "fail"
    }
    assert any(len(reasons) > 1 for reasons in broken.values())
    (told,) = [reason for reason in result.reasons if "outside limits:" in reason]
    for name, reasons in broken.items():
        if f"{name} (" in told:
            own = told.partition(f"{name} (")[2].partition(";")[0]
            assert all(reason.partition(" is outside")[0] in own for reason in reasons)
    missing = sum(not ball.present for ball in result.balls)
    assert f"{missing} missing" in part_title(result)
    assert f"{len([b for b in result.balls if b.present and b.verdict == 'fail'])} fail," in part_title(result)
