"""Silhouettes of metal balls must not hang on the last bits of the images."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest

ROUNDING, NOISE = 1e-6, 1e-3
ROUGH = bgars.Board(bgars.Material.matte(0.02), texture=bgars.Texture(0.3))
DARK = bgars.Board(bgars.Material.matte(0.01))


def circles(capture: bgars.Capture) -> np.ndarray:
    """(N, 3) centre and radius in pixels, in reading order."""
    found = bgars.find_balls(capture)
    assert len(found.balls) == 25
    return np.array([(ball.x_px, ball.y_px, ball.radius_px) for ball in found.balls])


def disturbed(capture: bgars.Capture, relative: float, seed: int) -> bgars.Capture:
    """The capture in float32, each pixel off by a relative error."""
    factor = 1.0 + relative * np.random.default_rng(seed).standard_normal(capture.images.shape)
    return replace(capture, images=(capture.images * factor).astype(np.float32))


@pytest.fixture(
    scope="module", params=[(DARK, 80, 12.0), (ROUGH, 60, 20.0), (ROUGH, 40, 14.0)], ids=["dark", "small", "rough"]
)
def metal(request: pytest.FixtureRequest) -> tuple[bgars.Capture, np.ndarray]:
    """Balls without a diffuse part on a dark board, rims of a grey level or two; and their circles."""
    board, hardness, pitch_um = request.param
    jitter = bgars.Jitter(height_um=8, radius_um=3, position_um=4)
    scene = bgars.Scene.ball_array(5, 5, jitter=jitter, seed=2, board=board)
    camera = bgars.Camera(pixel_pitch_um=pitch_um, supersample=3, full_well_e=15000, read_noise_levels=0.5)
    material = bgars.Material(i_d=0.0, i_s=1.0, hardness=hardness)
    capture = bgars.simulate(scene, bgars.LightRig.ring(8), material, camera, seed=4)[0]
    return capture, circles(capture)


@pytest.mark.parametrize("seed", range(3))
def test_rounding_moves_no_circle(metal: tuple[bgars.Capture, np.ndarray], seed: int) -> None:
    moved = np.abs(circles(disturbed(metal[0], ROUNDING, seed)) - metal[1])
    assert moved.max() < 0.002, moved.max(axis=0)


def test_a_thousandth_of_noise_leads_to_the_same_minimum(metal: tuple[bgars.Capture, np.ndarray]) -> None:
    moved = np.abs(circles(disturbed(metal[0], NOISE, 0)) - metal[1])
    assert moved.max() < 0.05, moved.max(axis=0)
