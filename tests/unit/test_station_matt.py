"""Lights from a matt ball: seen by a camera at a distance, and in images whose shadows are cut at black."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from numpy.typing import NDArray
from rendered_spheres import render, ring, unit
from test_station_lights import capture_of, off_deg

LIGHTS = ring(4, 45.0)


def matt_ball(camera_px: float, black: float, ball: tuple[float, float, float], seed: int) -> NDArray[np.uint8]:
    """A matt ball on a black board: every pixel is the mean of 4 x 4 rays from a pinhole above the middle."""
    side, fine = 200, 4
    x, y = np.meshgrid(np.arange(side * fine), np.arange(side * fine))
    foot = np.stack([(x + 0.5) / fine - side / 2, side / 2 - (y + 0.5) / fine, np.zeros(x.shape)], axis=-1)
    way = unit(foot - np.array([0.0, 0.0, camera_px]))
    off = foot - np.array(ball)
    along = -np.sum(off * way, axis=-1)
    depth = ball[2] ** 2 - np.sum((off + along[..., None] * way) ** 2, axis=-1)
    normals = unit(off + (along - np.sqrt(np.maximum(depth, 0.0)))[..., None] * way)
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (len(LIGHTS), side, side))
    shades = [np.where(depth > 0, 150.0 * np.maximum(normals @ light, 0.0), 0.0) for light in LIGHTS]
    means = [shade.reshape(side, fine, side, fine).mean(axis=(1, 3)) for shade in shades]
    return np.clip(np.rint(np.array(means) + black + noise), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("place", [(0.0, 0.0), (28.0, -18.0)])
def test_the_distance_of_the_camera_counts_for_a_matt_ball(place: tuple[float, float]) -> None:
    images = matt_ball(1500.0, 8.0, (*place, 55.0), seed=1)
    capture = capture_of(images, camera_distance_mm=15.0, pixel_pitch_um=10.0, black_level=8.0)
    found = bgars.calibrate_lights(capture, sphere="matt")
    off = off_deg(found.rig.directions, LIGHTS)
    assert off.max() < 0.15
    assert (off < 3.0 * np.sqrt(2.0) * found.u_deg).all()


def test_a_camera_at_a_distance_needs_a_scale_for_a_matt_ball_too() -> None:
    images = matt_ball(1500.0, 8.0, (0.0, 0.0, 55.0), seed=2)
    with pytest.raises(bgars.InputError, match="needs a scale"):
        bgars.calibrate_lights(capture_of(images, camera_distance_mm=15.0), sphere="matt")


@pytest.mark.parametrize("black", [0.0, 1.0])
def test_noise_that_is_cut_at_black_does_not_lift_the_shadow(black: float) -> None:
    """Its mean is not 0: lights came out 0.2 degrees low, together."""
    images = matt_ball(1e7, black, (8.3, -5.7, 60.0), seed=3)
    found = bgars.calibrate_lights(capture_of(images, camera_distance_mm=np.inf, black_level=black), sphere="matt")
    assert off_deg(found.rig.directions, LIGHTS).mean() < 0.08


def test_vignetting_tilts_lights_by_what_the_page_says() -> None:
    """A limit that docs/station.md states: 20 % at the corners, a ball of half the image in its middle."""
    images = matt_ball(1e7, 8.0, (0.0, 0.0, 50.0), seed=6) - 8.0
    along = (np.arange(200) - 99.5) / 100.0
    spoiled = np.rint(8.0 + images * (1.0 - 0.1 * (along**2 + along[:, None] ** 2))).astype(np.uint8)
    found = bgars.calibrate_lights(capture_of(spoiled, camera_distance_mm=np.inf, black_level=8.0), sphere="matt")
    elevation_deg = np.degrees(np.arcsin(found.rig.directions[:, 2]))
    assert (elevation_deg - 45.0).mean() == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("elevation_deg", [30.0, 60.0])
def test_a_lamp_a_hundred_radii_away_is_not_seen_lower(elevation_deg: float) -> None:
    """Taken as infinitely far, it is by 1.2 degrees: the part of the ball that turns to it is nearer to it."""
    lights = ring(4, elevation_deg)
    images = render(
        1e4 * lights + np.array([7.3, -4.6, 100.0]),
        ball=(7.3, -4.6, 100.0), size=(260, 260), kind="matt", board=0.05, samples=2, near=True, seed=4,
    )  # fmt: skip
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(4), mask=np.ones((260, 260), np.bool_), saturation=255.0,
        camera_distance_mm=np.inf,
    )  # fmt: skip
    found = bgars.calibrate_lights(capture, sphere="matt")
    off = off_deg(found.rig.directions, unit(1e4 * lights + np.array([7.3, -4.6, 100.0])))
    assert off.max() < 0.25
    assert (off < 3 * np.sqrt(2) * found.u_deg).all()
    # Lamps that are alike are known by what they have in common.
    assert (found.u_own_deg < 0.5 * found.u_common_deg).all()


@pytest.mark.parametrize(("level", "words"), [(0.0, "too dark on the ball"), (255.0, "overexposed")])
def test_an_image_without_shading_is_refused_by_name(level: float, words: str) -> None:
    images = matt_ball(1e7, 0.0, (8.3, -5.7, 60.0), seed=3)
    images[2] = np.where(images[2] > 0, level, 0).astype(np.uint8)
    with pytest.raises(bgars.CalibrationError, match=f"light 2.*{words}"):
        bgars.calibrate_lights(capture_of(images, camera_distance_mm=np.inf), sphere="matt", outline=[8.3, -5.7, 60.0])


def test_images_that_are_not_linear_are_named_and_do_not_tilt_lights_unnoticed() -> None:
    """Taken for a lamp that does not fall off, a gamma of 1.8 turned lights by 6 degrees, at a u of 0.8."""
    linear = matt_ball(1e7, 0.0, (8.3, -5.7, 60.0), seed=6).astype(np.float64)
    images = np.rint(255.0 * (linear / 255.0) ** (1.0 / 1.8)).astype(np.uint8)
    found = bgars.calibrate_lights(capture_of(images, camera_distance_mm=np.inf), sphere="matt")
    (doubt,) = (one for one in found.doubts if one.code == "not-linear")
    assert "the images are not linear (calibrate the response first), or the ball is not matt" in doubt.message
    assert (off_deg(found.rig.directions, LIGHTS) < 2.0 * np.sqrt(2.0) * found.u_deg).all()
    plain = bgars.calibrate_lights(capture_of(linear.astype(np.uint8), camera_distance_mm=np.inf), sphere="matt")
    assert not {"not-linear"} & {one.code for one in plain.findings}


def test_lamps_at_unlike_distances_are_within_their_uncertainty() -> None:
    """The lamps of a ball share one distance; 80 to 125 radii are within the spread that is reckoned with."""
    lights = ring(5, 45.0)
    images = render(
        1e4 * lights * np.array([[0.8], [0.9], [1.0], [1.1], [1.25]]) + np.array([7.3, -4.6, 100.0]),
        ball=(7.3, -4.6, 100.0), size=(260, 260), kind="matt", board=0.05, samples=2, near=True, seed=5,
    )  # fmt: skip
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(5), mask=np.ones((260, 260), np.bool_), saturation=255.0,
        camera_distance_mm=np.inf,
    )  # fmt: skip
    found = bgars.calibrate_lights(capture, sphere="matt")
    true = unit(1e4 * lights * np.array([[0.8], [0.9], [1.0], [1.1], [1.25]]) + np.array([7.3, -4.6, 100.0]))
    off = off_deg(found.rig.directions, true)
    assert (off < 2 * np.sqrt(2) * found.u_deg).all()
