"""Places without a ball: seen to be empty, or not."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest

SHINY = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
RING = bgars.LightRig.ring(8)
CAMERA = bgars.Camera(pixel_pitch_um=12.0, supersample=3, full_well_e=15000, read_noise_levels=0.4)
LAYOUT = bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0)


def part(**defects: bgars.Defect) -> bgars.Capture:
    board = bgars.Board(bgars.Material.matte(0.12), texture=bgars.Texture(0.3))
    scene = bgars.Scene.ball_array(4, 5, seed=2, defects=defects, board=board)
    return bgars.simulate(scene, RING, SHINY, CAMERA, seed=3)[0]


def missing(found: bgars.FoundBalls) -> set[str]:
    return {name for name, _, _ in found.missing}


@pytest.mark.parametrize("layout", [None, LAYOUT])
def test_a_place_without_a_ball_is_seen_to_be_empty(layout: bgars.BallLayout | None) -> None:
    found = bgars.find_balls(part(B2=bgars.Defect.missing(), C4=bgars.Defect.missing()), layout=layout)
    assert missing(found) == {"B2", "C4"}
    assert found.unclear == ()


@pytest.mark.parametrize("size", [0.2, 0.3, 0.45])
def test_a_crumb_of_solder_is_something_there_that_is_not_measured(size: float) -> None:
    found = bgars.find_balls(part(B2=bgars.Defect.size(size), C4=bgars.Defect.missing()), layout=LAYOUT)
    assert missing(found) == {"B2", "C4"}
    assert found.unclear == ("B2",)


@pytest.mark.parametrize("size", [0.8, 0.9, 1.1, 1.15])
@pytest.mark.parametrize("pixel_um", [12.0, 30.0])
def test_a_small_or_large_ball_is_found(size: float, pixel_um: float) -> None:
    scene = bgars.Scene.ball_array(4, 5, seed=2, defects={"B2": bgars.Defect.size(size)})
    camera = replace(CAMERA, pixel_pitch_um=pixel_um)
    capture, truth = bgars.simulate(scene, RING, SHINY, camera, seed=3)
    found = {ball.name: ball for ball in bgars.find_balls(capture).balls}
    assert len(found) == 20
    true = next(ball for ball in truth.balls if ball.name == "B2")
    assert found["B2"].radius_px == pytest.approx(true.diameter_um / 2 / pixel_um, abs=0.15)


def test_masked_places_are_unclear() -> None:
    capture = part(C4=bgars.Defect.missing())
    height, width = capture.mask.shape
    mask = np.ones((height, width), np.bool_)
    mask[: height // 2 - 85, : width // 2 - 125] = False
    found = bgars.find_balls(replace(capture, mask=mask), layout=LAYOUT)
    assert missing(found) == {"A1", "C4"}
    assert found.unclear == ("A1",)


def test_places_outside_the_image_are_unclear() -> None:
    capture = part(A2=bgars.Defect.missing(), C4=bgars.Defect.missing())
    height, width = capture.mask.shape
    cut = replace(
        capture,
        images=np.ascontiguousarray(capture.images[:, :, : width - 110]),
        mask=np.ones((height, width - 110), np.bool_),
        dark=None,
    )
    found = bgars.find_balls(cut, layout=replace(LAYOUT, depopulated=("A2",)))
    assert missing(found) == {"A5", "B5", "C5", "D5", "C4"}
    assert set(found.unclear) == {"A5", "B5", "C5", "D5"}


def test_without_any_ball_nothing_is_seen_to_be_empty() -> None:
    board = bgars.Board(bgars.Material.matte(0.3), texture=bgars.Texture(0.4))
    capture, _ = bgars.simulate(bgars.Scene.plane(size_um=(5000, 5000), board=board), RING, SHINY, CAMERA)
    found = bgars.find_balls(capture, layout=LAYOUT)
    assert found.balls == ()
    assert len(found.missing) == 20
    assert set(found.unclear) == missing(found)
