"""Balls found in simulated captures, against what was simulated."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.balls.circles import _without_overlaps
from bgars.balls.highlights import highlight_circles
from bgars.balls.levels import Levels
from bgars.balls.rim_scan import CoarseCircles, seen_by_most
from bgars.records import ball_names
from bgars.simulate import ball_name

SHINY = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
RING = bgars.LightRig.ring(8)
CAMERA = bgars.Camera(pixel_pitch_um=12.0, supersample=4)


def compare(capture: bgars.Capture, truth: bgars.SimulatedTruth, found: bgars.FoundBalls) -> np.ndarray:
    """Errors (x, y, radius) in pixels of balls matched by name; the names are the same."""
    pitch_um = capture.pixel_pitch_um
    true = {ball.name: ball for ball in truth.balls if ball.present}
    assert {ball.name for ball in found.balls} == set(true)
    assert {name for name, _, _ in found.missing} == {ball.name for ball in truth.balls if not ball.present}
    return np.array(
        [
            (
                ball.x_px - true[ball.name].x_um / pitch_um,
                ball.y_px - true[ball.name].y_um / pitch_um,
                ball.radius_px - true[ball.name].diameter_um / 2 / pitch_um,
            )
            for ball in found.balls
        ]
    )


def grid(**options: object) -> bgars.Scene:
    return bgars.Scene.ball_array(4, 5, jitter=bgars.Jitter(height_um=8, radius_um=3, position_um=4), seed=2, **options)


@pytest.mark.parametrize("elevation_deg", [32.0, 45.0, 58.0])
def test_defects_are_named_and_circles_are_right_to_hundredths_of_a_pixel(elevation_deg: float) -> None:
    scene = grid(
        rotation_deg=1.5,
        defects={
            "B2": bgars.Defect.missing(),
            "C3": bgars.Defect.size(0.8),
            "B4": bgars.Defect.offset(70, 40),
            "A5": bgars.Defect.flattened(),
        },
        bridges=[bgars.Bridge("D3", "D4", radius_um=110.0)],
        board=bgars.Board(bgars.Material.matte(0.12), texture=bgars.Texture(0.2)),
    )
    rig = bgars.LightRig.ring(8, elevation_deg=elevation_deg)
    capture, truth = bgars.simulate(scene, rig, SHINY, CAMERA)
    found = bgars.find_balls(capture)
    error = compare(capture, truth, found)
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.05
    assert np.abs(error[:, 2]).max() < 0.06
    assert abs(error[:, 2].mean()) < 0.03
    assert found.bridges == (("D3", "D4"),)
    assert {ball.name for ball in found.balls if ball.kind == "bridged"} == {"D3", "D4"}
    assert (found.rows, found.cols) == (4, 5)
    assert found.angle_deg == pytest.approx(1.5, abs=0.1)
    assert found.pitch_px == pytest.approx(1000 / 12, rel=2e-3)


@pytest.mark.parametrize("material", [bgars.Material.matte(0.5), bgars.Material(i_d=0.1, i_s=1.5, hardness=80)])
def test_matte_and_metallic_balls_with_noise(material: bgars.Material) -> None:
    camera = bgars.Camera(pixel_pitch_um=12.0, bit_depth=12, supersample=4, full_well_e=15000, read_noise_levels=30)
    capture, truth = bgars.simulate(grid(defects={"C2": bgars.Defect.missing()}), RING, material, camera, seed=3)
    error = compare(capture, truth, bgars.find_balls(capture))
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.08
    assert np.abs(error[:, 2]).max() < 0.1


@pytest.mark.parametrize("hardness", [20, 80])
def test_metal_on_a_dark_board_is_placed_by_its_highlights(hardness: int) -> None:
    defects = {"B2": bgars.Defect.size(0.8), "C4": bgars.Defect.flattened()}
    scene = grid(defects=defects, board=bgars.Board(bgars.Material.matte(0.03)))
    camera = bgars.Camera(pixel_pitch_um=12.0, supersample=3, full_well_e=15000, read_noise_levels=0.2)
    metal = bgars.Material(i_d=0.02, i_s=1.0, hardness=hardness)
    capture, truth = bgars.simulate(scene, RING, metal, camera, seed=4)
    found = bgars.find_balls(capture)
    error = compare(capture, truth, found)
    # No population tells where the highlights of the one flattened ball belong: it is found, less well.
    others = np.array([ball.name != "C4" for ball in found.balls])
    assert np.hypot(error[others, 0], error[others, 1]).max() < 0.05
    assert np.abs(error[others, 2]).max() < 0.1
    assert np.abs(error).max() < 0.3
    assert np.abs(error[:, 2] / [ball.u_radius_px for ball in found.balls]).max() < 3.0


def test_highlights_know_centres_and_relative_radii_from_wrong_circles() -> None:
    camera = bgars.Camera(pixel_pitch_um=12.0, supersample=3)
    capture, truth = bgars.simulate(grid(), RING, bgars.Material(i_d=0.02, i_s=1.0, hardness=40), camera)
    true = np.array([(ball.x_um, ball.y_um, ball.diameter_um / 2) for ball in truth.balls]) / 12.0
    height, width = capture.mask.shape
    row, col = height / 2 - 0.5 - true[:, 1], true[:, 0] + width / 2 - 0.5
    shine = highlight_circles(Levels(capture, 1), row + 1.5, col - 1.5, 0.85 * true[:, 2])
    assert np.hypot(shine.row - row, shine.col - col).max() < 0.02
    ratio = shine.radius_px / true[:, 2]
    assert np.std(ratio) < 0.001
    assert 0.98 < ratio.mean() < 1.03


def test_uncertainties_cover_the_errors_of_textured_balls() -> None:
    camera = bgars.Camera(pixel_pitch_um=12.0, supersample=4, full_well_e=10000, read_noise_levels=0.2)
    board = bgars.Board(bgars.Material.matte(0.2), texture=bgars.Texture(0.4))
    capture, truth = bgars.simulate(grid(board=board), RING, SHINY, camera, seed=5)
    found = bgars.find_balls(capture)
    error = compare(capture, truth, found)
    u_centre = np.array([ball.u_centre_px for ball in found.balls])
    u_radius = np.array([ball.u_radius_px for ball in found.balls])
    assert np.sqrt(np.mean((error[:, :2] / u_centre[:, None]) ** 2)) < 2.0
    assert np.sqrt(np.mean((error[:, 2] / u_radius) ** 2)) < 2.0
    assert u_radius.max() < 0.1


def test_near_lights() -> None:
    angle = np.radians(np.arange(8) * 45.0)
    positions_um = np.stack([32000 * np.cos(angle), 32000 * np.sin(angle), np.full(8, 32000.0)], axis=1)
    capture, truth = bgars.simulate(grid(), bgars.LightRig.from_positions(positions_um), SHINY, CAMERA)
    error = compare(capture, truth, bgars.find_balls(capture))
    assert np.abs(error).max() < 0.06


def test_a_single_ball_and_an_empty_board() -> None:
    capture, truth = bgars.simulate(bgars.Scene.ball(600.0), RING, SHINY, CAMERA)
    found = bgars.find_balls(capture)
    capture_error = np.abs([found.balls[0].x_px, found.balls[0].y_px, found.balls[0].radius_px - 25.0])
    assert len(truth.balls) == len(found.balls) == 1
    assert capture_error.max() < 0.03
    assert found.pitch_px is None
    board = bgars.Board(bgars.Material.matte(0.3), texture=bgars.Texture(0.4))
    empty, _ = bgars.simulate(bgars.Scene.plane(size_um=(3000, 3000), board=board), RING, SHINY, CAMERA)
    assert bgars.find_balls(empty).balls == ()


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_saturated_captures_have_no_balls(level: int) -> None:
    images = np.full((8, 90, 100), level, np.uint8)
    capture = bgars.Capture(images, RING, np.broadcast_to(np.True_, (90, 100)), saturation=255.0)
    found = bgars.find_balls(capture)
    assert found.balls == found.missing == found.bridges == ()


def test_a_round_mask_is_a_silhouette_and_another_shape_is_none() -> None:
    capture, _ = bgars.simulate(bgars.Scene.ball(600.0), RING, SHINY, CAMERA)
    height, width = capture.mask.shape
    row, col = np.indices((height, width))
    disc = np.hypot(row - height / 2 + 0.5, col - width / 2 + 0.5) <= 25.0
    ball = bgars.find_balls(replace(capture, mask=disc)).balls[0]
    assert ball.radius_px == pytest.approx(25.0, abs=0.1)
    half = disc & (col < width / 2)
    assert bgars.find_balls(replace(capture, mask=half)).balls == ()


def test_a_layout_tells_missing_and_extra_balls_apart() -> None:
    scene = grid(defects={"A1": bgars.Defect.missing(), "A2": bgars.Defect.missing()})
    capture, _ = bgars.simulate(scene, RING, SHINY, CAMERA)
    layout = bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0, depopulated=("A1", "C3"))
    found = bgars.find_balls(capture, layout=layout)
    assert [name for name, _, _ in found.missing] == ["A2"]
    assert [ball.name for ball in found.balls if ball.kind == "extra"] == ["X1"]
    listed = bgars.BallLayout(positions=tuple((f"P{n}", 1000.0 * (n % 5), -1000.0 * (n // 5)) for n in range(20)))
    found = bgars.find_balls(capture, layout=listed)
    assert [name for name, _, _ in found.missing] == ["P0", "P1"]
    assert found.balls[0].name == "P2"


def test_a_layout_that_does_not_fit_is_refused() -> None:
    capture, _ = bgars.simulate(grid(), RING, SHINY, CAMERA)
    with pytest.raises(bgars.InputError, match=r"layout: "):
        bgars.find_balls(capture, layout=bgars.BallLayout(rows=4, cols=5, pitch_um=1500.0))
    words = r"layout: pitch_um: must be within 10 % of the image's at .* 12, which is (999|1000)(\.\d)?, got 880"
    with pytest.raises(bgars.InputError, match=words):
        bgars.find_balls(capture, layout=bgars.BallLayout(rows=4, cols=5, pitch_um=880.0))
    with pytest.raises(bgars.InputError, match=r"layout\.depopulated: .*'I1'"):
        bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0, depopulated=("I1",))
    with pytest.raises(bgars.InputError, match=r"pixel_pitch_um"):
        bgars.find_balls(
            replace(capture, pixel_pitch_um=None), layout=bgars.BallLayout(rows=4, cols=5, pitch_um=1000.0)
        )


def test_the_result_does_not_depend_on_threads() -> None:
    capture, _ = bgars.simulate(grid(), RING, SHINY, CAMERA)
    assert bgars.find_balls(capture, threads=1) == bgars.find_balls(capture, threads=2)


def test_names_are_those_of_the_simulator() -> None:
    assert all(ball_names.ball_name(row, col) == ball_name(row + 1, col + 1) for row in range(60) for col in range(3))


def test_ends_of_shadows_around_a_ball_are_no_ball() -> None:
    """Shadows of a ring of lights end on a circle, as sharp and as complete as the ball's own outline."""
    y, x = np.mgrid[:160, :160] - 79.5
    ball = np.hypot(x, y) < 26.0
    images = np.full((8, 160, 160), 100.0, np.float32)
    for image, angle in zip(images, np.radians(np.arange(8) * 45.0), strict=True):
        image[np.hypot(x - 16.0 * np.cos(angle), y - 16.0 * np.sin(angle)) < 26.0] = 2.0
        image[ball] = 55.0 - 25.0 * ((x * np.cos(angle) + y * np.sin(angle)) / 26.0)[ball]
    images += np.random.default_rng(0).normal(0.0, 4.0, images.shape).astype(np.float32)
    middle, size = np.full(2, 79.5), np.array([26.0, 42.0])
    circles = CoarseCircles(middle, middle, size, np.array([0.95, 0.94]), np.ones(2))
    assert _without_overlaps(circles, seen_by_most(images, circles)).radius_px.tolist() == [26.0]
    # Of a larger ball, an edge inside it that most lights show less is a part.
    larger = np.where(np.hypot(x, y) < 42.0, np.where(ball, 45.0, 35.0), np.full((8, 1, 1), 100.0)).astype(np.float32)
    assert _without_overlaps(circles, seen_by_most(larger, circles)).radius_px.tolist() == [42.0]
