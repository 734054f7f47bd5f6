"""Blurred and noisy images, where noise hides detail, and detail noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bgars import Capture, LightRig
from bgars.checks import focus
from bgars.checks.noise_levels import own_noise
from bgars.checks.patches import cut_patches
from bgars.records.plain_arrays import every_pixel
from scipy.ndimage import gaussian_filter

SIDE_PX = 240
NOISE = 2.5


def textured(blur_px: float, seed: int) -> Capture:
    """A flat textured surface; image 5 blurred before the camera adds its noise, which is most of the finer band."""
    random = np.random.default_rng(seed)
    texture = gaussian_filter(random.normal(size=(SIDE_PX, SIDE_PX)), 1.4)
    light = 110.0 + random.uniform(0.9, 1.1, 8)[:, None, None] * 6.0 * texture / texture.std()
    if blur_px:
        light[5] = gaussian_filter(light[5], blur_px)
    images = np.rint(light + random.normal(0.0, NOISE, light.shape)).astype(np.uint8)
    return Capture(images, LightRig.ring(8), every_pixel((SIDE_PX, SIDE_PX)), saturation=255.0)


def told(capture: Capture) -> list[tuple[int | None, float | None]]:
    found = focus.check_focus(capture, np.arange(8), [f"image {index}" for index in range(8)])
    return [(each.image, each.value) for each in found]


@pytest.mark.parametrize(("blur_px", "seed"), [(0.9, 1), (1.5, 2)])
def test_a_blur_is_told_though_noise_is_as_large_as_detail(blur_px: float, seed: int) -> None:
    capture = textured(blur_px, seed)
    levels = next(cut_patches(capture)).levels[0] * 255.0
    assert (levels - gaussian_filter(levels, 1.4)).var() < 2.0 * NOISE**2  # noise is half of it or more
    ((image, value),) = told(capture)
    # Of the noise what is certain is taken off; the rest looks sharp in every image.
    assert image == 5
    assert value is not None
    assert 0.7 * blur_px < value < 1.15 * blur_px


def test_noise_alone_makes_no_image_blurred() -> None:
    assert [told(textured(0.0, seed)) for seed in range(5)] == [[]] * 5


def test_noise_of_a_band_is_that_of_its_filters() -> None:
    random = np.random.default_rng(0)
    smooth = [random.normal(size=(1, 900, 900)).astype(np.float32)]
    for _ in range(6):
        smooth.append(focus._binomial(smooth[-1]))
    for low, high in ((1, 3), (2, 6)):
        cut = high - low
        band = smooth[low][:, cut:-cut, cut:-cut] - smooth[high]
        assert band.var() == pytest.approx(focus._noise_passed(low, high), rel=0.03)


def test_noise_of_an_image_is_its_own_whatever_moved_or_is_brighter() -> None:
    capture = textured(0.0, 3)
    images = np.minimum(capture.images, 125).astype(np.float64)
    images[1] = np.roll(images[1], (2, 3), axis=(0, 1))
    images[2] = gaussian_filter(images[2], 1.5)
    images[4] *= 2.0
    images[6] += np.random.default_rng(6).normal(0.0, 8.0, images[6].shape)
    changed = replace(capture, images=np.rint(images).astype(np.uint8))
    noise = own_noise(changed, np.arange(8)) / np.median(own_noise(changed, np.arange(8)))
    assert np.argmax(noise) == 6
    assert noise[6] == pytest.approx(np.hypot(8.0, NOISE) / NOISE, rel=0.2)
    assert np.delete(noise, [2, 6]) == pytest.approx(1.0, abs=0.1)
    assert noise[2] < 0.5
