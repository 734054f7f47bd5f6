"""Gauge R&R against published examples and independent implementations, and on studies of known truth."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pandas as pd
import pytest
from bgars.studies.accuracy import accuracy_figures
from bgars.studies.anova import Anova, crossed_anova
from bgars.studies.characteristics import CHARACTERISTICS
from bgars.studies.gauge import GaugeFigures, gauge_figures
from bgars.studies.gauge_rr import GaugeStudy
from bgars.studies.readings import Readings
from judged_parts import LIMITS, RECIPE, judged, write_study
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

TOP = next(each for each in CHARACTERISTICS if each.name == "top_um")
APPRAISERS = 3
AIAG = """
0.29 0.41 0.64 0.08 0.25 0.07 0.04 -0.11 -0.15
-0.56 -0.68 -0.58 -0.47 -1.22 -0.68 -1.38 -1.13 -0.96
1.34 1.17 1.27 1.19 0.94 1.34 0.88 1.09 0.67
0.47 0.50 0.64 0.01 1.03 0.20 0.14 0.20 0.11
-0.80 -0.92 -0.84 -0.56 -1.20 -1.28 -1.46 -1.07 -1.45
0.02 -0.11 -0.21 -0.20 0.22 0.06 -0.29 -0.67 -0.49
0.59 0.75 0.66 0.47 0.55 0.83 0.02 0.01 0.21
-0.31 -0.20 -0.17 -0.63 0.08 -0.34 -0.46 -0.56 -0.49
2.26 1.99 2.01 1.80 2.12 2.19 1.77 1.45 1.87
-1.36 -1.25 -1.31 -1.68 -1.62 -1.50 -1.49 -1.77 -2.16
"""
"""AIAG, Measurement Systems Analysis, 4th ed., example of chapter III B: a row a part; 3 appraisers with 3 trials."""


def aiag() -> np.ndarray:
    return np.array([[float(x) for x in line.split()] for line in AIAG.split("\n") if line]).reshape(10, APPRAISERS, 3)


def readings(values: np.ndarray) -> Readings:
    return Readings(TOP, tuple((f"p{index}", "") for index in range(len(values))), values, ())


def recipe(tolerance: float) -> bgars.PartRecipe:
    return replace(RECIPE, limits=bgars.Limits(height_um=(500.0, 500.0 + tolerance)))


def row(anova: Anova, source: str) -> tuple[int, float, float]:
    found = next(each for each in anova.rows if each.source == source)
    return found.df, found.ss, found.f


def test_the_published_example_of_aiag() -> None:
    """The manual's tables of the ANOVA method: sums of squares, F, EV, AV, GRR, PV, their shares, ndc = 4."""
    figures = gauge_figures(readings(aiag()), None)
    anova = figures.anova
    assert row(anova, "placement")[:2] == (2, pytest.approx(3.1673, abs=6e-5))
    assert row(anova, "part")[:2] == (9, pytest.approx(88.3619, abs=6e-5))
    assert row(anova, "part x placement")[:2] == (18, pytest.approx(0.3590, abs=6e-5))
    assert row(anova, "repeatability")[:2] == (60, pytest.approx(2.7589, abs=6e-5))
    assert row(anova, "total")[:2] == (89, pytest.approx(94.6471, abs=6e-5))
    assert row(anova, "part x placement")[2] == pytest.approx(0.434, abs=6e-4)
    assert anova.pooled
    published = {"EV": 0.199933, "AV": 0.226838, "interaction": 0.0, "GRR": 0.302373, "PV": 1.042327}
    shares = {"EV": 18.4, "AV": 20.9, "interaction": 0.0, "GRR": 27.9, "PV": 96.0}
    for name, sigma in published.items():
        assert figures.spread(name).sigma == pytest.approx(sigma, abs=2e-6), name
        assert figures.spread(name).percent_study == pytest.approx(shares[name], abs=0.06), name
    assert figures.ndc == 4


