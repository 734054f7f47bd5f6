"""Control charts and capability: against tables, known coverage, and trends that were put in."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import bgars
import numpy as np
import pytest
from bgars.studies.capability import capability
from bgars.studies.control_chart import c4, control_chart
from bgars.studies.spc_figures import trend_figure
from bgars.studies.trend import Trend
from judged_parts import RECIPE, judged, write_results
from matplotlib.backends.backend_agg import FigureCanvasAgg


@pytest.mark.parametrize(
    ("size", "a3", "b3", "b4"), [(2, 2.659, 0.0, 3.267), (5, 1.427, 0.0, 2.089), (10, 0.975, 0.284, 1.716)]
)
def test_limits_follow_the_tabulated_factors(size: int, a3: float, b3: float, b4: float) -> None:
    """A3, B3 and B4 of ISO 7870-2, table 2."""
    values = np.random.default_rng(size).normal(10.0, 2.0, (30, size))
    chart = control_chart(values)
    s = chart.spread_centre
    assert chart.high - chart.centre == pytest.approx(a3 * s, rel=5e-4)
    assert chart.centre - chart.low == pytest.approx(a3 * s, rel=5e-4)
    assert (chart.spread_low, chart.spread_high) == (
        pytest.approx(b3 * s, abs=1e-3 * s),
        pytest.approx(b4 * s, rel=5e-4),
    )
    assert chart.sigma == pytest.approx(s / c4(size))


def test_c4_is_the_mean_of_standard_deviations() -> None:
    draws = np.random.default_rng(0).standard_normal((200_000, 4)).std(axis=1, ddof=1)
    assert draws.mean() == pytest.approx(c4(4), abs=3e-3)


def test_a_stable_process_gives_few_signals_and_a_shift_gives_one() -> None:
    random = np.random.default_rng(4)
    charts = [control_chart(random.standard_normal((25, 5))) for _ in range(200)]
    rate = np.mean([sum(signal.chart == "mean" for signal in chart.signals) for chart in charts]) / 25
    assert rate < 0.008, "0.27 % with known limits"
    shifted = random.standard_normal((25, 5))
    shifted[20:] += 3.0
    assert {20, 21, 22, 23, 24} <= {s.subgroup for s in control_chart(shifted).signals if s.chart == "mean"}


def pattern(deviations: list[float]) -> list[tuple[int, str]]:
    """Signals of means that lie so many sigma of the mean off, in a chart with wide calm ends."""
    calm = [0.1, -0.1] * 40
    means = np.array([*calm, *deviations, *calm])
    half = math.sqrt(2.0) * c4(2)
    chart = control_chart(np.stack([means - half / 2, means + half / 2], axis=1), zone_rules=True)
    scale = (chart.high - chart.centre) / 3.0
    chart = control_chart(np.stack([means * scale - half / 2, means * scale + half / 2], axis=1), zone_rules=True)
    return [(signal.subgroup - len(calm), signal.rule) for signal in chart.signals]


def test_each_western_electric_pattern_is_found_where_it_is_complete() -> None:
    assert pattern([2.5, 0.0, 2.5]) == [(2, "2 of 3 beyond 2 sigma on one side")]
    assert pattern([2.5, 0.0, -2.5]) == []
    assert (4, "4 of 5 beyond 1 sigma on one side") in pattern([1.5, 1.5, -0.5, 1.5, 1.5])
    assert (8, "8 in a row on one side") in pattern([-0.5, *[0.5] * 8])
    assert pattern([-0.5, *[0.5] * 6, -0.5]) == []
    assert pattern([3.6]) == [(0, "beyond 3 sigma")]


def test_the_intervals_hold_the_truth_in_95_of_100_processes() -> None:
    random = np.random.default_rng(5)
    hits = []
    for _ in range(2000):
        x = random.normal(1.0, 1.0, 60)
        found = capability(float(x.mean()), float(x.std(ddof=1)), (-5.0, 5.0), count=60, df=59)
        hits.append(
            (found.centred.low < 4.0 / 3.0 < found.centred.high, found.spread.low < 5.0 / 3.0 < found.spread.high)
        )
    assert np.mean(hits, axis=0) == pytest.approx([0.95, 0.95], abs=0.02)


def test_one_limit_gives_no_cp_and_no_spread_gives_nothing() -> None:
    one = capability(1.0, 1.0, (None, 4.0), count=10, df=9)
    assert math.isnan(one.spread.value)
    assert one.centred.value == 1.0
    assert math.isnan(capability(1.0, 0.0, (0.0, 4.0), count=10, df=9).centred.value)
    assert math.isnan(capability(1.0, 1.0, (None, None), count=10, df=9).centred.value)


def top_of(found: bgars.ProcessTrend) -> Trend:
    return next(trend for trend in found.trends if trend.characteristic == "top_um")


def test_a_trend_of_simulated_parts_states_their_spread(tmp_path: Path) -> None:
    results, warnings = bgars.read_results([write_results(tmp_path / "r", 40)])
    found = bgars.process_trend(results, warnings=warnings)
    top = top_of(found)
    assert top.readings == 240
    # The jitter's 4 um are cut off at 2.5 sigma, which leaves 0.955 of them; the noise adds 0.3 um.
    sigma = math.hypot(0.955 * 4.0, 0.3)
    assert top.sigma_overall == pytest.approx(sigma, rel=0.15)
    assert top.overall.centred.low < 40.0 / (3.0 * sigma) < top.overall.centred.high
    assert top.effective <= 240.0
    assert top.verdict == "pass", top.reason
    assert found.times[0] == "2026-01-01T00:00:00Z"
    assert "8 subgroups" in found.warnings[0]


def test_a_jump_is_a_signal_and_nothing_passes(tmp_path: Path) -> None:
    results, _ = bgars.read_results([write_results(tmp_path / "r", 40, top_um=8.0)])
    found = bgars.process_trend(results)
    assert top_of(found).verdict == "undecided"
    assert "not in control" in top_of(found).reason
    reasons = [trend.reason for trend in (*found.trends, *bgars.process_trend(results, subgroup=1).trends)]
    assert not any("1 signals" in reason or "mean of part" in reason for reason in reasons), "a single part has a value"
    assert found.verdict == "undecided"
    assert top_of(found).sigma_within < top_of(found).sigma_overall


def test_a_process_outside_its_limits_fails(tmp_path: Path) -> None:
    results, _ = bgars.read_results([write_results(tmp_path / "r", 10, top_um=45.0)])
    found = bgars.process_trend(results)
    assert found.verdict == "fail"
    assert top_of(found).outside > 10
    assert "readings are outside the limits" in found.reasons[0]


def test_balls_that_move_together_count_for_fewer_readings() -> None:
    random = np.random.default_rng(6)
    results = []
    for number in range(20):
        result = judged(part=1, run=number, noise_um=0.05)
        shift = 3.0 * random.standard_normal()
        balls = tuple(replace(ball, top_um=ball.top_um + shift) for ball in result.balls)
        results.append((f"r{number}", replace(result, balls=balls)))
    together = top_of(bgars.process_trend(results))
    assert together.readings == 120
    assert together.effective == pytest.approx(20.0, rel=0.02)


def test_the_order_is_that_of_time_else_of_names(tmp_path: Path) -> None:
    results = [judged(run=number) for number in range(3)]
    stamps = ["2026-01-03T00:00:00Z", "2026-01-01T00:00:00Z", "2026-01-02T00:00:00Z"]
    for number, (result, stamp) in enumerate(zip(results, stamps, strict=True)):
        place = tmp_path / f"r{10 - number}"
        place.mkdir()
        (place / "result.json").write_text(replace(result, inspected_utc=stamp).to_json(), encoding="utf-8")
    ordered, warnings = bgars.read_results([tmp_path])
    assert [Path(name).parent.name for name, _ in ordered] == ["r9", "r8", "r10"]
    assert warnings == ()
    (tmp_path / "r9" / "result.json").write_text(replace(results[1], inspected_utc="").to_json(), encoding="utf-8")
    ordered, warnings = bgars.read_results([tmp_path])
    assert [Path(name).parent.name for name, _ in ordered] == ["r8", "r9", "r10"]
    assert "1 results have no time" in warnings[0]


def test_a_ball_that_is_missing_in_a_part_keeps_the_process_from_passing(tmp_path: Path) -> None:
    folder = write_results(tmp_path / "r", 20)
    lost = judged(part=1, run=1, defects={"B2": bgars.Defect.missing()})
    lost = replace(lost, inspected_utc="2026-01-01T00:00:00Z")
    (folder / "r0" / "result.json").write_text(lost.to_json(), encoding="utf-8")
    found = bgars.process_trend(bgars.read_results([folder])[0])
    assert top_of(found).left_out == ("B2",)
    assert top_of(found).verdict == "undecided"
    assert "not measured in every part: B2" in top_of(found).reason


def test_what_is_no_process_is_refused() -> None:
    few = [("a", judged())] * 3
    with pytest.raises(bgars.InputError, match=r"results: must be at least 10 \(2 subgroups of 5\), got 3"):
        bgars.process_trend(few)
    with pytest.raises(bgars.InputError, match="subgroup: must be 1 or more parts, got 0"):
        bgars.process_trend(few, subgroup=0)
    with pytest.raises(bgars.InputError, match="target: must be above 0"):
        bgars.process_trend(few, target=math.nan)
    with pytest.raises(bgars.InputError, match="subgroups: must be"):
        control_chart(np.zeros((1, 5)))
    with pytest.raises(bgars.InputError, match="subgroups: must be finite"):
        control_chart(np.full((3, 5), np.nan))
    assert RECIPE.limits


def test_labels_of_close_control_limits_do_not_overlap() -> None:
    """Out of control, limits lie close together beside far means: their labels lay on top of each other."""
    random = np.random.default_rng(3)
    means = np.linspace(599.0, 603.0, 6)
    chart = control_chart(means[:, None] + 0.1 * random.standard_normal((6, 5)))
    assert chart.signals
    figure = trend_figure(SimpleNamespace(chart=chart, unit="µm"))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for axes in figure.axes:
        boxes = [text.get_window_extent(canvas.get_renderer()) for text in axes.texts]
        assert len(boxes) == 3
        boxes.sort(key=lambda box: box.y0)
        for below, above in pairwise(boxes):
            assert below.y1 <= above.y0
