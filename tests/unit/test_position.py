"""True position, pitch and warpage against slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bgars.inspection.judge_ball import true_position
from bgars.inspection.position import fit_grid
from bgars.inspection.warpage import board_height_um, warpage
from scipy.optimize import least_squares


def lattice(rows: int, cols: int, pitch_um: float) -> np.ndarray:
    col, row = np.meshgrid(np.arange(cols), np.arange(rows))
    return np.column_stack([(col.ravel() - (cols - 1) / 2), ((rows - 1) / 2 - row.ravel())]) * pitch_um


def turned(points: np.ndarray, angle_rad: float, scale: float = 1.0) -> np.ndarray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return scale * points @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("free_scale", [False, True])
def test_the_grid_is_the_least_squares_one(free_scale: bool) -> None:
    random = np.random.default_rng(0)
    for _ in range(20):
        nominal = np.delete(lattice(4, 5, 800.0), random.integers(0, 20, 3), axis=0) + np.array([30.0, -70.0])
        centres = turned(nominal, random.uniform(-0.5, 0.5), 1.001) + random.uniform(-500, 500, 2)
        centres += random.normal(0.0, 8.0, centres.shape)
        fit = fit_grid(nominal, centres, np.full(centres.shape, 0.2), free_scale=free_scale)
        assert fit is not None

        def off(p: np.ndarray, nominal: np.ndarray = nominal, centres: np.ndarray = centres) -> np.ndarray:
            return (turned(nominal, p[0] / 800.0, p[3] / 800.0 if free_scale else 1.0) + p[1:3] - centres).ravel()

        twin = least_squares(off, [0.0, 0.0, 0.0, 800.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
        np.testing.assert_allclose((fit.place(nominal) - centres).ravel(), off(twin.x), atol=1e-4)


def test_the_uncertainty_of_the_pitch_is_that_of_repeated_measurements() -> None:
    random = np.random.default_rng(1)
    nominal = lattice(5, 7, 1000.0)
    pitches, stated = [], 0.0
    for _ in range(300):
        fit = fit_grid(
            nominal, turned(nominal, 0.3) + random.normal(0.0, 0.5, nominal.shape), np.full(nominal.shape, 0.5)
        )
        assert fit is not None
        pitches.append(1000.0 * fit.free_scale)
        stated = 1000.0 * fit.u_free_scale
    assert np.std(pitches) == pytest.approx(stated, rel=0.15)
    assert np.mean(pitches) == pytest.approx(1000.0, abs=4 * stated / math.sqrt(300))


def test_one_ball_lies_on_any_grid() -> None:
    assert fit_grid(np.zeros((1, 2)), np.ones((1, 2)), np.ones((1, 2))) is None
    assert fit_grid(np.zeros((2, 2)), np.ones((2, 2)), np.ones((2, 2))) is None


def test_true_position_is_the_distance_with_its_uncertainty_along_the_offset() -> None:
    along_x = true_position(np.array([10.0, 0.0]), np.array([0.3, 5.0]))
    assert (along_x.distance_um, along_x.u_um) == (10.0, pytest.approx(0.3))
    assert true_position(np.zeros(2), np.array([0.3, 0.3])).u_um == pytest.approx(0.3)


def test_warpage_of_a_bow_is_its_height_and_a_tilt_has_none() -> None:
    corners = np.array([[-2000.0, -1500.0], [2000.0, -1500.0], [2000.0, 1500.0]])
    tilt = np.array([7.0, 0.03, -0.02, 0.0, 0.0, 0.0])
    assert warpage(tilt, None, corners)[0] == pytest.approx(0.0, abs=1e-9)
    bow = tilt + np.array([0.0, 0.0, 0.0, -5e-6, 0.0, -5e-6])
    assert warpage(bow, None, corners)[0] == pytest.approx(5e-6 * (2000.0**2 + 1500.0**2))


def test_the_uncertainty_of_warpage_is_that_of_repeated_measurements() -> None:
    random = np.random.default_rng(2)
    corners = np.array([[-2000.0, -2000.0], [2000.0, -2000.0], [2000.0, 2000.0]])
    coefficients = np.array([0.0, 0.0, 0.0, -5e-6, 1e-6, -4e-6])
    covariance = np.diag([0.1, 1e-8, 1e-8, 4e-15, 4e-15, 4e-15])
    _, stated = warpage(coefficients, covariance, corners)
    drawn = random.multivariate_normal(coefficients, covariance, 400)
    assert np.std([warpage(each, None, corners)[0] for each in drawn]) == pytest.approx(stated, rel=0.15)


def test_an_unknown_board_has_no_warpage() -> None:
    unknown = np.full(6, np.nan)
    assert np.isnan(warpage(unknown, None, np.zeros((2, 2)))).all()
    only_shape = np.array([np.nan, 0.01, 0.0, 0.0, 0.0, 0.0])
    assert board_height_um(only_shape, np.array([100.0]), np.array([0.0])).tolist() == [1.0]
