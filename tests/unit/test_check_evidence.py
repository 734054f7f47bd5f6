"""Checks on what little evidence there is: no information at all, single shiny parts, few grey levels, no shadows."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.checks.noise_levels import noise_curve
from bgars.cli.app import app
from bgars.records.plain_arrays import every_pixel
from numpy.typing import NDArray
from typer.testing import CliRunner

Levels = NDArray[np.float64]


@pytest.fixture(scope="module")
def ball() -> bgars.Capture:
    """A single glossy ball on a dark, plain board: no place that every lamp reaches without a highlight."""
    return bgars.read_capture(bgars.sample_capture())


@pytest.fixture(scope="module")
def bumps() -> bgars.Capture:
    """Matt bumps that cast no shadow, under an uneven ring."""
    y, x = np.mgrid[:96, :120].astype(np.float64)
    height = sum(
        size * np.exp(-((x - right) ** 2 + (y - down) ** 2) / (2.0 * wide**2))
        for right, down, wide, size in ((30, 40, 12, 7.0), (80, 30, 9, -5.0), (70, 70, 14, 8.0), (20, 80, 7, 4.0))
    )
    slope_x, slope_y = np.gradient(height, axis=1), -np.gradient(height, axis=0)
    normal = np.stack([-slope_x, -slope_y, np.ones_like(x)]) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    elevations = (50.0, 56.0, 49.0, 58.0, 47.0, 54.0, 59.0, 51.0)
    azimuths = (0.0, 50.0, 86.0, 144.0, 182.0, 218.0, 273.0, 321.0)
    rig = bgars.LightRig.from_angles(np.column_stack([azimuths, elevations]))
    albedo = np.where((x // 12 + y // 12) % 2 > 0, 0.7, 0.5)
    light = 255.0 * np.maximum(np.tensordot(rig.directions, normal, axes=(1, 0)), 0.0) * albedo
    images = np.rint(light + np.random.default_rng(1).normal(0.0, 0.7, light.shape)).clip(0, 255).astype(np.uint8)
    return bgars.Capture(images, rig, every_pixel((96, 120)), saturation=255.0)


def changed(capture: bgars.Capture, change: Callable[[Levels], Levels], image: int | None = None) -> bgars.Capture:
    """Change one image, or all."""
    levels = capture.images.astype(np.float64)
    if image is None:
        levels = change(levels)
    else:
        levels[image] = change(levels[image])
    return replace(capture, images=np.rint(levels).clip(0, 255).astype(np.uint8))


def with_lights(capture: bgars.Capture, directions: Levels) -> bgars.Capture:
    return replace(capture, rig=bgars.LightRig.from_directions(directions))


def told(capture: bgars.Capture) -> list[tuple[str, str, int | None]]:
    return [(each.severity, each.kind, each.image) for each in bgars.check(capture).told]


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda levels: np.broadcast_to(levels[3], levels.shape), "duplicate"),
        (lambda levels: 0.0 * levels, "dark"),
        (lambda levels: np.random.default_rng(0).uniform(0.0, 255.0, levels.shape), "noise"),
        (lambda levels: np.random.default_rng(1).normal(100.0, 60.0, levels.shape), "noise"),
        (lambda levels: levels + np.random.default_rng(0).normal(0.0, 25.0, levels.shape), "noise"),
        (lambda levels: 0.03 * levels + np.random.default_rng(0).normal(2.0, 1.5, levels.shape), "dark"),
    ],
    ids=["one image", "black", "uniform noise", "normal noise", "drowned", "drowned in the dark"],
)
def test_a_capture_without_information_is_refused(ball: bgars.Capture, change: object, kind: str) -> None:
    nothing = changed(ball, change)  # type: ignore[arg-type]
    assert told(nothing) == [("error", kind, None)]
    with pytest.raises(bgars.InputError, match="check=False continues"):
        bgars.reconstruct(nothing)


def test_blank_images_are_told_but_may_be_a_simulated_plane(ball: bgars.Capture) -> None:
    blank = changed(ball, lambda levels: np.full_like(levels, 100.0))
    assert [(each.severity, each.kind) for each in bgars.check(blank).findings] == [("note", "duplicate")]
    assert bgars.inspect(blank).verdict == "undecided"


def test_faults_are_told_of_a_single_shiny_ball(ball: bgars.Capture) -> None:
    assert told(ball) == []
    assert told(changed(ball, lambda image: 0.6 * image, 2)) == [("warning", "lamp-uneven", 2)]
    assert told(changed(ball, lambda image: image[::-1, ::-1], 2)) == [("error", "orientation", 2)]
    curved = bgars.check(changed(ball, lambda levels: 255.0 * (levels / 255.0) ** (1.0 / 2.2))).told
    assert [each.kind for each in curved] == ["response"]


@pytest.mark.parametrize(
    ("turn", "how"),
    [
        (lambda image: image[::-1, ::-1], "turned by 180 degrees"),
        (lambda image: image[:, ::-1], "mirrored left to right"),
        (lambda image: image[::-1], "mirrored top to bottom"),
    ],
)
def test_an_image_whose_texture_looks_the_same_turned(bumps: bgars.Capture, turn: object, how: str) -> None:
    (finding,) = bgars.check(changed(bumps, turn, 2)).told  # type: ignore[arg-type]
    assert (finding.severity, finding.kind, finding.image) == ("error", "orientation", 2)
    assert how in finding.message


def test_a_direction_that_stands_twice_in_the_table(bumps: bgars.Capture) -> None:
    lights = bumps.rig.directions.copy()
    lights[1] = lights[0]
    (finding,) = bgars.check(with_lights(bumps, lights)).told
    assert (finding.severity, finding.kind, finding.image) == ("error", "order", 1)
    assert "shows light from azimuth 50, elevation 5" in finding.message
    assert "the table says azimuth 0, elevation 50 degrees" in finding.message


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_a_lamp_of_another_strength_stands_where_it_should(bumps: bgars.Capture, factor: float) -> None:
    assert told(changed(bumps, lambda image: factor * image, 3)) == [("warning", "lamp-uneven", 3)]


def test_lights_of_uneven_elevation_hide_no_curve(bumps: bgars.Capture) -> None:
    assert told(bumps) == []
    (finding,) = bgars.check(changed(bumps, lambda levels: 255.0 * (levels / 255.0) ** (1.0 / 2.2))).told
    assert finding.kind == "response"


def test_cast_shadows_name_the_axis(ball: bgars.Capture) -> None:
    """Shading cannot tell x from y: with shadows one is told, and it is the right one."""
    for axis, sign in (("x", [-1, 1, 1]), ("y", [1, -1, 1])):
        (finding,) = bgars.check(with_lights(ball, ball.rig.directions * sign)).told
        assert f"change the sign of {axis} in the table" in finding.advice
        assert "half a turn" not in finding.message
    shifted = bgars.check(with_lights(ball, np.roll(ball.rig.directions, 2, axis=0))).told
    assert "light_00.png shows light 2 (" in shifted[0].message


def test_without_cast_shadows_both_are_named(bumps: bgars.Capture) -> None:
    lights = bumps.rig.directions
    for sign in ([-1, 1, 1], [1, -1, 1]):
        (finding,) = bgars.check(with_lights(bumps, lights * sign)).told
        assert "other side in y:" in finding.message
        assert "or x:" in finding.message
        assert "change the sign of y" in finding.advice
        assert "change the sign of x" in finding.advice
    for sign in ([-1, 1, 1], [1, -1, 1]):
        (finding,) = bgars.check(with_lights(bumps, lights[:, [1, 0, 2]] * sign)).told
        assert "turned by +90 or -90 degrees" in finding.message


@pytest.mark.parametrize(("step", "levels"), [(255, 2), (32, 8)])
def test_few_grey_levels_are_named(ball: bgars.Capture, step: int, levels: int) -> None:
    few = changed(ball, lambda each: each // 32 * 32 if step == 32 else 255.0 * (each > 100.0))
    (finding,) = bgars.check(few).told
    assert finding.kind == "bit-depth"
    assert f"the images have {levels} grey levels, {step} apart" in finding.message


@pytest.mark.parametrize("seed", range(6))
def test_equal_noise_everywhere_is_no_curve(seed: int) -> None:
    """A small shiny cap, such as fills its image: relief and edges add to the noise of dark flanks."""
    random = np.random.default_rng(seed)
    y, x = (np.mgrid[:96, :96] - 47.5) / 47.5
    square = x**2 + y**2
    z = np.sqrt(np.maximum(1.3 - square, 0.05))
    normal = np.stack([x, -y, z]) / np.sqrt(square + z**2)
    rig = bgars.LightRig.ring(8, elevation_deg=50.0)
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.maximum(np.tensordot(half, normal, axes=(1, 0)), 0.0) ** 30
    light = 110.0 * np.maximum(np.tensordot(rig.directions, normal, axes=(1, 0)), 0.0) + 120.0 * shine
    images = np.rint(light + random.normal(0.0, 0.8, light.shape)).clip(0, 255).astype(np.uint8)
    capture = bgars.Capture(images, rig, square < 0.9, saturation=255.0)
    assert [each.kind for each in bgars.check(capture).told] == []


def test_the_noise_of_a_bin_has_its_standard_error() -> None:
    """White noise: what is told as noise scatters as said, whatever the filters overlap."""
    random = np.random.default_rng(2)
    apart = []
    for _ in range(60):
        images = np.rint(120.0 + random.normal(0.0, 3.0, (8, 40, 40))).astype(np.uint8)
        curve = noise_curve(bgars.Capture(images, bgars.LightRig.ring(8), every_pixel((40, 40)), saturation=255.0))
        assert curve is not None
        expected = (9.0 + 1.0 / 12.0) * 7.0 / 8.0 / 255.0**2  # over the mean of eight
        apart.append((curve.noise[curve.lit] - expected) / curve.error[curve.lit])
    assert abs(float(np.mean(apart))) < 0.6
    assert 0.4 < float(np.std(apart)) < 1.2


def test_a_bright_ball_in_the_middle_is_no_vignetting() -> None:
    board = bgars.Board(material=bgars.Material.matte(0.06), texture=bgars.Texture(contrast=0.05, scale_um=200.0))
    scene = bgars.Scene.ball_array(1, 1, diameter_um=800.0, height_um=600.0, board=board)
    rig = bgars.LightRig.ring(8, elevation_deg=60.0)
    camera = bgars.Camera(pixel_pitch_um=6.0, full_well_e=15000.0, read_noise_levels=0.5, blur_px=0.6)
    capture = bgars.simulate(scene, rig, bgars.Material(i_d=0.4, i_s=0.2, hardness=20), camera, seed=1)[0]
    assert "vignetting" not in [each.kind for each in bgars.check(capture)]


@pytest.mark.parametrize("name", ["GIF", "JPEG", "WebP"])
def test_formats_made_for_the_eye_are_told_once(bumps: bgars.Capture, name: str, tmp_path: Path) -> None:
    for index, image in enumerate(bumps.images):
        iio.imwrite(tmp_path / f"{index}.{name.lower()}", image, **({"quality": 98} if name == "JPEG" else {}))
    np.savetxt(tmp_path / "light_directions.txt", bumps.rig.directions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = bgars.check(tmp_path).findings
    assert [(each.severity, each.kind) for each in found] == [("note", "response")]
    assert found[0].message == f"{name} is hardly ever linear in light, but is taken as linear"
    run = CliRunner().invoke(app, ["check", str(tmp_path)])
    assert run.output.count("hardly ever") == 1
