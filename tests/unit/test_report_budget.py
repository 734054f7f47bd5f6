"""The page tells what uncertainties are made of, and does not call a place missing that is not seen to be empty."""

from __future__ import annotations

import math
from dataclasses import replace

import bgars
import pytest
from bgars.inspection.budget import COMMON_SOURCES, EACH_LIGHT, OWN_SHAPE, RELIEF, SCATTER, SHIFTS
from bgars.inspection.judge import EACH_BALL
from bgars.inspection.judge_ball import MISSING, UNCLEAR
from bgars.inspection.results import FLAT_TOP
from bgars.inspection.to_scale import SCALE
from bgars.report.figures.balls import part_figure
from bgars.report.figures.maps import deviation_figure
from bgars.report.html.budget import ADVICE, BUDGET_COLUMNS, budget_table, main_causes
from bgars.report.html.page import page_text
from bgars.report.html.source import PageSource
from bgars.report.html.tables import unmeasured
from report_parts import NASTY, failing, passing, simulated
from test_report import Page

STRANGE = f"moonlight {NASTY}"
BUDGET = {
    "x_um": {SCALE: 0.3, SCATTER: 0.1},
    "y_um": {SCALE: 0.4, SCATTER: 0.1},
    "diameter_um": {SCATTER: 0.25},
    "top_um": {SCATTER: 0.6, RELIEF: 0.5, STRANGE: 0.05},
}


def budgeted() -> bgars.PartResult:
    """All balls alike but the first, whose scatter counts most, and those without a height."""
    result = failing()
    first, *others = result.balls
    loud = BUDGET | {"top_um": {SCATTER: 9.0, RELIEF: 0.5}}
    balls = (
        replace(first, budget=loud),
        *(replace(ball, budget=BUDGET) if math.isfinite(ball.top_um) else ball for ball in others),
    )
    return replace(result, balls=balls, seating_budget={RELIEF: 0.7, SCATTER: 0.2})


def unclear() -> bgars.PartResult:
    """The place that the failing part has empty is not seen to be."""
    result = failing()
    balls = [ball if ball.present else replace(ball, verdict="undecided", reasons=(UNCLEAR,)) for ball in result.balls]
    return replace(result, balls=tuple(balls))


def test_the_budget_is_the_median_over_the_balls_the_largest_height_first() -> None:
    result = budgeted().to_dict()
    table = budget_table(result)
    assert table is not None
    assert BUDGET_COLUMNS == ("height", "diameter", "position", "seating coplanarity")
    shown = {row["cause"]: row["cells"] for row in table.rows}
    assert list(shown) == [SCATTER, RELIEF, STRANGE, SCALE]
    assert shown[SCATTER] == ["1.20", "0.50", "0.20", "0.40"]
    assert shown[RELIEF] == ["1.00", "", "", "1.40"]
    assert shown[SCALE][2] == f"{2 * math.sqrt((0.3**2 + 0.4**2) / 2):.2f}", "along one axis"
    u_um = 0.2  # of every length of a measured_part
    assert table.whole == [f"{2 * u_um:.2f}"] * 3 + [f"{2 * result['u_seating_coplanarity_um']:.2f}"]
    assert main_causes(result, 2) == [(SCATTER, 1.2), (RELIEF, 1.0)]


def test_the_page_shows_the_budget_with_advice_and_an_unknown_cause_without() -> None:
    page = Page(page_text(PageSource(budgeted().to_dict())))
    rows = [row[1:] for row in page.rows if row[0] == "-"]
    at = next(index for index, row in enumerate(rows) if row[0] == SCATTER)
    assert rows[at][1:] == ["1.20", "0.50", "0.20", "0.40"]
    assert rows[at + 1] == [ADVICE[SCATTER]]
    strange = next(index for index, row in enumerate(rows) if row[0] == STRANGE)
    assert rows[strange + 1][0] == SCALE, "no advice, and no markup"
    assert any(values.get("href") == "#uncertainty" for _, values in page.elements)


def test_a_result_without_budgets_shows_none_and_says_what_its_u_does_not_know() -> None:
    assert budget_table(passing().to_dict()) is None
    assert main_causes(passing().to_dict()) == []
    text = page_text(PageSource(passing().to_dict()))
    assert "uncertainty is made of" not in text
    assert "#uncertainty" not in text
    assert "its uncertainty is not part of any U" in text
    assert "its uncertainty is not part of any U" not in page_text(PageSource(budgeted().to_dict()))


def test_every_cause_that_the_inspection_names_has_advice() -> None:
    named = {*COMMON_SOURCES.values(), SCATTER, OWN_SHAPE, RELIEF, EACH_LIGHT, SHIFTS, FLAT_TOP, SCALE, EACH_BALL}
    assert set(ADVICE) == named


@pytest.mark.parametrize(
    ("made", "state", "other", "why"),
    [(failing, "missing", "unclear", MISSING), (unclear, "unclear", "missing", UNCLEAR)],
)
def test_only_a_place_that_is_seen_to_be_empty_is_missing(made: object, state: str, other: str, why: str) -> None:
    result = made().to_dict()  # type: ignore[operator]
    text = page_text(PageSource(result))
    page = Page(text)
    place = next(ball["name"] for ball in result["balls"] if not ball["present"])
    row = next(row for row in page.balls if row[0] == place)
    assert row[1].endswith(state)
    assert f"<b>1</b> {state}" in text
    assert f"</b> {other}<" not in text
    classes = [values["class"] or "" for tag, values in page.elements if tag == "g" and "data-ball" in values]
    assert [words for words in classes if state in words.split()] == [f"mark {row[1].split()[1]} {state}"]
    assert not [words for words in classes if other in words.split()]
    assert ("place not clear" in text) == (state == "unclear")
    crosses = [values for tag, values in page.elements if tag == "path"]
    assert len(crosses) == (state == "missing"), "a cross says: no ball"
    assert {"where": place, "what": "everything", "why": why} in unmeasured(result)


def test_pictures_do_not_call_an_unclear_place_missing() -> None:
    result = unclear()
    figures = deviation_figure(result), part_figure(result, simulated("bad")[0])
    for figure in figures:
        legends = [axes.get_legend() for axes in figure.axes if axes.get_legend() is not None] + figure.legends
        assert legends
        for legend in legends:
            words = " ".join(text.get_text() for text in legend.get_texts())
            assert "place not clear" in words
            assert "missing" not in words
