"""Pixel pitch and distortion from a grid whose balls stand some micrometres aside."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.inspection.common_terms import Mixture
from bgars.inspection.lens_scale import DISTORTION, PIXEL_PITCH, fit_lens_scale
from numpy.typing import NDArray

Array = NDArray[np.float64]
CORNER_UM = 3000.0


def grid() -> Array:
    x, y = np.meshgrid(np.arange(5) - 2.0, np.arange(5) - 2.0)
    return 800.0 * np.column_stack([x.ravel(), y.ravel()])


def seen(scale: float, distortion: float, seed: int, *, jitter_um: float = 4.0) -> Array:
    """Where the image has the balls of the grid, turned by 20 degrees."""
    turn = np.radians(20.0)
    places = grid() @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + [30.0, -20.0]
    places += np.random.default_rng(seed).normal(0.0, jitter_um, places.shape)
    square = np.square(places).sum(axis=1, keepdims=True) / CORNER_UM**2
    return places * (1.0 + scale + distortion * square)


def drawn(mixture: Mixture, random: np.random.Generator) -> float:
    return float(random.normal(0.0, mixture.wide if random.random() < mixture.share else mixture.narrow))


def test_lengths_are_made_true_and_u_covers_what_is_left() -> None:
    """Scales and lenses as often off as the priors say."""
    random = np.random.default_rng(5)
    inside, left, raw = [], [], []
    for seed in range(150):
        centres = seen(drawn(PIXEL_PITCH, random), drawn(DISTORTION, random), seed)
        lens = fit_lens_scale(grid(), centres, np.full((25, 2), 0.2), CORNER_UM, None, None)
        x, y = centres[:, 0], centres[:, 1]
        true_um = seen(0.0, 0.0, seed)[:, 0]
        off = lens.factor(x, y) * x - true_um
        inside.extend(np.abs(off) <= 2.0 * np.abs(x) * np.linalg.norm(lens.u_share(x, y), axis=1) + 0.01)
        left.append(np.sqrt(np.mean(off**2)))
        raw.append(np.sqrt(np.mean((x - true_um) ** 2)))
    assert np.mean(inside) > 0.9
    assert np.sqrt(np.mean(np.square(left))) < 0.5 * np.sqrt(np.mean(np.square(raw)))


def test_a_pitch_or_lens_far_off_is_seen() -> None:
    lens = fit_lens_scale(grid(), seen(0.006, 0.0, 3), np.full((25, 2), 0.2), CORNER_UM, None, None)
    assert lens.scale == pytest.approx(0.006, abs=0.0015)
    lens = fit_lens_scale(grid(), seen(0.0, 0.02, 3, jitter_um=2.0), np.full((25, 2), 0.2), CORNER_UM, None, None)
    assert lens.distortion == pytest.approx(0.02, abs=0.005)


def test_a_ball_far_out_of_place_does_not_bend_the_lens() -> None:
    centres = seen(0.0, 0.0, 1)
    centres[0] += 80.0
    lens = fit_lens_scale(grid(), centres, np.full((25, 2), 0.2), CORNER_UM, None, None)
    assert abs(lens.scale) < 1e-3
    assert abs(lens.distortion) < 1e-3


def test_without_a_grid_the_pixel_pitch_is_as_uncertain_as_pitches_are() -> None:
    nothing = np.zeros((0, 2))
    lens = fit_lens_scale(nothing, nothing, nothing, CORNER_UM, None, None)
    assert lens.scale == 0.0
    assert np.sqrt(lens.covariance[0, 0]) == pytest.approx(PIXEL_PITCH.spread, rel=1e-3)
    told = fit_lens_scale(nothing, nothing, nothing, CORNER_UM, 1e-4, None)
    assert np.sqrt(told.covariance[0, 0]) == pytest.approx(1e-4, rel=1e-3)
