"""Verdicts: right on parts of known truth, and never a pass on what was not measured."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.inspection.judge import judge_part
from bgars.records.ball_layout import BallLayout
from bgars.records.found_balls import FoundBall, FoundBalls
from bgars.records.measured_balls import BallMeasurement, MeasuredBall
from bgars.records.part_recipe import Limits, PartRecipe
from demo_part import CAMERA, LIMITS, RECIPE, ball_of, good_part, simulated
from synthetic_parts import measured_part


@pytest.fixture(scope="module")
def good() -> tuple[FoundBalls, BallMeasurement]:
    return good_part()


def test_a_good_part_passes(good: tuple[FoundBalls, BallMeasurement]) -> None:
    result = judge_part(*good, RECIPE)
    assert result.verdict == "pass"
    assert result.reasons == ()
    assert {ball.verdict for ball in result.balls} == {"pass"}
    assert len(result.balls) == 20
    assert all(check.verdict == "pass" for check in result.checks)


def test_readings_are_the_truth_within_their_uncertainty() -> None:
    truth = simulated(board=bgars.Board(bow_um=30.0, bow_radius_um=3000.0, tilt_x_deg=0.4))
    result = judge_part(*measured_part(truth), RECIPE)
    assert truth.seating is not None
    assert truth.regression is not None
    for reading, u, bias, true in (
        (
            result.seating_coplanarity_um,
            result.u_seating_coplanarity_um,
            result.seating_noise_bias_um,
            truth.seating_coplanarity_um,
        ),
        (
            result.regression_coplanarity_um,
            result.u_regression_coplanarity_um,
            result.regression_noise_bias_um,
            truth.regression_coplanarity_um,
        ),
    ):
        assert true is not None
        assert -3 * u <= reading - true <= 3 * u + bias
    deviations = [ball.seating_deviation_um for ball in result.balls]
    np.testing.assert_allclose(deviations, truth.seating.deviations_um, atol=2.5)
    assert result.warpage_um == pytest.approx(30.0 * (2000.0**2 + 1500.0**2) / 3000.0**2, rel=0.02)


@pytest.mark.parametrize(
    ("defect", "words"),
    [
        (bgars.Defect.missing(), "no ball at its place"),
        (bgars.Defect.offset(70.0, 40.0), "true position"),
        (bgars.Defect.size(0.8), "diameter"),
        (bgars.Defect.size(1.15), "diameter"),
        (bgars.Defect.flattened(0.85, 1.08), "aspect ratio"),
        (bgars.Defect.clipped(40.0), "flat top"),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_each_defect_fails_with_its_reason(defect: bgars.Defect, words: str) -> None:
    result = judge_part(*measured_part(simulated(defects={"B2": defect})), RECIPE)
    ball = ball_of(result, "B2")
    assert result.verdict == ball.verdict == "fail"
    assert any(words in reason for reason in ball.reasons)
    assert "B2" in " ".join(result.reasons)
    assert {other.name for other in result.balls if other.verdict != "pass"} == {"B2"}


def test_a_bridge_fails_both_balls_and_leaves_coplanarity_open() -> None:
    truth = simulated(bridges=[bgars.Bridge("C2", "C3", radius_um=100.0)])
    result = judge_part(*measured_part(truth), RECIPE)
    assert result.verdict == "fail"
    assert ball_of(result, "C2").reasons[0] == "joined to C3"
    assert "bridged: C2-C3" in result.reasons
    open_ = {check.name for check in result.checks if check.verdict == "undecided"}
    assert open_ == {"seating_coplanarity_um", "regression_coplanarity_um"}
    assert any("C2, C3" in reason and "cannot be judged" in reason for reason in result.reasons)


def test_most_balls_missing_is_undecided_and_one_missing_fails(good: tuple[FoundBalls, BallMeasurement]) -> None:
    found, measurement = good
    for kept, verdict in ((9, "undecided"), (19, "fail")):
        gone = tuple((ball.name, ball.row or 0, ball.col or 0) for ball in found.balls[kept:])
        few = replace(found, balls=found.balls[:kept], missing=gone)
        result = judge_part(few, replace(measurement, balls=measurement.balls[:kept], shared_um={}), RECIPE)
        assert result.verdict == verdict, result.reasons
        assert {ball.verdict for ball in result.balls if not ball.present} == {verdict}


def test_a_place_that_is_not_seen_to_be_empty_is_undecided(good: tuple[FoundBalls, BallMeasurement]) -> None:
    found, measurement = good
    last = found.balls[-1]
    few = replace(
        found, balls=found.balls[:-1], missing=((last.name, last.row or 0, last.col or 0),), unclear=(last.name,)
    )
    result = judge_part(few, replace(measurement, balls=measurement.balls[:-1], shared_um={}), RECIPE)
    assert result.verdict == ball_of(result, last.name).verdict == "undecided"
    assert any("not clear" in reason and last.name in reason for reason in result.reasons)
    # What stands there may be the lowest of all.
    open_ = {check.name for check in result.checks if check.verdict == "undecided"}
    assert open_ == {"seating_coplanarity_um", "regression_coplanarity_um"}


def test_a_pixel_pitch_of_unknown_uncertainty_proves_no_pitch(good: tuple[FoundBalls, BallMeasurement]) -> None:
    found, measurement = good
    result = judge_part(found, replace(measurement, u_pixel_pitch=None), RECIPE)
    check = next(check for check in result.checks if check.name == "pitch_um")
    assert check.verdict == "undecided"
    assert check.u_um > 1.0


@pytest.mark.parametrize("with_recipe", [True, False])
def test_an_extra_ball_fails(good: tuple[FoundBalls, BallMeasurement], with_recipe: bool) -> None:
    found, measurement = good
    extra = replace(found.balls[0], name="X1", row=None, col=None, x_px=1.0, y_px=2.0, kind="extra")
    result = judge_part(replace(found, balls=(*found.balls, extra)), measurement, RECIPE if with_recipe else None)
    assert result.verdict == "fail"
    assert result.balls[-1].name == "X1"
    assert result.balls[-1].verdict == "fail"
    assert any("where none should be: X1" in reason for reason in result.reasons)


def test_a_ball_on_a_depopulated_place_is_extra_and_an_empty_one_is_right(
    good: tuple[FoundBalls, BallMeasurement],
) -> None:
    recipe = replace(RECIPE, layout=replace(RECIPE.layout, depopulated=("B3",)))
    result = judge_part(*good, recipe)
    assert result.verdict == "fail"
    assert ball_of(result, "B3").kind == "extra"
    missing = measured_part(simulated(defects={"B3": bgars.Defect.missing()}))
    result = judge_part(*missing, recipe)
    assert result.verdict == "pass"
    assert len(result.balls) == 19


def test_a_place_that_the_finder_does_not_mention_is_missing(good: tuple[FoundBalls, BallMeasurement]) -> None:
    """A finder that loses a whole row must not make a part pass."""
    found, measurement = good
    kept = tuple(ball for ball in found.balls if ball.row != 3)
    rest = tuple(ball for ball in measurement.balls if ball.row != 3)
    result = judge_part(replace(found, balls=kept, rows=3), replace(measurement, balls=rest), RECIPE)
    assert result.verdict == "fail"
    assert [ball.name for ball in result.balls if not ball.present] == ["D1", "D2", "D3", "D4", "D5"]


def test_without_a_recipe_nothing_passes_and_what_is_missing_fails(good: tuple[FoundBalls, BallMeasurement]) -> None:
    result = judge_part(*good)
    assert result.verdict == "undecided"
    assert result.reasons == ("no limits given: for a verdict, give a recipe with a [limits] table",)
    assert {ball.reasons for ball in result.balls} == {("no limits given",)}
    assert result.pitch_um == pytest.approx(1000.0, abs=1.5)
    result = judge_part(*measured_part(simulated(defects={"B2": bgars.Defect.missing()})))
    assert result.verdict == "fail"
    assert ball_of(result, "B2").verdict == "fail"


def test_without_a_recipe_a_ball_of_another_size_is_named() -> None:
    result = judge_part(*measured_part(simulated(defects={"B2": bgars.Defect.size(0.8)})))
    assert next(warning for warning in result.warnings if "unlike" in warning).startswith("B2: ")
    limited = judge_part(*measured_part(simulated(defects={"B2": bgars.Defect.size(0.8)})), RECIPE)
    assert not any("unlike" in warning for warning in limited.warnings), "there the limits speak"


def test_a_recipe_without_limits_is_undecided(good: tuple[FoundBalls, BallMeasurement]) -> None:
    assert judge_part(*good, replace(RECIPE, limits=Limits())).verdict == "undecided"


def test_no_ball_at_all_is_a_question_to_the_set_up() -> None:
    found = FoundBalls((), (), (), 0, 0, None, 0.0, (0.0, 0.0))
    nothing = BallMeasurement((), np.full(6, np.nan), np.zeros((8, 3)), np.zeros(8), math.nan)
    for recipe in (None, RECIPE):
        result = judge_part(found, nothing, recipe)
        assert result.verdict == "undecided"
        assert result.reasons[0].startswith("no ball was found: this cannot be judged")
        assert {ball.verdict for ball in result.balls} <= {"undecided"}
        assert math.isnan(result.seating_coplanarity_um)
        json.loads(result.to_json())


def test_a_single_ball_is_judged_by_its_own_limits() -> None:
    scene = bgars.Scene.ball(600.0, height_um=500.0)
    _, truth = bgars.simulate(scene, bgars.LightRig.ring(8), bgars.Material(), CAMERA)
    own = Limits(diameter_um=(560.0, 640.0), height_um=(460.0, 540.0))
    recipe = PartRecipe("one", BallLayout(1, 1, 1000.0), limits=own)
    assert judge_part(*measured_part(truth), recipe).verdict == "pass"
    result = judge_part(*measured_part(truth), replace(recipe, limits=replace(own, seating_coplanarity_um=50.0)))
    assert result.verdict == "undecided"
    assert "seating coplanarity was not measured" in result.reasons[0]
    assert "three balls" in result.reasons[0]
    result = judge_part(*measured_part(truth), replace(recipe, limits=replace(own, true_position_um=50.0)))
    assert result.verdict == "undecided"


def test_a_drawing_of_the_other_side_mirrors_names_and_centre_of_gravity(
    good: tuple[FoundBalls, BallMeasurement],
) -> None:
    seen, drawn = (judge_part(*good, replace(RECIPE, view=view)) for view in ("bottom", "top"))
    for ball, other in zip(seen.balls, drawn.balls, strict=True):
        assert (ball.x_um, ball.y_um, ball.true_position_um) == (other.x_um, other.y_um, other.true_position_um)
        assert int(other.name[1:]) == 6 - int(ball.name[1:])
        assert other.name[0] == ball.name[0]
    off = replace(RECIPE, gravity_um=(400.0, 0.0))
    shifted = judge_part(*good, off)
    mirrored = judge_part(*good, replace(off, gravity_um=(-400.0, 0.0), view="top"))
    assert shifted.seating_coplanarity_um == pytest.approx(mirrored.seating_coplanarity_um)


def test_an_extra_ball_keeps_a_name_of_its_own_in_a_mirrored_view(good: tuple[FoundBalls, BallMeasurement]) -> None:
    recipe = replace(RECIPE, view="top", layout=replace(RECIPE.layout, depopulated=("A1",)))
    result = judge_part(*good, recipe)
    names = [ball.name for ball in result.balls]
    assert len(set(names)) == len(names) == 20
    assert ball_of(result, "A1").kind == "extra"


def test_a_list_of_positions_is_a_layout_too(good: tuple[FoundBalls, BallMeasurement]) -> None:
    lattice = judge_part(*good, RECIPE)
    listed = BallLayout(positions=tuple((b.name, b.x_nominal_um + 77.0, b.y_nominal_um) for b in lattice.balls))
    recipe = replace(RECIPE, layout=listed, limits=replace(LIMITS, pitch_um=None))
    result = judge_part(*good, recipe)
    assert result.verdict == "pass"
    assert math.isnan(result.pitch_um)
    for ball, other in zip(lattice.balls, result.balls, strict=True):
        assert other.true_position_um == pytest.approx(ball.true_position_um, abs=1e-6)


def test_a_part_that_rocks_says_so_and_is_judged_by_the_worst_seating() -> None:
    heights = {"A1": 520.0, "B2": 519.0, "A2": 500.0, "B1": 490.0}
    found, measured = [], []
    for name, height in heights.items():
        row, col = "AB".index(name[0]), int(name[1]) - 1
        x_um, y_um = 1000.0 * col, -1000.0 * row
        found.append(FoundBall(name, row, col, x_um / 10, y_um / 10, 30.0, 0.02, 0.02))
        zero = (0.1,) * 5
        measured.append(
            MeasuredBall(name, row, col, x_um, y_um, 600.0, height - 300, height, 1.0, 0.0, *zero, 0.001, 0.1, 8)
        )
    records = (
        FoundBalls(tuple(found), (), (), 2, 2, 100.0, 0.0, (0.0, 0.0)),
        BallMeasurement(tuple(measured), np.zeros(6), np.eye(3), np.zeros(3), 0.02),
    )
    result = judge_part(*records, PartRecipe("square", BallLayout(2, 2, 1000.0), limits=LIMITS))
    assert len(result.seatings) == 2
    assert result.seating_coplanarity_um == max(seat.coplanarity_um for seat in result.seatings)
    assert any("rock" in warning for warning in result.warnings)


def test_records_of_different_parts_are_refused(good: tuple[FoundBalls, BallMeasurement]) -> None:
    found, measurement = good
    with pytest.raises(bgars.InputError, match=r"measurement\.balls: must be balls of found, got 'A1'"):
        judge_part(replace(found, balls=found.balls[1:]), measurement, RECIPE)
    with pytest.raises(bgars.InputError, match=r"found\.balls: must have different names, got 'A1' twice"):
        judge_part(replace(found, balls=(*found.balls, found.balls[0])), measurement, RECIPE)


def test_the_result_in_other_forms() -> None:
    truth = simulated(defects={"B2": bgars.Defect.missing()})
    result = judge_part(*measured_part(truth), RECIPE, files=(("a.png", "0" * 64),), version="1.0")
    values = json.loads(result.to_json())
    assert values["verdict"] == "fail"
    assert values["recipe"]["limits"]["height_um"] == [460.0, 540.0]
    assert values["files"] == [{"name": "a.png", "sha256": "0" * 64}]
    assert values["balls"][6]["name"] == "B2"
    assert values["balls"][6]["x_um"] is None
    assert values["balls"][0]["u_top_um"] == pytest.approx(0.2)
    lines = result.to_csv().splitlines()
    assert len(lines) == 21
    assert lines[0].startswith("name,row,col,present,verdict,reasons,kind,x_um,u_x_um")
    assert len(result.to_table().splitlines()) == 21
    assert "B2" in result.to_table()
