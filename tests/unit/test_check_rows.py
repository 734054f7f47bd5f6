"""Frames that are lit in part are told, mostly from a fifth of the light on, and nothing else is taken for one."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.checks.row_levels import clear_step
from bgars.records.plain_arrays import every_pixel


@pytest.fixture(scope="module")
def balls() -> bgars.Capture:
    """Shiny balls on a textured board, with noise."""
    board = bgars.Board(texture=bgars.Texture(contrast=0.3, scale_um=150.0))
    camera = bgars.Camera(full_well_e=15000.0, read_noise_levels=0.5, blur_px=0.7)
    rig, material = bgars.LightRig.ring(8, elevation_deg=45.0), bgars.Material(i_d=0.3, i_s=0.5, hardness=25)
    return bgars.simulate(bgars.Scene.ball_array(3, 4, board=board), rig, material, camera, seed=5)[0]


def dimmed(capture: bgars.Capture, index: int, axis: int, place: float, loss: float) -> bgars.Capture:
    """One image with less light beyond a row or a column."""
    images = capture.images.astype(np.float64)
    size = images.shape[axis]
    beyond = np.expand_dims(np.arange(size) >= place * size, 2 - axis)
    images[index] *= np.where(beyond, 1.0 - loss, 1.0)
    return replace(capture, images=np.rint(images).astype(capture.images.dtype))


@pytest.mark.parametrize(
    ("index", "axis", "place", "loss"),
    [(5, 1, 0.5, 0.2), (7, 1, 0.85, 0.2), (3, 2, 0.4, 0.2), (2, 1, 0.3, 0.4), (5, 1, 0.5, 0.4), (2, 1, 0.3, 0.6)],
)
def test_a_frame_lit_in_part_is_named(balls: bgars.Capture, index: int, axis: int, place: float, loss: float) -> None:
    told = bgars.check(dimmed(balls, index, axis, place, loss)).told[0]
    assert (told.kind, told.image) == ("half-lit", index)
    assert told.value == pytest.approx(loss, abs=0.06)
    assert f"{100 * place:.0f} % of its {'row' if axis == 1 else 'column'}s" in told.message


def test_a_dim_lamp_and_a_slope_of_light_are_no_step(balls: bgars.Capture) -> None:
    dim = dimmed(balls, 4, 1, 0.0, 0.25)
    assert [each.kind for each in bgars.check(dim).told] == ["lamp-uneven"]
    random = np.random.default_rng(0)
    ratio = 1.0 + random.normal(0.0, 0.1, (8, 144, 144))
    assert clear_step(ratio, every_pixel((144, 144))) is None
    ratio[3] *= np.linspace(0.7, 1.3, 144)[:, None]
    assert clear_step(ratio, every_pixel((144, 144))) is None


@pytest.mark.parametrize("along", [1, 2])
@pytest.mark.parametrize("width", [1, 2, 3, 5, 8, 12, 20])
def test_strips_narrower_than_what_is_looked_for_are_checked(balls: bgars.Capture, width: int, along: int) -> None:
    """Shadows reach farther than such a strip is wide, and so do shifts."""
    for start in range(0, 300, 30):
        strip = np.s_[start : start + width]
        place = np.s_[strip, :] if along == 1 else np.s_[:, strip]
        images, mask = (np.ascontiguousarray(each) for each in (balls.images[(..., *place)], balls.mask[place]))
        assert all(finding.message for finding in bgars.check(replace(balls, images=images, mask=mask)))
