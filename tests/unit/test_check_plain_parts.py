"""Checks of good parts of simple shapes, with little texture or none: what their symmetry makes alike is no fault."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.checks.gains import check_gains
from bgars.checks.view import make_view
from bgars.records.plain_arrays import every_pixel
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]


def part(
    shape: str, texture: float = 0.0, *, count: int = 8, elevation_deg: float = 45.0, azimuth0_deg: float = 0.0
) -> bgars.Capture:
    """A matt part of 120 x 120 pixels under a ring, 8 bits; texture: relative standard deviation of its albedo."""
    random = np.random.default_rng(1)
    y, x = np.mgrid[:120, :120] * 1.0
    x, y = x - 59.5, 59.5 - y
    height = {
        "pin": np.sqrt(np.maximum(100.0**2 - x**2, 0.0)),
        "grooves": 3.0 * np.sin(x / 6.0),
        "V grooves": 0.4 * np.abs(x % 24.0 - 12.0),
        "cap": -0.006 * (x**2 + y**2),
        "dish": 0.004 * (x**2 + y**2),
        "saddle": 0.004 * (x**2 - y**2),
        "tilted": 0.2 * x + 0.1 * y,
    }[shape]
    slope_x, slope_y = np.gradient(height, axis=1), -np.gradient(height, axis=0)
    normal = np.stack([-slope_x, -slope_y, np.ones_like(x)]) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    clouds = gaussian_filter(random.normal(size=x.shape), 1.5)
    albedo = 0.54 * (1.0 + texture * clouds / clouds.std())
    rig = bgars.LightRig.ring(count, elevation_deg=elevation_deg, azimuth0_deg=azimuth0_deg)
    light = albedo * np.maximum(np.tensordot(rig.directions, normal, axes=(1, 0)), 0.0)
    images = np.clip(np.rint(255.0 * (light + random.normal(0.0, 0.002, light.shape))), 0, 255).astype(np.uint8)
    return bgars.Capture(images, rig, every_pixel(x.shape), saturation=255.0)


def told(capture: bgars.Capture) -> list[tuple[str, str, int | None]]:
    return [(each.severity, each.kind, each.image) for each in bgars.check(capture).told]


@pytest.mark.parametrize(
    ("shape", "azimuth0_deg"), [("pin", 0.0), ("grooves", 0.0), ("V grooves", 22.5)], ids=["pin", "grooves", "V"]
)
def test_lights_on_both_sides_of_a_groove_are_two(shape: str, azimuth0_deg: float) -> None:
    capture = part(shape, 0.1, azimuth0_deg=azimuth0_deg)
    assert told(capture) == []
    twice = capture.images.astype(np.float64)
    twice[2] = twice[1] + np.random.default_rng(0).normal(0.0, 0.8, twice[1].shape)
    twice = np.clip(np.rint(twice), 0, 255).astype(np.uint8)
    assert ("error", "duplicate", 2) in told(replace(capture, images=twice))


@pytest.mark.parametrize(("shape", "count", "elevation_deg"), [("cap", 4, 35), ("cap", 12, 50), ("dish", 8, 45)])
def test_a_smooth_part_is_its_own_mirror_image(shape: str, count: int, elevation_deg: float) -> None:
    assert told(part(shape, count=count, elevation_deg=elevation_deg)) == []


def test_a_plane_without_texture_says_nothing() -> None:
    assert told(part("tilted")) == []


def test_a_saddle_is_asked_about_and_no_error() -> None:
    saddle = part("saddle", 0.1, azimuth0_deg=10.0)
    (finding,) = bgars.check(saddle).told
    assert (finding.severity, finding.kind) == ("warning", "handedness")
    assert finding.message.startswith("either the part is a saddle, or ")


@pytest.mark.parametrize("factor", [0.5, 0.75, 1.25])
def test_an_uneven_lamp_is_no_step_in_another_image(factor: float) -> None:
    dish = part("dish", 0.05, azimuth0_deg=10.0)
    images = 0.75 * dish.images
    images[2] *= factor
    assert told(replace(dish, images=np.rint(images).astype(np.uint8))) == [("warning", "lamp-uneven", 2)]


@pytest.mark.parametrize(("images", "down", "right"), [((5, 6, 7), 2, -2), ((3,), 4, 3), ((2,), -7, 1)])
def test_images_of_a_flat_plate_that_lie_elsewhere_have_moved(images: tuple[int, ...], down: int, right: int) -> None:
    """They differ from the others as by a camera curve, or by noise only among each other."""
    random = np.random.default_rng(4)
    clouds = gaussian_filter(random.normal(size=(200, 200)), 1.5)
    light = np.repeat(80.0 * (1.0 + 0.25 * clouds / clouds.std())[None], 8, axis=0)
    for index in images:
        light[index] = np.roll(light[index], (down, right), axis=(0, 1))
    levels = np.clip(np.rint(light + random.normal(0.0, 0.8, light.shape)), 0, 255).astype(np.uint8)
    rig = bgars.LightRig.ring(8, azimuth0_deg=10.0)
    plate = bgars.Capture(levels, rig, every_pixel((200, 200)), saturation=255.0)
    assert told(plate) == [("warning", "motion", images[0])]


def test_a_cap_that_slopes_away_is_no_vignetting() -> None:
    assert [each.kind for each in bgars.check(part("cap", 0.05, azimuth0_deg=10.0)).findings] == []


def test_near_lamps_whose_places_are_stated_make_no_steps_of_light() -> None:
    y, x = np.mgrid[:100, :100] * 100.0
    x, y = x - 4950.0, 4950.0 - y
    positions = 25_000.0 * bgars.LightRig.ring(8, azimuth0_deg=10.0).directions
    away = np.stack([positions[:, 0, None, None] - x, positions[:, 1, None, None] - y])
    square = np.square(away).sum(axis=0) + positions[:, 2, None, None] ** 2
    light = positions[:, 2, None, None] * square**-1.5
    light += np.random.default_rng(0).normal(0.0, 0.002, light.shape) * light.max()
    images = np.clip(np.rint(230.0 * light / light.max()), 0, 255).astype(np.uint8)
    rig = bgars.LightRig.from_positions(positions)
    assert told(bgars.Capture(images, rig, every_pixel((100, 100)), saturation=255.0, pixel_pitch_um=100.0)) == []


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.45])
def test_a_veil_shows_where_a_ball_faces_away_from_a_lamp(share: float) -> None:
    random = np.random.default_rng(2)
    y, x = np.mgrid[:120, :120] * 1.0
    x, y = (x - 59.5) / 54.0, (59.5 - y) / 54.0
    mask = x**2 + y**2 < 1.0
    normal = np.stack([x, y, np.sqrt(np.where(mask, 1.0 - x**2 - y**2, 0.0))]) * mask
    rig = bgars.LightRig.ring(8, elevation_deg=40.0, azimuth0_deg=10.0)
    light = np.maximum(np.tensordot(rig.directions, normal, axes=(1, 0)), 0.0)
    lit = float(np.median(np.median(light, axis=0)[mask]))
    for veil, wanted in ((0.0, []), (share * lit / (1.0 - share), ["ambient"])):
        levels = 140.0 * (light + veil * mask) + random.normal(0.0, 0.7, light.shape)
        images = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        found = bgars.check(bgars.Capture(images, rig, mask, saturation=255.0)).told
        assert [each.kind for each in found] == wanted
    assert found[0].value == pytest.approx(share, rel=0.3)


@pytest.mark.parametrize(("scatter", "images"), [(0.06, []), (0.02, [2])])
def test_a_lamp_is_off_all_over_the_image_alike(scatter: float, images: list[int]) -> None:
    """What highlights add scatters over the tiles of a shiny part, however well their mean is known."""
    view = make_view(part("dish"))

    def measure(lights: Array) -> tuple[Array, Array, float]:
        gain = np.where(np.arange(8) == 2, 0.83, 1.0) / np.linalg.norm(lights, axis=1)
        return gain, np.full(8, scatter / 8.0), 64.0

    assert [each.image for each in check_gains(view, measure, view.lights)[0]] == images


@pytest.mark.parametrize(("shape", "texture"), [("cap", 0.15), ("tilted", 0.05), ("saddle", 0.15)])
def test_the_same_picture_twice_is_told_before_all_else(shape: str, texture: float) -> None:
    """It also looks as if it had moved, or shown another light."""
    capture = part(shape, texture)
    images = capture.images.copy()
    images[5] = images[4]
    assert told(replace(capture, images=images))[0] == ("error", "duplicate", 5)
