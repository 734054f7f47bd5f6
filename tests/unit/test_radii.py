"""Radii of shadows and silhouettes together, on numbers whose errors are known; edges moved by rounded levels."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bgars.inspection.plateaus import _lifted
from bgars.inspection.radii import sharpen_radii
from numpy.typing import NDArray

Array = NDArray[np.float64]


def part(
    count: int, u_shadow: float, u_silhouette: float, bias: float, seed: int
) -> tuple[SimpleNamespace, Array, Array]:
    """Shadows that err ball by ball, silhouettes that err alike and ball by ball; and the true radii."""
    random = np.random.default_rng(seed)
    true = 25.0 + 0.3 * random.standard_normal(count)
    balls = np.zeros((count, 5))
    balls[:, 3] = true + u_shadow * random.standard_normal(count)
    covariance = np.tile(np.diag([1e-4, 1e-4, 1e-4, u_shadow**2, 1e-6]), (count, 1, 1))
    solution = SimpleNamespace(balls=balls, covariance=covariance, common_covariance=np.zeros((5, 5)))
    return solution, true + bias + u_silhouette * random.standard_normal(count), true


@pytest.mark.parametrize(("u_shadow", "u_silhouette"), [(0.02, 0.01), (0.01, 0.01), (0.01, 0.3)])
def test_radii_come_closer_whatever_silhouettes_have_in_common_and_u_covers(
    u_shadow: float, u_silhouette: float
) -> None:
    before, after, inside = [], [], []
    for seed in range(20):
        solution, silhouette, true = part(16, u_shadow, u_silhouette, 0.2, seed)
        balls, covariance = sharpen_radii(solution, silhouette, np.full(16, 0.5))  # type: ignore[arg-type]
        before.extend(solution.balls[:, 3] - true)
        after.extend(balls[:, 3] - true)
        inside.extend(np.abs(balls[:, 3] - true) < np.sqrt(covariance[:, 3, 3]))
    assert np.std(after) < 1.01 * np.std(before)
    if u_silhouette <= u_shadow:
        assert np.std(after) < 0.85 * np.std(before)
    assert 0.61 <= np.mean(inside) <= 0.75


def test_a_silhouette_that_fits_no_other_is_not_used_and_five_balls_stay() -> None:
    solution, silhouette, _ = part(16, 0.01, 0.01, 0.0, 1)
    silhouette[3] += 1.0
    balls, covariance = sharpen_radii(solution, silhouette, np.full(16, 0.5))  # type: ignore[arg-type]
    assert balls[3, 3] == solution.balls[3, 3]
    assert covariance[3, 3, 3] == solution.covariance[3, 3, 3]
    few, silhouette, _ = part(5, 0.01, 0.01, 0.0, 2)
    assert np.array_equal(sharpen_radii(few, silhouette, np.full(5, 0.5))[0], few.balls)  # type: ignore[arg-type]


@pytest.mark.parametrize("low", [0.0, 0.7, 3.0])
def test_noise_cut_off_at_zero_lifts_the_mean(low: float) -> None:
    noisy = np.random.default_rng(0).normal(low, 1.0, 400_000)
    # The level that is handed on is the one that was read, lifted already where it is black.
    read = float(np.maximum(noisy, 0.0).mean())
    lifted = read - low
    assert _lifted(read if low == 0.0 else low + 0.4, 1.0, 0.0) == pytest.approx(lifted, abs=0.03)
