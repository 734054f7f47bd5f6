"""Layouts laid over balls, whatever way up the part lies."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars.balls.registration import register
from bgars.inspection.on_grid import like_turn_deg

PIXEL_UM = 10.0


def part(layout: bgars.BallLayout, turn_deg: float, scale: float = 1.0, seed: int = 1) -> np.ndarray:
    """Places (x + iy, pixels) of the balls of a turned, shifted and scaled part with a little disorder."""
    random = np.random.default_rng(seed)
    places = np.array([x + 1j * y for *_, x, y in layout.places()]) / PIXEL_UM
    disorder = random.normal(0.0, 1.5, (2, len(places)))
    middle = (places.real.min() + places.real.max() + 1j * (places.imag.min() + places.imag.max())) / 2
    turned = scale * (places - middle) * np.exp(1j * np.radians(turn_deg))
    return turned + disorder[0] + 1j * disorder[1] + 13.0 - 8.0j


@pytest.mark.parametrize("turn_deg", [-178.0, -130.0, -90.0, -46.0, 0.0, 14.0, 16.0, 44.0, 90.0, 135.0, 180.0])
def test_a_part_without_symmetry_is_found_at_any_turn(turn_deg: float) -> None:
    layout = bgars.BallLayout(rows=5, cols=6, pitch_um=800.0, depopulated=("A1", "C2"))
    balls = part(layout, turn_deg)
    fit = register(balls.real, balls.imag, layout, PIXEL_UM)
    assert fit.ball.tolist() == list(range(len(balls)))
    assert abs((np.degrees(fit.angle_rad) - turn_deg + 180.0) % 360.0 - 180.0) < 1.0


@pytest.mark.parametrize(
    ("turn_deg", "expected_deg"),
    [(40.0, 40.0), (-44.6, -44.6), (44.6, 44.6), (50.0, -40.0), (91.0, 1.0), (179.0, -1.0)],
)
def test_of_equal_turns_the_smallest_is_taken(turn_deg: float, expected_deg: float) -> None:
    layout = bgars.BallLayout(rows=5, cols=5, pitch_um=800.0)
    balls = part(layout, turn_deg)
    fit = register(balls.real, balls.imag, layout, PIXEL_UM)
    assert np.degrees(fit.angle_rad) == pytest.approx(expected_deg, abs=0.8)
    assert sorted(fit.ball.tolist()) == list(range(25))


@pytest.mark.parametrize(
    ("rows", "cols", "depopulated", "turn_deg", "other_deg"),
    [
        (4, 4, (), 44.0, -46.0),
        (4, 4, (), -35.5, None),
        (4, 4, ("B2", "B3", "C2", "C3"), -41.0, 49.0),
        (4, 4, ("A1",), 44.0, None),
        (3, 5, (), 44.0, None),
        (3, 5, (), 88.0, -92.0),
        (1, 8, (), -89.0, 91.0),
    ],
)
def test_a_turn_by_which_balls_may_be_named_as_well_is_known(
    rows: int, cols: int, depopulated: tuple[str, ...], turn_deg: float, other_deg: float | None
) -> None:
    recipe = bgars.PartRecipe("turned", bgars.BallLayout(rows, cols, 800.0, depopulated))
    assert like_turn_deg(recipe, turn_deg) == other_deg


def test_missing_and_foreign_balls_do_not_turn_a_part() -> None:
    layout = bgars.BallLayout(rows=8, cols=9, pitch_um=800.0, depopulated=("B2",))
    random = np.random.default_rng(3)
    whole = part(layout, -33.0, scale=1.03)
    kept = np.flatnonzero(random.random(len(whole)) > 0.3)
    foreign = random.uniform(-300, 300, 6) + 1j * random.uniform(-300, 300, 6)
    balls = np.concatenate([whole[kept], foreign])
    fit = register(balls.real, balls.imag, layout, PIXEL_UM)
    assert np.degrees(fit.angle_rad) == pytest.approx(-33.0, abs=0.5)
    assert fit.scale_px_per_um * PIXEL_UM == pytest.approx(1.03, abs=0.005)
    for place, ball in enumerate(fit.ball[kept]):
        assert ball == place


@pytest.mark.parametrize(("scale", "turn_deg"), [(1 / 1.5, 0.0), (1.136, 3.0), (0.7071, 0.0), (1.5, 45.0)])
def test_a_wrong_pitch_is_named_at_any_turn(scale: float, turn_deg: float) -> None:
    layout = bgars.BallLayout(rows=4, cols=5, pitch_um=800.0)
    balls = part(layout, turn_deg, scale)
    with pytest.raises(bgars.InputError, match=r"layout: pitch_um: must be within 10 % .*, got 800") as refusal:
        register(balls.real, balls.imag, layout, PIXEL_UM)
    named_um = float(str(refusal.value).split("which is ")[1].split(",")[0])
    assert named_um == pytest.approx(scale * 800.0, rel=0.01)


def test_balls_in_disorder_fit_no_layout_and_no_turn_is_blamed() -> None:
    random = np.random.default_rng(5)
    x, y = random.uniform(-400, 400, (2, 40))
    layout = bgars.BallLayout(rows=4, cols=5, pitch_um=800.0)
    with pytest.raises(bgars.InputError, match=r"of 40 balls are on the 20 places at any turn of the part"):
        register(x, y, layout, PIXEL_UM)
