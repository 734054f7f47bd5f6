"""Ambient light, weak and strong, is called by its name, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.records.plain_arrays import every_pixel


@pytest.fixture(scope="module")
def balls() -> bgars.Capture:
    """Matt balls on a board."""
    board = bgars.Board(texture=bgars.Texture(contrast=0.1, scale_um=150.0))
    scene, rig = bgars.Scene.ball_array(4, 4, board=board), bgars.LightRig.ring(8, elevation_deg=45.0)
    return bgars.simulate(scene, rig, bgars.Material(i_d=0.5, i_s=0.1, hardness=10), bgars.Camera(), seed=1)[0]


def veiled(capture: bgars.Capture, share: float) -> bgars.Capture:
    """Add a share of the bright level to every image, at an exposure that clips nothing."""
    veil = share * float(np.percentile(capture.images, 90))
    levels = (capture.images + veil) / (1.0 + share)
    return replace(capture, images=np.rint(levels).astype(capture.images.dtype))


@pytest.mark.parametrize("share", [0.05, 0.08, 0.2, 0.5, 0.8, 1.2])
def test_ambient_light_is_found_however_strong(balls: bgars.Capture, share: float) -> None:
    told = bgars.check(veiled(balls, share)).told
    assert told[0].kind == "ambient"
    assert not any(each.severity == "error" for each in told)


def test_a_half_turn_is_found_under_ambient_light(balls: bgars.Capture) -> None:
    turned = replace(balls, rig=bgars.LightRig.from_directions(balls.rig.directions * [-1, -1, 1]))
    assert bgars.check(veiled(turned, 0.03)).told[0].kind == "order"


def test_lamps_of_unstated_strength_are_no_ambient_light() -> None:
    strength = 1.0 - 0.25 * (np.arange(8) % 4 == 0)
    levels = 180.0 * strength[:, None, None] + np.random.default_rng(4).normal(0.0, 1.0, (8, 120, 120))
    rig = bgars.LightRig.ring(8, elevation_deg=50.0)
    flat = bgars.Capture(np.rint(levels).astype(np.uint8), rig, every_pixel((120, 120)), saturation=255.0)
    assert "ambient" not in [each.kind for each in bgars.check(flat).told]
