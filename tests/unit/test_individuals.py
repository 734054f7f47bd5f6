"""Charts of single parts, Nelson's rules, and charts of what a store is asked."""

from __future__ import annotations

import json
import math
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.studies.control_chart import c4, control_chart, individuals_chart
from bgars.studies.nelson import NELSON, nelson_signals, parse_rules
from bgars.studies.query_chart import query_charts
from bgars.studies.trend import MOVING_RANGE_DF
from judged_parts import write_results
from stored_parts import filled_store
from typer.testing import CliRunner

PATTERNS = {
    2: [0.5] * 9,
    3: [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0],
    4: [0.5, -0.5] * 7,
    5: [2.5, 0.0, 2.5],
    6: [1.5, 1.5, -0.5, 1.5, 1.5],
    7: [0.5, 0.4, -0.5] * 5,
    8: [1.5, 1.4, -1.5, -1.4, 1.5, 1.4, -1.5, -1.4],
}


@pytest.mark.parametrize(
    ("rule", "values"), [(5, [2.5, 2.5]), (5, [2.5, 0.0, 2.5]), (6, [1.5] * 4), (6, [1.5, 0.0, 1.5, 1.5, 1.5])]
)
def test_a_pattern_at_the_beginning_of_a_chart_is_found(rule: int, values: list[float]) -> None:
    deviations = np.array([*values, 0.0, 0.0])
    assert list(nelson_signals(deviations, [rule])) == [(len(values) - 1, NELSON[rule])]
    assert list(nelson_signals(deviations[1:], [rule])) == []


def test_zone_rules_look_at_the_beginning_too() -> None:
    means = np.array([2.5, 2.5, *[-0.2] * 25])  # around 0
    half = 2.0 * c4(2)  # half a subgroup of two apart, such that the means have a sigma of 1
    chart = control_chart(np.stack([means - half / 2, means + half / 2], axis=1), zone_rules=True)
    assert (1, "2 of 3 beyond 2 sigma on one side") in {(each.subgroup, each.rule) for each in chart.signals}


@pytest.mark.parametrize("rule", PATTERNS)
def test_each_rule_of_nelson_is_found_where_it_is_complete_and_not_before(rule: int) -> None:
    values = np.array(PATTERNS[rule])
    assert list(nelson_signals(values, [rule])) == [(len(values) - 1, NELSON[rule])]
    assert list(nelson_signals(values[:-1], [rule])) == []
    assert list(nelson_signals(-values, [rule])) == [(len(values) - 1, NELSON[rule])]


def test_rules_are_chosen_by_number() -> None:
    assert parse_rules("5, 2,2") == (2, 5)
    assert parse_rules("all") == (1, 2, 3, 4, 5, 6, 7, 8)
    with pytest.raises(bgars.InputError, match=r"nelson: knows the rules 1 to 8.*got '9'"):
        parse_rules("1,9")


def test_moving_ranges_give_sigma_with_its_degrees_of_freedom() -> None:
    draws = np.random.default_rng(3).normal(5.0, 2.0, (4000, 60))
    sigmas = np.array([individuals_chart(row).sigma for row in draws])
    assert sigmas.mean() == pytest.approx(2.0, rel=0.01)
    df = 1.0 / (2.0 * (sigmas.std() / sigmas.mean()) ** 2)
    assert df / 60 == pytest.approx(MOVING_RANGE_DF, abs=0.03)
    outside = [np.mean([s.chart == "mean" for s in individuals_chart(row).signals] or [0]) > 0 for row in draws[:500]]
    assert np.mean(outside) < 0.3, "0.27 % of 60 values"


def test_fourteen_parts_are_fourteen_points_with_serials_and_times(tmp_path: Path) -> None:
    write_results(tmp_path / "r", 14)
    run = CliRunner().invoke(app, ["spc", str(tmp_path / "r*"), "-o", str(tmp_path / "out"), "--json", "--nelson", "2"])
    told = json.loads(run.output)
    assert (told["subgroup"], len(told["trends"][0]["chart"]["means"])) == (1, 14)
    assert told["serials"] == ["SN-1"] * 14
    page = (tmp_path / "out" / "spc.html").read_text(encoding="utf-8")
    assert "each a point (I-MR)" in page
    five = bgars.process_trend(bgars.read_results([tmp_path / "r"])[0], subgroup=5)
    single = bgars.process_trend(bgars.read_results([tmp_path / "r"])[0], subgroup=1)
    one, two = (next(t for t in found.trends if t.characteristic == "top_um") for found in (five, single))
    assert two.sigma_within == pytest.approx(one.sigma_overall, rel=0.25)
    assert math.isfinite(two.within.centred.value)


def test_a_store_is_charted_in_the_order_in_which_parts_came(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 8)
    results, _ = bgars.read_results([store.folder], where="lot = 'L0'")
    assert [result.serial for _, result in results] == ["SN0000", "SN0002", "SN0004", "SN0006"]
    with pytest.raises(bgars.InputError, match="has no parts where lot = 'x'"):
        bgars.read_results([store.folder], where="lot = 'x'")
    with pytest.raises(bgars.InputError, match="where: goes with a store"):
        bgars.read_results([write_results(tmp_path / "r", 3)], where="lot = 'x'")


def test_any_question_is_charted(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 8)
    sql = "select serial, mean_top_um, warpage_um, verdict from parts order by sequence"
    charts = query_charts(store, sql)
    assert [(each.title, each.unit, len(each.labels)) for each in charts] == [
        ("mean_top_um", "µm", 8),
        ("warpage_um", "µm", 8),
    ]
    assert charts[0].labels[3] == "SN0003\nfail"
    run = CliRunner().invoke(app, ["spc", str(store.folder), "--query", sql, "-o", str(tmp_path / "out"), "--json"])
    assert json.loads(run.output)["charts"][0]["characteristic"] == "mean_top_um"
    assert "SN0003" in (tmp_path / "out" / "spc.html").read_text(encoding="utf-8") or run.exit_code == 0
    with pytest.raises(bgars.InputError, match="must say in which order its rows are charted, such as ORDER BY"):
        query_charts(store, "select mean_top_um from parts")
    for option in ("--where=lot = 'x'", "--subgroup=5", "--target=2"):
        run = CliRunner().invoke(app, ["spc", str(store.folder), "--query", sql, "-o", str(tmp_path / "no"), option])
        assert f"{option.partition('=')[0]}: does not go with --query" in str(run.exception)
    assert not (tmp_path / "no").exists()
    with pytest.raises(bgars.InputError, match="must give a column of numbers"):
        query_charts(store, "select serial from parts order by serial")
    with pytest.raises(bgars.InputError, match="at least 3 rows"):
        query_charts(store, "select 1.0 as x order by x")
    with pytest.raises(
        bgars.InputError, match=r"query: x: must be within -1e\+100 and 1e\+100 to be charted, got 1e\+308"
    ):
        query_charts(store, "select 1e308 as x from range(4) order by x")
    with pytest.raises(bgars.InputError, match="values: must be finite"):
        individuals_chart(np.array([1.0, np.nan, 2.0]))
