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


def flattened_q(height: float) -> float:
    """Vertical over horizontal radius of these balls."""
    flat = {name: bgars.Defect.flattened(height, 1.0) for name in NAMES}
    return float(bgars.Scene.ball_array(3, 3, height_um=460.0, defects=flat).balls[0].aspect_ratio)


def test_a_sound_part_passes_with_a_limit_on_warpage() -> None:
    result = bgars.inspect(capture(), PART)
    assert result.verdict == "pass", result.reasons
    assert 0.0 < result.u_warpage_um < 1.0
    assert "material fitted on 9 balls" in result.method_reason
    assert result.material is not None
    told = {row.name: row for row in result.material.parameters}
    assert not result.material.from_file
    assert 0 < told["diffuse_level"].standard_error < told["diffuse_level"].value
    assert {f"gain_{light}" for light in range(len(result.light_directions))} <= set(told)


@pytest.mark.parametrize("options", [{"elevation_deg": 46.0}, {"elevation_deg": 47.5}, {"height": 0.95}])
def test_flattened_balls_or_a_wrong_common_elevation_are_in_u_and_named(options: dict[str, float]) -> None:
    """Shadows cannot tell one from the other: U holds both, the warning names both, and near a limit nothing passes."""
    taken = capture(**options)
    true_um = 460.0 * options.get("height", 1.0)
    result = bgars.inspect(taken, PART)
    assert any("flatter" in text and "lamps" in text for text in result.warnings), result.warnings
    assert all(abs(ball.top_um - true_um) < 2.0 * ball.u_top_um for ball in result.balls)
    near = replace(PART, limits=bgars.Limits(height_um=(true_um + 4.0, 600.0)))
    assert "pass" not in {ball.verdict for ball in bgars.inspect(taken, near).balls}


def test_a_declared_rig_or_shape_settles_what_shadows_cannot() -> None:
    """Either of both, stated with its uncertainty, makes the heights good again."""
    flat = capture(height=0.95)
    told = replace(PART, aspect_ratio=flattened_q(0.95), u_aspect_ratio=0.002)
    rig = replace(flat, rig=flat.rig.with_u_deg(0.02))
    for taken, part in ((flat, told), (rig, PART)):
        result = bgars.inspect(taken, part)
        assert all(abs(ball.top_um - 437.0) < 3.0 for ball in result.balls)
        assert all(ball.u_top_um < 3.0 for ball in result.balls)


@pytest.mark.parametrize("shift_px", [-3, -4])
def test_an_image_shifted_along_its_light_does_not_pass(shift_px: int) -> None:
    taken = capture()
    images = taken.images.copy()
    images[0] = np.roll(images[0], shift_px, axis=1)
    result = bgars.inspect(replace(taken, images=images), PART)
    assert result.verdict == "undecided"
    assert any("image 0" in reason and "shifted" in reason for reason in result.reasons)


@pytest.mark.parametrize(("lights", "elevation_deg", "blur_px"), [(12, 38.0, 0.9), (6, 39.0, 0.4)])
def test_shadows_of_neighbours_beside_the_rim_are_no_shift(lights: int, elevation_deg: float, blur_px: float) -> None:
    jitter = bgars.Jitter(height_um=8, radius_um=3, position_um=5)
    board = bgars.Board(bgars.Material.matte(0.2), texture=bgars.Texture(0.15))
    scene = bgars.Scene.ball_array(5, 4, jitter=jitter, seed=5, board=board)
    camera = bgars.Camera(supersample=3, blur_px=blur_px, read_noise_levels=0.5)
    rig = bgars.LightRig.ring(lights, elevation_deg=elevation_deg)
    taken, _ = bgars.simulate(scene, rig, bgars.Material(i_d=0.5, i_s=1.0, hardness=10), camera, seed=5)
    assert not [warning for warning in bgars.inspect(taken).warnings if "shifted" in warning]


def test_a_finder_that_is_off_on_all_balls_alike_moves_no_centre() -> None:
    """A low-contrast rim under a blurred lens: outlines, which are sharper, say otherwise."""
    board = bgars.Board(bgars.Material.matte(0.3))
    scene = bgars.Scene.ball_array(4, 4, jitter=bgars.Jitter(position_um=5), seed=51, board=board)
    camera = bgars.Camera(supersample=2, blur_px=0.9, read_noise_levels=1.5, bit_depth=12)
    material = bgars.Material(i_d=0.1, i_s=1.0, hardness=80)
    taken, truth = bgars.simulate(scene, bgars.LightRig.ring(8, elevation_deg=54.0), material, camera, seed=51)
    found = bgars.find_balls(taken)
    off = replace(found, balls=tuple(replace(ball, x_px=ball.x_px + 0.2, u_centre_px=0.01) for ball in found.balls))
    measured = bgars.inspection.measure_balls(taken, off)
    errors = np.array([a.x_um - float(b.x_um or 0.0) for a, b in zip(measured.balls, truth.balls, strict=True)])
    assert abs(errors.mean()) < 0.3
