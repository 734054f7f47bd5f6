"""Uncertainty and noise bias of coplanarity, against what noise really does."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.inspection.coplanarity import measure_coplanarity, quiet_heights
from bgars.inspection.planes import regression_plane, seating_planes

MIDDLE = np.zeros(2)


def part(side: int, spread_um: float, random: np.random.Generator) -> np.ndarray:
    at = (np.arange(side) - (side - 1) / 2) * 1000.0
    x, y = np.meshgrid(at, at)
    return np.column_stack([x.ravel(), y.ravel(), random.normal(500.0, spread_um, side * side)])


def test_a_perfect_part_of_256_balls_with_1_um_of_noise() -> None:
    """The reading is about 5.5 um, and all of it is stated as bias."""
    random = np.random.default_rng(0)
    readings, biases = [], []
    for _ in range(10):
        apexes = part(16, 0.0, random) + random.normal(0.0, 1.0, (256, 3))
        found = measure_coplanarity(apexes, np.ones((256, 3)), MIDDLE, draws=128)
        readings.append(found.seating_um)
        biases.append(found.seating_bias_um)
    assert np.mean(readings) == pytest.approx(5.5, abs=0.4)
    assert np.mean(biases) == pytest.approx(np.mean(readings), rel=0.2)


@pytest.mark.parametrize(("spread_um", "noise_um"), [(0.3, 0.3), (1.0, 0.3), (3.0, 1.0)])
def test_bias_and_uncertainty_are_those_of_repeated_measurements(spread_um: float, noise_um: float) -> None:
    random = np.random.default_rng(1)
    errors, biases, stated = ([], []), ([], []), ([], [])
    for _ in range(30):
        truth = part(10, spread_um, random)
        apexes = truth + random.normal(0.0, noise_um, truth.shape)
        found = measure_coplanarity(apexes, np.full(truth.shape, noise_um), MIDDLE, draws=128)
        regression = regression_plane(truth)
        assert regression is not None
        for at, (reading, bias, u, true) in enumerate(
            [
                (
                    found.seating_um,
                    found.seating_bias_um,
                    found.u_seating_um,
                    seating_planes(truth, MIDDLE)[0].coplanarity_um,
                ),
                (found.regression_um, found.regression_bias_um, found.u_regression_um, regression.coplanarity_um),
            ]
        ):
            errors[at].append(reading - true)
            biases[at].append(bias)
            stated[at].append(u)
    for at in (0, 1):
        scatter = np.std(errors[at])
        assert np.mean(biases[at]) == pytest.approx(np.mean(errors[at]), abs=0.6 * scatter)
        assert 0.65 < np.mean(stated[at]) / scatter < 1.5
        expanded = 2.0 * np.array(stated[at])
        inside = (np.array(errors[at]) <= np.array(biases[at]) + expanded) & (np.array(errors[at]) >= -expanded)
        assert inside.mean() >= 0.85


def test_the_draws_are_the_planes_of_the_exact_functions() -> None:
    """With one draw of known noise, the fast batch and the single plane must agree; here: no noise at all."""
    random = np.random.default_rng(4)
    apexes = part(7, 5.0, random) + random.normal(0.0, 3.0, (49, 3))
    found = measure_coplanarity(apexes, np.full((49, 3), 1e-9), MIDDLE, draws=8)
    assert found.u_seating_um < 1e-6
    assert found.seating_bias_um < 1e-6
    assert found.u_regression_um < 1e-6
    assert found.regression_bias_um < 1e-6


def test_the_same_numbers_give_the_same_result() -> None:
    apexes = part(5, 5.0, np.random.default_rng(2))
    u = np.full(apexes.shape, 0.3)
    one, two = (measure_coplanarity(apexes, u, MIDDLE) for _ in range(2))
    assert (one.u_seating_um, one.seating_bias_um) == (two.u_seating_um, two.seating_bias_um)


def test_an_unknown_uncertainty_stays_unknown() -> None:
    apexes = part(4, 5.0, np.random.default_rng(2))
    u = np.full(apexes.shape, 0.3)
    u[3, 2] = np.nan
    found = measure_coplanarity(apexes, u, MIDDLE)
    assert found.seating_um > 0
    assert np.isnan([found.u_seating_um, found.seating_bias_um, found.u_regression_um]).all()


def test_a_part_that_does_not_stand_has_no_seating_coplanarity() -> None:
    apexes = part(4, 5.0, np.random.default_rng(2))
    found = measure_coplanarity(apexes, np.full(apexes.shape, 0.3), np.array([5000.0, 0.0]))
    assert found.seating == ()
    assert np.isnan([found.seating_um, found.u_seating_um]).all()
    assert found.regression_um > 0
    assert found.u_regression_um > 0


def test_a_defect_keeps_its_height_and_noise_is_taken_off_the_rest() -> None:
    random = np.random.default_rng(6)
    apexes = part(16, 0.0, random)
    apexes[:, 2] += random.normal(0.0, 1.0, 256)
    apexes[100, 2] -= 60.0
    quiet = quiet_heights(apexes, np.ones(256))
    others = np.delete(np.arange(256), 100)
    assert quiet[100] == pytest.approx(apexes[100, 2])
    assert quiet[others].std() < 0.6


def test_three_balls_have_no_bias_to_take_off() -> None:
    apexes = np.array([[0.0, 0, 5], [1000, 0, 25], [0, 1000, -5]])
    found = measure_coplanarity(apexes, np.full((3, 3), 0.3), np.array([300.0, 300.0]))
    assert found.seating_um == pytest.approx(0.0, abs=1e-9)
    assert found.u_seating_um == pytest.approx(0.0, abs=1e-6)