def statsmodels_components(values: np.ndarray) -> tuple[dict[str, float], float]:
    """Variance components by another route: statsmodels' table of the same design, combined by the manual's rules."""
    n, k, r = values.shape
    part, placement, _ = np.indices(values.shape)
    table = pd.DataFrame({"y": values.ravel(), "part": part.ravel(), "placement": placement.ravel()})
    full = anova_lm(ols("y ~ C(part) * C(placement)", table).fit())
    p = float(full.loc["C(part):C(placement)", "PR(>F)"])
    if p > 0.25:
        full = anova_lm(ols("y ~ C(part) + C(placement)", table).fit())
        base = error = full.loc["Residual", "mean_sq"]
        both = 0.0
    else:
        error, base = full.loc["Residual", "mean_sq"], full.loc["C(part):C(placement)", "mean_sq"]
        both = max(0.0, (base - error) / r)
    of_part, of_place = (full.loc[f"C({name})", "mean_sq"] for name in ("part", "placement"))
    return {
        "repeatability": error,
        "interaction": both,
        "placement": max(0.0, (of_place - base) / (n * r)),
        "part": max(0.0, (of_part - base) / (k * r)),
    }, p


PYPETB = {
    "AIAG": {"EV": 0.199933, "AV": 0.226838, "interaction": 0.0, "GRR": 0.302372, "PV": 1.042327, "TV": 1.085300},
    "kept": {"EV": 0.149515, "AV": 0.995134, "interaction": 0.584909, "GRR": 1.163944, "PV": 1.225522, "TV": 1.690168},
}
"""Standard deviations that pypetb 1.0.4 (PyPI, `RnR.RnRNumeric`) prints for `aiag()` and `kept()`."""


def kept() -> np.ndarray:
    """Five parts, three placements, three repeats, with an interaction that is not pooled."""
    i, j, k = np.indices((5, 3, 3))
    both = 0.9 * np.sin(3.7 * i * j + 1.0) + 0.2 * np.sin(11 * i + 7 * j + 5 * k)
    return np.round(10.0 + 2.0 * np.sin(2.1 * i) + 0.7 * np.cos(1.3 * j) + both, 3)


@pytest.mark.parametrize("name", list(PYPETB))
def test_the_figures_are_those_of_pypetb(name: str) -> None:
    figures = gauge_figures(readings({"AIAG": aiag, "kept": kept}[name]()), recipe(10.0))
    assert figures.anova.pooled == (name == "AIAG")
    for source, sigma in PYPETB[name].items():
        assert figures.spread(source).sigma == pytest.approx(sigma, abs=6e-7), source
        assert figures.spread(source).percent_tolerance == pytest.approx(60.0 * sigma, abs=4e-5), source


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("interaction", [0.0, 1.5])
def test_the_components_are_those_of_statsmodels(seed: int, interaction: float) -> None:
    random = np.random.default_rng(seed)
    n, k, r = (int(random.integers(2, top)) for top in (9, 5, 5))
    values = 500.0 + 5.0 * random.standard_normal((n, 1, 1)) + random.standard_normal((1, k, 1))
    values = values + interaction * random.standard_normal((n, k, 1)) + 0.5 * random.standard_normal((n, k, r))
    anova = crossed_anova(values)
    expected, p = statsmodels_components(values)
    assert next(each.p for each in anova.rows if each.source == "part x placement") == pytest.approx(p, rel=1e-6)
    for name, variance in expected.items():
        assert getattr(anova, name) == pytest.approx(variance, rel=1e-6, abs=1e-9), name


def test_known_variances_come_back_on_average() -> None:
    random = np.random.default_rng(1)
    truth = {"part": 4.0, "placement": 1.0, "interaction": 0.5, "repeatability": 0.25}
    found = []
    for _ in range(300):
        values = (
            2.0 * random.standard_normal((8, 1, 1))
            + random.standard_normal((1, 6, 1))
            + math.sqrt(0.5) * random.standard_normal((8, 6, 1))
            + 0.5 * random.standard_normal((8, 6, 3))
        )
        anova = crossed_anova(values)
        found.append([getattr(anova, name) for name in truth])
    assert np.mean(found, axis=0) == pytest.approx(list(truth.values()), rel=0.12)


def test_the_interval_of_the_repeatability_holds_it_in_95_of_100_studies() -> None:
    random = np.random.default_rng(2)
    hits = []
    for _ in range(400):
        figures = gauge_figures(readings(random.standard_normal((4, 1, 3)) + np.arange(4.0)[:, None, None]), None)
        hits.append(figures.ev_low < 1.0 < figures.ev_high)
    assert 0.92 < np.mean(hits) < 0.98


