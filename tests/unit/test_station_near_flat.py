"""The flat field of a lamp so near that its far corner is dark."""

from __future__ import annotations

import bgars
import numpy as np
import pytest

SIDE = 300


@pytest.mark.parametrize(("height_px", "is_known"), [(400.0, True), (110.0, False)])
def test_a_map_that_does_not_know_its_dark_corner_is_doubted(height_px: float, is_known: bool) -> None:
    x, y = np.meshgrid(np.arange(SIDE) + 0.5 - SIDE / 2.0, SIDE / 2.0 - np.arange(SIDE) - 0.5)
    rng = np.random.default_rng(12)
    boards = []
    for azimuth in np.radians([20.0, 140.0, 260.0]):
        square = (x - 230.0 * np.cos(azimuth)) ** 2 + (y - 230.0 * np.sin(azimuth)) ** 2 + height_px**2
        light = height_px / square**1.5
        boards.append(220.0 * light / light.max())
    images = np.rint(np.array(boards) + rng.normal(0.0, 1.0, (3, SIDE, SIDE))).clip(0, 255).astype(np.uint8)
    capture = bgars.Capture(images, bgars.LightRig.ring(3), np.ones((SIDE, SIDE), np.bool_), saturation=255.0)
    flat, findings = bgars.calibrate_flat(capture)
    doubts = [one for one in findings if one.code == "flat-unsure"]
    rows = np.polynomial.legendre
    off = []
    for coefficients, board in zip(flat.coefficients, boards, strict=True):
        powers = [(i, j) for i in range(flat.degree + 1) for j in range(flat.degree + 1 - i)]
        grid = np.zeros((flat.degree + 1, flat.degree + 1))
        for (i, j), value in zip(powers, coefficients, strict=True):
            grid[i, j] = value
        off.append(float(np.abs(rows.legval2d(x / (SIDE / 2), y / (SIDE / 2), grid) / board - 1.0).max()))
    assert (len(doubts) == 0) is is_known
    assert (max(off) < 0.03) is is_known, "the doubt is right"
    assert all(str(one.message).startswith("capture: light") for one in doubts)
