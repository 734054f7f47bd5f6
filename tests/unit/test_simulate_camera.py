"""Noise, response, clipping, sampling: the camera's part."""

from __future__ import annotations

from typing import Any

import bgars
import numpy as np
import pytest

RIG = bgars.LightRig.ring(4)
LEVEL = RIG.directions[0, 2]  # signal of a white matte plane


def plane(i_d: float = 0.4, **camera: Any) -> bgars.Capture:  # noqa: ANN401 - arguments of a Camera
    board = bgars.Board(material=bgars.Material.matte(i_d))
    camera = {"pixel_pitch_um": 10.0, "shape": (200, 200), **camera}
    return bgars.simulate(bgars.Scene.plane(board=board), RIG, bgars.Material(), bgars.Camera(**camera), seed=11)[0]


@pytest.mark.parametrize("i_d", [0.05, 0.4, 1.0])
def test_shot_and_read_noise_have_the_variance_they_promise(i_d: float) -> None:
    full_well_e, read_levels = 5000.0, 150.0
    capture = plane(i_d, bit_depth=16, full_well_e=full_well_e, read_noise_levels=read_levels, black_level=3000.0)
    values = capture.images.astype(np.float64)
    signal = i_d * LEVEL
    variance = signal * 65535.0**2 / full_well_e + read_levels**2 + 1 / 12
    count = values.size
    # Mean: 4 standard errors. Variance: chi-square of 160,000 degrees of freedom has a relative deviation of 0.0035.
    assert abs(values.mean() - (signal * 65535 + 3000)) < 4 * np.sqrt(variance / count)
    assert values.var() / variance == pytest.approx(1.0, abs=4 * np.sqrt(2 / count))


def test_noise_is_independent_between_pixels_rows_lights_and_seeds() -> None:
    noise = plane(read_noise_levels=3.0, bit_depth=16).images.astype(np.float64)
    noise -= noise.mean()
    pairs = [
        (noise[:, :, 1:], noise[:, :, :-1]),
        (noise[:, 1:], noise[:, :-1]),
        (noise[1:], noise[:-1]),
    ]
    for first, second in pairs:
        correlation = (first * second).mean() / noise.var()
        assert abs(correlation) < 4 / np.sqrt(first.size)


def test_a_clean_camera_is_clean() -> None:
    assert len(np.unique(plane().images)) == 1
    assert plane().images[0, 0, 0] == round(255 * 0.4 * LEVEL)


def test_gain_black_level_and_saturation() -> None:
    assert plane(gain=2.0).images[0, 0, 0] == round(255 * 0.8 * LEVEL)
    assert plane(black_level=10.0).images[0, 0, 0] == round(255 * 0.4 * LEVEL + 10)
    clipped = plane(1.0, gain=2.0, saturation=200.0)
    assert (clipped.images == 200).all()
    assert clipped.saturation == 200.0
    twelve = plane(1.0, gain=2.0, bit_depth=12, saturation=50000.0)
    assert (twelve.images >= twelve.saturation).all(), "what clips counts as clipped, whatever the codes"


@pytest.mark.parametrize("bit_depth", [8, 16])
def test_gamma_and_its_inverse_meet(bit_depth: int) -> None:
    full = 255 if bit_depth == 8 else 65535
    capture = plane(gamma=2.2, bit_depth=bit_depth, black_level=20.0)
    assert capture.response is not None
    assert capture.response.shape == (full + 1,)
    black = capture.response[20]
    linear = capture.response[capture.images[0, 0, 0]] - black
    slope = float(np.diff(capture.response)[capture.images[0, 0, 0]])
    assert linear == pytest.approx(full * 0.4 * LEVEL, abs=slope)
    assert capture.response[[0, -1]].tolist() == [0.0, float(full)]


def test_a_measured_response() -> None:
    table = ((0.0, 5.0), (100.0, 10.0), (255.0, 105.0))
    capture = plane(0.5, response_table=table)
    radiance = 5.0 + 0.5 * LEVEL * 100.0
    assert capture.images[0, 0, 0] == round(100.0 + (radiance - 10.0) * 155.0 / 95.0)
    assert capture.response is not None
    assert capture.response[100] == pytest.approx(255 * 0.05)


def test_noise_comes_before_the_response() -> None:
    dark, bright = (
        plane(i_d, gamma=2.2, bit_depth=16, read_noise_levels=300.0).images.astype(float).std() for i_d in (0.02, 0.9)
    )
    assert dark > 5 * bright, "a gamma stretches the noise of the dark"


def test_supersampling_is_the_area_of_the_pixel() -> None:
    """A ball that glows evenly seen from above: mean over its pixels = area of its disc."""
    scene = bgars.Scene.ball(600.0, x_um=3.0, y_um=-4.0, board=bgars.Board(material=bgars.Material.matte(0.0)))
    rig = bgars.LightRig.from_angles([[0, 90], [120, 90], [240, 90]])
    capture, _ = bgars.simulate(
        scene, rig, bgars.Material.matte(1.0), bgars.Camera(pixel_pitch_um=50.0, bit_depth=16, supersample=16)
    )
    # The integral of n_z over the disc is 2/3 pi R^2.
    total = capture.images[0].astype(float).sum() / 65535 * 50.0**2
    assert total == pytest.approx(2 / 3 * np.pi * 300.0**2, rel=2e-4)


def test_blur_spreads_light_and_loses_none() -> None:
    scene = bgars.Scene.ball(600.0, board=bgars.Board(material=bgars.Material.matte(0.0)))
    sharp, soft = (
        bgars.simulate(
            scene, RIG, bgars.Material.matte(1.0), bgars.Camera(bit_depth=16, shape=(120, 120), blur_px=blur_px)
        )[0]
        .images[0]
        .astype(float)
        for blur_px in (0.0, 2.0)
    )
    assert soft.sum() == pytest.approx(sharp.sum(), rel=1e-4)
    assert np.abs(np.diff(soft)).max() < 0.4 * np.abs(np.diff(sharp)).max()
    # Second moments of a Gaussian add.
    col = np.arange(120)
    moments = [np.cov(col, aweights=image.sum(axis=0)) for image in (sharp, soft)]
    assert moments[1] - moments[0] == pytest.approx(4.0, rel=0.02)


def test_blur_sees_beyond_the_image() -> None:
    scene = bgars.Scene.hemisphere(2000.0)
    small = bgars.Camera(pixel_pitch_um=20.0, shape=(40, 40), blur_px=3.0, supersample=2)
    large = bgars.Camera(pixel_pitch_um=20.0, shape=(80, 80), blur_px=3.0, supersample=2)
    inner, outer = (bgars.simulate(scene, RIG, bgars.Material(), camera)[0].images for camera in (small, large))
    np.testing.assert_array_equal(inner, outer[:, 20:60, 20:60])


def test_a_camera_without_a_shape_frames_the_scene() -> None:
    capture, truth = bgars.simulate(bgars.Scene.ball_array(2, 5), RIG, bgars.Material(), bgars.Camera())
    rows, cols = capture.images.shape[1:]
    assert cols > 2 * rows
    edge = np.concatenate([truth.ball_ids[[0, -1]].ravel(), truth.ball_ids[:, [0, -1]].ravel()])
    assert (edge == 0).all()
    assert truth.setup.camera.shape == (rows, cols)
