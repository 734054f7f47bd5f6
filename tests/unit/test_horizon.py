"""The horizon in a mirror ball is not taken for its outline."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.station.horizon import radius_around
from bgars.station.levels import Levels
from bgars.station.outline import Outline
from numpy.typing import NDArray
from scipy import ndimage

SIDE, RADIUS_PX, LIGHTS = 260, 97.0, 8
AT = (3.0, -5.0)
NOISE = 1.0


def apart() -> NDArray[np.float64]:
    """(H, W) distances from the ball's centre."""
    x = np.arange(SIDE) + 0.5 - SIDE / 2.0 - AT[0]
    y = SIDE / 2.0 - 0.5 - np.arange(SIDE) - AT[1]
    return np.hypot(x[None, :], y[:, None])


def seen(level: NDArray[np.float64], seed: int = 0) -> Levels:
    """Eight images with noise of one grey level."""
    random = np.random.default_rng(seed)
    images = ndimage.gaussian_filter(level, 0.6) + random.normal(0.0, NOISE, (LIGHTS, SIDE, SIDE))
    return Levels(images, 255.0, NOISE)


def outline(radius_px: float) -> Outline:
    return Outline(*AT, radius_px, 0.1, 0.1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ground", [1.5, 3.0])
def test_the_outline_around_a_horizon_is_found(seed: int, ground: float) -> None:
    """Black room, the ground mirrored at 2.2 grey levels, and the ground itself, brighter or darker."""
    level = np.where(apart() < RADIUS_PX / np.sqrt(2.0), 0.3, np.where(apart() < RADIUS_PX, 2.2, ground))
    found = radius_around(seen(level, seed), outline(RADIUS_PX / np.sqrt(2.0)))
    assert found == pytest.approx(RADIUS_PX, abs=1.0)


@pytest.mark.parametrize("seed", range(3))
def test_ground_that_changes_smoothly_or_has_texture_is_no_ball(seed: int) -> None:
    random = np.random.default_rng(100 + seed)
    texture = ndimage.gaussian_filter(random.normal(size=(SIDE, SIDE)), 2.0)
    level = 60.0 * (1.0 + 0.5 * np.exp(-apart() / 30.0)) * (1.0 + 0.1 * texture / texture.std())
    level[:, SIDE // 2 + 40 :] *= 0.5
    radius_px = 70.0
    assert radius_around(seen(np.where(apart() < radius_px, 10.0, level), seed), outline(radius_px)) is None


def test_an_edge_beyond_the_image_is_none() -> None:
    """A ball around it would be cut off."""
    level = np.where(apart() < 1.41 * RADIUS_PX, 10.0, 20.0)
    assert radius_around(seen(level), outline(RADIUS_PX)) is None
