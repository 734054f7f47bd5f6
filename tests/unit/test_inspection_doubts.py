"""What makes the numbers of a whole part doubtful: nothing passes then."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest

NAMES = [f"{row}{col}" for row in "ABC" for col in (1, 2, 3)]
LIMITS = bgars.Limits(height_um=(350.0, 600.0), warpage_um=50.0)
PART = bgars.PartRecipe("doubts", bgars.BallLayout(rows=3, cols=3, pitch_um=1000.0), limits=LIMITS)


def capture(*, height: float = 1.0, elevation_deg: float = 45.0) -> bgars.Capture:
    """Nine balls, all as flat, under lights whose rig says 45 degrees."""
    flat = {name: bgars.Defect.flattened(height, 1.0) for name in NAMES}
    board = bgars.Board(bgars.Material.matte(0.35))
    scene = bgars.Scene.ball_array(3, 3, height_um=460.0, defects=flat, board=board)
    rig = bgars.LightRig.ring(8, elevation_deg=elevation_deg)
    camera = bgars.Camera(full_well_e=15000.0, read_noise_levels=0.5, supersample=2)
    taken, _ = bgars.simulate(scene, rig, bgars.Material(), camera, seed=1)
    return replace(taken, rig=bgars.LightRig.ring(8, elevation_deg=45.0))


def test_a_sound_part_passes_with_a_limit_on_warpage() -> None:
    result = bgars.inspect(capture(), PART)
    assert result.verdict == "pass", result.reasons
    assert 0.0 < result.u_warpage_um < 1.0


@pytest.mark.parametrize("options", [{"elevation_deg": 46.0}, {"elevation_deg": 47.5}, {"height": 0.95}])
def test_flattened_balls_and_a_wrong_common_elevation_do_not_pass(options: dict[str, float]) -> None:
    result = bgars.inspect(capture(**options), PART)
    assert result.verdict == "undecided"
    assert any("round" in reason or "median q" in reason for reason in result.reasons)


@pytest.mark.parametrize("shift_px", [-3, -4])
def test_an_image_shifted_along_its_light_does_not_pass(shift_px: int) -> None:
    taken = capture()
    images = taken.images.copy()
    images[0] = np.roll(images[0], shift_px, axis=1)
    result = bgars.inspect(replace(taken, images=images), PART)
    assert result.verdict == "undecided"
    assert any("image 0" in reason and "shifted" in reason for reason in result.reasons)