def test_designs_with_one_placement_or_one_part_say_only_what_they_know() -> None:
    values = aiag()
    one_place = gauge_figures(readings(values[:, :1]), None)
    assert math.isnan(one_place.spread("AV").sigma)
    assert math.isnan(one_place.spread("interaction").sigma)
    assert one_place.spread("GRR").sigma == one_place.spread("EV").sigma
    assert one_place.spread("PV").sigma > 0
    one_part = gauge_figures(readings(values[:1]), recipe(10.0))
    assert math.isnan(one_part.spread("PV").sigma)
    assert math.isnan(one_part.spread("GRR").percent_study)
    assert one_part.ndc is None
    assert one_part.spread("GRR").percent_tolerance == pytest.approx(60.0 * one_part.spread("GRR").sigma)
    same = gauge_figures(readings(np.full((3, 2, 2), 5.0)), recipe(10.0))
    assert same.spread("GRR").sigma == 0.0
    assert (same.ndc, same.verdict) == (None, "undecided"), "a gauge that never differs is stuck"


@pytest.mark.parametrize(
    "bad", [np.zeros((3, 2)), np.zeros((3, 2, 1)), np.full((2, 2, 2), np.nan), np.zeros((0, 2, 2))]
)
def test_readings_that_are_no_study_are_refused(bad: np.ndarray) -> None:
    with pytest.raises(bgars.InputError, match="readings: must be"):
        crossed_anova(bad)


@pytest.mark.parametrize(("tolerance", "verdict"), [(20.0, "pass"), (10.0, "undecided"), (5.0, "fail")])
def test_the_verdict_goes_by_the_tolerance(tolerance: float, verdict: str) -> None:
    figures = gauge_figures(readings(aiag()), recipe(tolerance))
    percent = 600.0 * 0.302373 / tolerance
    assert figures.spread("GRR").percent_tolerance == pytest.approx(percent, rel=1e-5)
    assert figures.verdict == verdict


BIAS_EXAMPLE = {
    2.0: "2.7 2.5 2.4 2.5 2.7 2.3 2.5 2.5 2.4 2.4 2.6 2.4",
    4.0: "5.1 3.9 4.2 5.0 3.8 3.9 3.9 3.9 3.9 4.0 4.1 3.8",
    6.0: "5.8 5.7 5.9 5.9 6.0 6.1 6.0 6.1 6.4 6.3 6.0 6.1",
    8.0: "7.6 7.7 7.8 7.7 7.8 7.8 7.8 7.7 7.8 7.5 7.6 7.7",
    10.0: "9.1 9.3 9.5 9.3 9.4 9.5 9.5 9.5 9.6 9.2 9.3 9.4",
}
"""AIAG, Measurement Systems Analysis, 4th ed., the example of bias and linearity: 5 references, 12 trials each."""


def test_the_published_linearity_example_of_aiag() -> None:
    values = np.array([[[float(x) for x in line.split()]] for line in BIAS_EXAMPLE.values()])
    references = {(f"p{index}", "", "top_um"): value for index, value in enumerate(BIAS_EXAMPLE)}
    found = accuracy_figures(readings(values), None, references, 1.0)
    assert [bias for _, bias in found.points] == pytest.approx([0.491667, 0.125, 0.025, -0.291667, -0.616667], abs=6e-7)
    assert (found.slope, found.intercept) == (pytest.approx(-0.131667, abs=6e-7), pytest.approx(0.736667, abs=6e-7))
    assert found.bias == pytest.approx(-0.053333, abs=6e-7)
    assert found.linearity == pytest.approx(6 * 0.131667, abs=1e-5)
    assert found.slope_p < 0.01
    assert math.isnan(found.cg), "no limits, no Cg"


def test_cg_and_cgk_of_one_part_follow_their_definition() -> None:
    values = 500.0 + np.random.default_rng(3).standard_normal((2, 1, 25)) * np.array([[[0.1]], [[0.2]]])
    references = {("p0", "", "top_um"): 500.3, ("p1", "", "top_um"): 500.0}
    found = accuracy_figures(readings(values), recipe(10.0), references, 1.0)
    s = values.std(axis=2, ddof=1).ravel()
    expected = (1.0 - np.abs(values.mean(axis=2).ravel() - [500.3, 500.0])) / (3 * s)
    assert (found.cg, found.cg_measurand) == (pytest.approx(2.0 / (6 * s[1])), "p1")
    assert (found.cgk, found.cgk_measurand) == (pytest.approx(expected.min()), f"p{expected.argmin()}")
    assert math.isnan(accuracy_figures(readings(values[:, :, :9]), recipe(10.0), references, 1.0).cg), "too few runs"


