"""What is not known, or too near a limit, is undecided: never a pass."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from bgars.inspection.decision import decide
from bgars.inspection.judge import judge_part
from bgars.records.found_balls import FoundBalls
from bgars.records.measured_balls import BallMeasurement
from bgars.records.part_recipe import Limits
from demo_part import RECIPE, ball_of, changed, good_part
from hypothesis import given, settings
from hypothesis import strategies as st


@pytest.fixture(scope="module")
def good() -> tuple[FoundBalls, BallMeasurement]:
    return good_part()


LENGTHS = ("x_um", "y_um", "diameter_um", "top_um")
UNCERTAINTIES = ("u_x_um", "u_diameter_um", "u_top_um", "u_aspect_ratio", "u_flat_top_depth_um")


@settings(max_examples=60, deadline=None)
@given(
    index=st.integers(0, 19),
    harm=st.sampled_from(
        [
            *LENGTHS,
            *UNCERTAINTIES,
            "aspect_ratio",
            "flat_top_depth_um",
            "reasons",
            "not measured",
            "not found",
            "missing",
        ]
    ),
    own=st.booleans(),
)
def test_never_a_pass_on_a_ball_that_was_not_measured(index: int, harm: str, own: bool) -> None:
    found, measurement = good_part()
    name = found.balls[index].name
    if harm == "reasons":
        measurement = changed(measurement, name, reasons=("too little contrast",))
    elif harm in {"not measured", "not found", "missing"}:
        measurement = replace(measurement, balls=tuple(ball for ball in measurement.balls if ball.name != name))
        if harm != "not measured":
            ball = found.balls[index]
            missing = ((name, ball.row or 0, ball.col or 0),) if harm == "missing" else ()
            found = replace(found, balls=tuple(b for b in found.balls if b.name != name), missing=missing)
    else:
        measurement = changed(measurement, name, **{harm: math.nan})
    # With limits of coplanarity only, lengths and reasons still count; other quantities are then not judged.
    recipe = RECIPE if own else replace(RECIPE, limits=Limits(seating_coplanarity_um=60.0))
    result = judge_part(found, measurement, recipe)
    if own or harm not in {
        "aspect_ratio",
        "flat_top_depth_um",
        "u_aspect_ratio",
        "u_flat_top_depth_um",
        "u_diameter_um",
    }:
        assert result.verdict != "pass"
        assert result.reasons
    json.loads(result.to_json())


@pytest.mark.parametrize("harm", ["board", "board covariance"])
def test_an_unknown_board_leaves_coplanarity_or_warpage_open(
    good: tuple[FoundBalls, BallMeasurement], harm: str
) -> None:
    found, measurement = good
    if harm == "board":
        measurement = replace(measurement, board_coefficients_um=np.full(6, np.nan))
    else:
        measurement = replace(measurement, board_covariance=None)
    result = judge_part(found, measurement, RECIPE)
    assert result.verdict == "undecided"
    assert any("warpage" in reason for reason in result.reasons)


def test_nothing_passes_under_a_light_that_is_not_where_the_rig_says(
    good: tuple[FoundBalls, BallMeasurement],
) -> None:
    found, measurement = good
    change_deg = measurement.light_change_deg.copy()
    change_deg[5] = 4.9
    assert judge_part(found, replace(measurement, light_change_deg=change_deg), RECIPE).verdict == "pass"
    change_deg[5] = 5.6
    result = judge_part(found, replace(measurement, light_change_deg=change_deg), RECIPE)
    assert result.verdict == "undecided"
    assert result.reasons[0].startswith("light 5 (counted from 0) stands 5.6 degrees")


def test_too_near_a_limit_is_undecided(good: tuple[FoundBalls, BallMeasurement]) -> None:
    found, measurement = good
    result = judge_part(found, changed(measurement, "A1", diameter_um=639.8), RECIPE)
    assert result.verdict == ball_of(result, "A1").verdict == "undecided"
    assert "too near its limits" in ball_of(result, "A1").reasons[0]


@pytest.mark.parametrize(
    ("value", "u", "bias", "want"),
    [
        (600.0, 1.0, 0.0, "pass"),
        (638.0, 1.0, 0.0, "pass"),  # on the shrunk limit
        (638.1, 1.0, 0.0, "undecided"),
        (642.0, 1.0, 0.0, "undecided"),
        (642.1, 1.0, 0.0, "fail"),
        (642.1, 1.0, 0.5, "undecided"),  # noise may have made it too large
        (638.1, 1.0, 0.5, "undecided"),  # but does not help it to pass
        (557.9, 1.0, 0.0, "fail"),
        (561.9, 1.0, 0.0, "undecided"),
        (640.0, 0.0, 0.0, "pass"),
        (600.0, math.nan, 0.0, "undecided"),
        (600.0, math.inf, 0.0, "undecided"),
        (600.0, -1.0, 0.0, "undecided"),
        (600.0, 1.0, math.nan, "undecided"),
        (math.nan, 1.0, 0.0, "undecided"),
        (math.inf, 1.0, 0.0, "undecided"),
    ],
)
def test_the_decision_rule(value: float, u: float, bias: float, want: str) -> None:
    assert decide("diameter", value, u, (560.0, 640.0), bias=bias).verdict == want
