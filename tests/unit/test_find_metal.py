"""Balls of metal, found by their highlights where slopes and rims say little."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.balls.highlights import highlight_circles
from bgars.balls.levels import Levels
from bgars.balls.pooled_rim import pooled_ratio

METAL = bgars.Material(i_d=0.02, i_s=1.0, hardness=60)


def part(
    elevation_deg: float, pixel_um: float, board: float = 0.04, material: bgars.Material = METAL, **options: object
) -> tuple[bgars.Capture, dict[str, np.ndarray]]:
    """A capture of 8 bits with noise, and the true circles (x, y, radius) in pixels by name."""
    scene = bgars.Scene.ball_array(
        4,
        5,
        jitter=bgars.Jitter(height_um=8, radius_um=3, position_um=4),
        seed=2,
        board=bgars.Board(bgars.Material.matte(board), texture=bgars.Texture(0.2)),
        **options,
    )
    camera = bgars.Camera(pixel_pitch_um=pixel_um, supersample=3, full_well_e=15000, read_noise_levels=0.4)
    capture, truth = bgars.simulate(
        scene, bgars.LightRig.ring(8, elevation_deg=elevation_deg), material, camera, seed=4
    )
    circles = {b.name: np.array([b.x_um, b.y_um, b.diameter_um / 2]) / pixel_um for b in truth.balls if b.present}
    return capture, circles


@pytest.mark.parametrize("pixel_um", [12.0, 27.0])
@pytest.mark.parametrize("elevation_deg", [25.0, 40.0, 55.0, 68.0])
def test_metal_is_found_at_any_elevation_coarse_or_fine(elevation_deg: float, pixel_um: float) -> None:
    capture, true = part(elevation_deg, pixel_um)
    found = bgars.find_balls(capture)
    assert [ball.name for ball in found.balls] == list(true)
    error = np.array([(ball.x_px, ball.y_px, ball.radius_px) for ball in found.balls]) - list(true.values())
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.15
    assert np.abs(error[:, 2] / [ball.u_radius_px for ball in found.balls]).max() < 3.0
    assert np.abs(error[:, 2]).max() < 0.05 * np.median([ball.radius_px for ball in found.balls])


def test_metal_on_a_board_of_two_grey_levels_is_found() -> None:
    capture, true = part(45.0, 12.0, board=0.008)
    assert [ball.name for ball in bgars.find_balls(capture).balls] == list(true)


def test_a_turned_part_of_metal_is_named_by_its_layout() -> None:
    capture, true = part(60.0, 14.0, rotation_deg=37.0)
    layout = bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0)
    found = bgars.find_balls(capture, layout=layout)
    assert found.angle_deg == pytest.approx(37.0, abs=0.1)
    for ball in found.balls:
        assert np.hypot(ball.x_px - true[ball.name][0], ball.y_px - true[ball.name][1]) < 0.15


def test_all_rims_together_know_the_ratio_to_the_highlights() -> None:
    capture, true = part(45.0, 27.0)
    circles = np.array(list(true.values()))
    height, width = capture.mask.shape
    levels = Levels(capture, 1)
    shine = highlight_circles(levels, height / 2 - 0.5 - circles[:, 1], circles[:, 0] + width / 2 - 0.5, circles[:, 2])
    assert np.isfinite(shine.radius_px).all()
    assert pooled_ratio(levels, shine) == pytest.approx(np.median(circles[:, 2] / shine.radius_px), abs=0.03)


def test_lights_in_another_order_make_no_balls() -> None:
    capture, _ = part(45.0, 12.0)
    directions = capture.rig.directions
    mixed = replace(capture, rig=bgars.LightRig.from_directions(directions[[3, 0, 5, 1, 7, 2, 4, 6]]))
    layout = bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0)
    found = bgars.find_balls(mixed, layout=layout)
    assert not [ball for ball in found.balls if ball.kind == "extra"]
    assert set(found.unclear) == {name for name, _, _ in found.missing}