def figures_of(found: GaugeStudy, name: str) -> GaugeFigures:
    return next(each for each in found.figures if each.characteristic == name)


def test_a_study_of_results_finds_the_noise_that_went_in(tmp_path: Path) -> None:
    found = bgars.gauge_rr(bgars.read_study(write_study(tmp_path / "s", noise_um=0.3)))
    top = figures_of(found, "top_um")
    assert (top.measurands, top.placements, top.repeats) == (18, 2, 3)
    assert top.ev_low < 0.3 < top.ev_high
    assert top.spread("AV").sigma < 0.15, "nothing but noise between placements"
    assert top.spread("PV").sigma == pytest.approx(4.0, rel=0.5)
    assert top.spread("GRR").percent_tolerance == pytest.approx(100 * 6 * top.spread("GRR").sigma / 80.0)
    assert found.verdict == "pass", found.reasons
    assert figures_of(found, "seating_coplanarity_um").measurands == 3
    assert any("2 placements" in warning for warning in found.warnings)


def test_a_noisy_gauge_fails_and_one_without_limits_is_undecided(tmp_path: Path) -> None:
    noisy = bgars.gauge_rr(bgars.read_study(write_study(tmp_path / "s", noise_um=5.0)))
    assert noisy.verdict == "fail"
    assert any("not fit to judge it" in reason for reason in noisy.reasons)
    for number in (1, 2):
        place = tmp_path / "bare" / str(number)
        place.mkdir(parents=True)
        (place / "result.json").write_text(judged(None, run=number).to_json(), encoding="utf-8")
    bare = bgars.gauge_rr(bgars.read_study(tmp_path / "bare"))
    assert bare.verdict == "undecided"
    assert "no limits" in bare.reasons[-1]
    assert figures_of(bare, "top_um").measurands == 6


def test_a_ball_that_is_measured_in_some_runs_only_is_named_and_nothing_passes(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "s")
    place = folder / "part2" / "place1" / "2"
    lost = judged(part=2, run=1, noise_um=0.2)
    balls = tuple(replace(b, top_um=math.nan, u_top_um=math.nan) if b.name == "B2" else b for b in lost.balls)
    (place / "result.json").write_text(replace(lost, balls=balls).to_json(), encoding="utf-8")
    found = bgars.gauge_rr(bgars.read_study(folder))
    assert found.verdict == "undecided"
    (reason,) = found.reasons
    assert "ball B2 of part part2: measured in 5 of 6 runs" in reason
    assert str(place) in reason
    assert figures_of(found, "top_um").measurands == 17
    assert figures_of(found, "diameter_um").measurands == 18


def test_a_ball_that_is_missing_in_all_runs_is_left_out_and_named(tmp_path: Path) -> None:
    for number in (1, 2):
        place = tmp_path / "s" / str(number)
        place.mkdir(parents=True)
        result = judged(run=number, defects={"B2": bgars.Defect.missing()})
        (place / "result.json").write_text(result.to_json(), encoding="utf-8")
    found = bgars.gauge_rr(bgars.read_study(tmp_path / "s"))
    assert {str(each) for name, each in found.left_out if name == "top_um"} == {
        f"ball B2 of part 1: measured in 0 of 2 runs, not in {tmp_path / 's' / '1'}"
    }
    assert figures_of(found, "top_um").measurands == 5


def test_limits_of_one_side_count_from_zero() -> None:
    widths = {each.name: each.tolerance(replace(RECIPE, limits=LIMITS)) for each in CHARACTERISTICS}
    assert widths == {
        "diameter_um": 80.0,
        "top_um": 80.0,
        "true_position_um": 50.0,
        "aspect_ratio": pytest.approx(0.2),
        "seating_coplanarity_um": 60.0,
        "regression_coplanarity_um": None,
        "pitch_um": 40.0,
        "warpage_um": 50.0,
    }
