"""Depths below 16 bits inside 16-bit files."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.records.bit_depth import find_bit_depth, plateau_bits


def scene(seed: int, top: float, *, images: int = 4) -> np.ndarray:
    """Grey levels of a matt part with a few highlights, `top` the brightest of them, unclipped."""
    random = np.random.default_rng(seed)
    matt = top * random.beta(2.0, 6.0, (images, 48, 64))
    rows, cols = np.mgrid[:48, :64]
    for index in range(images):
        row, col = random.uniform(10, 38), random.uniform(10, 54)
        matt[index] += top * np.exp(-((rows - row) ** 2 + (cols - col) ** 2) / 18.0)
    return matt + random.normal(0.0, 0.002 * top, matt.shape)


def as_camera(values: np.ndarray, bits: int) -> np.ndarray:
    return np.clip(np.rint(values), 0, 2**bits - 1).astype(np.uint16)


@pytest.mark.parametrize("bits", [8, 10, 11, 12, 14])
@pytest.mark.parametrize("seed", range(3))
def test_a_clipped_camera_shows_its_depth(bits: int, seed: int) -> None:
    images = as_camera(scene(seed, 1.2 * 2**bits), bits)
    assert plateau_bits(images) == bits
    depth = find_bit_depth(images)
    assert depth is not None
    assert depth.saturation == 2**bits - 1
    assert depth.clipped == (images == 2**bits - 1).sum()
    assert str(2**bits - 1) in depth.reason


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("clips", [True, False])
def test_bits_at_the_top_of_the_file_are_recognised(bits: int, clips: bool) -> None:
    images = as_camera(scene(1, (1.2 if clips else 0.6) * 2**bits), bits) << (16 - bits)
    depth = find_bit_depth(images)
    assert depth is not None
    assert (depth.bits, depth.shift, depth.saturation) == (bits, 16 - bits, (2**bits - 1) << (16 - bits))
    assert (depth.clipped > 0) == clips
    assert plateau_bits(images) is None, "2^n - 1 is not its saturation level"


@pytest.mark.parametrize("top", [0.3 * 4096, 0.9 * 4096, 3.0 * 4096, 0.7 * 65536, 2.0 * 65536])
@pytest.mark.parametrize("seed", range(20))
def test_other_images_have_all_their_bits(top: float, seed: int) -> None:
    assert find_bit_depth(as_camera(scene(seed, top), 16)) is None


@pytest.mark.parametrize("seed", range(20))
def test_a_brightest_pixel_that_happens_to_have_such_a_level_is_no_plateau(seed: int) -> None:
    images = scene(seed, 3500.0)
    assert plateau_bits(as_camera(images * (4095.0 / images.max()), 16)) is None


def test_a_dense_tail_up_to_the_level_is_no_plateau() -> None:
    ramp = np.random.default_rng(0).integers(0, 4096, (4, 64, 64)).astype(np.uint16)
    assert (ramp == 4095).any()
    assert plateau_bits(ramp) is None


def test_few_levels_and_other_types_tell_nothing() -> None:
    assert find_bit_depth(np.full((3, 4, 4), 1000, np.uint16)) is None
    assert find_bit_depth(np.zeros((3, 4, 4), np.uint16)) is None
    assert find_bit_depth(np.zeros((0, 4, 4), np.uint16)) is None
    assert find_bit_depth(np.full((3, 40, 40), 255, np.uint8)) is None
    assert find_bit_depth(np.full((3, 40, 40), 4095, np.float32)) is None
    eight = (np.arange(256, dtype=np.uint16) * 257).reshape(1, 16, 16)
    assert find_bit_depth(eight) is None, "8 bits that fill 16 by repeating"


def test_the_layout_does_not_matter() -> None:
    images = as_camera(scene(0, 5000.0), 12)
    assert plateau_bits(np.asfortranarray(images)) == 12
    assert plateau_bits(images[:, ::-1, ::2]) == 12
    assert plateau_bits(images[0] | np.uint16(0)) in (12, None)
