"""Grids that are not what they are taken for: the pixel pitch is off by what is stated of it, and it is said."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.station.grid_fit import fit_grid
from numpy.typing import NDArray

SIZE, STEP_PX = (400, 500), 30.0
STEPS = np.stack(np.meshgrid(np.arange(16.0) - 7.3, np.arange(13.0) - 6.1), axis=-1).reshape(-1, 2)


def grid(
    seed: int, longer: float = 0.0, turn: float = 0.0, second: float = 0.0, fourth: float = 0.0
) -> NDArray[np.float64]:
    """(N, 2) points of a grid longer along x, turned, seen by a lens with two terms of distortion."""
    points = STEP_PX * STEPS * [1.0 + longer, 1.0]
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    square = np.square(points).sum(axis=1, keepdims=True) / (0.5 * np.hypot(*SIZE)) ** 2
    points = points * (1.0 + second * square + fourth * square**2)
    seen: NDArray[np.float64] = points + np.random.default_rng(seed).normal(0.0, 0.03, points.shape)
    return seen


@pytest.mark.parametrize("seed", range(8))
def test_a_square_grid_raises_no_doubt_and_its_u_is_small(seed: int) -> None:
    scale, said = fit_grid(grid(seed, second=0.01, turn=0.2), 10.0 * STEP_PX, 0.0, size_px=SIZE)
    assert abs(scale.pixel_pitch_um / 10.0 - 1.0) < 4.0 * scale.pixel_pitch_u_um / 10.0 < 4e-4
    assert all(one.severity == "note" for one in said)


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"longer": 0.001}, "oblong"),
        ({"longer": 0.004, "turn": 0.5}, "oblong"),
        ({"second": -0.02, "fourth": 0.005}, "distortion-form"),
        ({"second": 0.01, "fourth": 0.01}, "distortion-form"),
    ],
)
@pytest.mark.parametrize("seed", [11, 12])
def test_what_is_no_square_grid_under_a_usual_lens_is_in_u(wrong: dict[str, float], code: str, seed: int) -> None:
    scale, said = fit_grid(grid(seed, **wrong), 10.0 * STEP_PX, 0.0, size_px=SIZE)
    off = abs(scale.pixel_pitch_um / 10.0 - 1.0)
    assert 3e-4 < off < 1.5 * scale.pixel_pitch_u_um / 10.0 < 4.0 * off
    assert code in {one.code for one in said}


def test_a_grid_of_which_few_points_fit_is_doubted() -> None:
    beside = np.concatenate([grid(1), grid(2) + np.array([520.0, 15.0])])
    _, said = fit_grid(beside, 300.0, None, size_px=(400, 1100))
    assert any(one.severity == "doubt" and "another one beside it" in one.message for one in said)
