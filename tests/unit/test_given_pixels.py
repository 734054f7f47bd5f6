"""Images as arrays of any common kind give the normals of the same images as the kernels read them."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from numpy.typing import ArrayLike, DTypeLike, NDArray

RIG = bgars.LightRig.ring(6)
LEVELS = np.random.default_rng(0).integers(20, 250, (6, 5, 7)).astype(np.uint8)


def normals(images: ArrayLike) -> NDArray[np.float32]:
    return bgars.estimate_normals(images, RIG.directions, method="lambertian").normals


@pytest.mark.parametrize("dtype", [np.int64, np.int32, np.uint32, np.int16, ">u2", np.float16, np.float64])
def test_types(dtype: DTypeLike) -> None:
    np.testing.assert_allclose(normals(LEVELS.astype(dtype)), normals(LEVELS), atol=1e-6)
    assert bgars.Capture(LEVELS.astype(np.int64), RIG, np.ones((5, 7), bool)).images.dtype == np.uint8
    wide = 200 * LEVELS.astype(np.int64)
    capture = bgars.Capture(wide, RIG, np.ones((5, 7), bool), dark=np.ones((5, 7), np.int64))
    assert (capture.images.dtype, capture.dark.dtype) == (np.uint16, np.uint16)
    np.testing.assert_array_equal(capture.images, wide)


def test_lists() -> None:
    np.testing.assert_array_equal(normals(LEVELS.tolist()), normals(LEVELS))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.int64])
@pytest.mark.parametrize("channels", [3, 4])
def test_colour_is_taken_as_its_luminance(dtype: DTypeLike, channels: int) -> None:
    rgb = np.random.default_rng(1).integers(20, 250, (6, 5, 7, channels)).astype(dtype)
    grey = rgb[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(normals(rgb), normals(grey.astype(np.float32)), atol=0.02)
    dark = np.full((5, 7, channels), 3, dtype)
    capture = bgars.Capture(rgb, RIG, np.ones((5, 7), bool), dark=dark)
    assert capture.images.shape == (6, 5, 7)
    np.testing.assert_allclose(capture.images, grey, atol=0.5 if capture.images.dtype.kind == "u" else 1e-4)
    assert capture.dark is not None
    np.testing.assert_array_equal(np.rint(capture.dark), np.full((5, 7), 3))
    assert capture.dark.dtype == capture.images.dtype


def test_colour_with_a_response_is_refused() -> None:
    rgb = np.repeat(LEVELS[..., None], 3, axis=3)
    with pytest.raises(bgars.InputError, match="images: must have one value per pixel with a response"):
        bgars.Capture(rgb, RIG, np.ones((5, 7), bool), response=np.arange(256.0) ** 2)


def test_what_is_hidden_in_one_channel_is_not_used() -> None:
    rgb = np.ma.array(np.repeat(LEVELS[..., None], 3, axis=3))
    rgb[2, 1, 4, 0] = np.ma.masked
    assert np.argwhere(np.isnan(normals(rgb)[..., 2])).tolist() == [[1, 4]]


def test_a_dark_frame_that_does_not_fit_is_told_not_cut() -> None:
    capture = bgars.Capture(LEVELS, RIG, np.ones((5, 7), bool), dark=np.full((5, 7), 300, np.int64))
    with pytest.raises(bgars.InputError, match="dark: must have the dtype of the images, uint8, got uint16"):
        bgars.estimate_normals(capture)


@pytest.mark.parametrize(
    ("images", "saturation", "full_scale"),
    [
        (LEVELS, 255.0, 255.0),
        (257 * LEVELS.astype(np.uint16), 65535.0, 65535.0),
        (LEVELS.astype(np.float32) / 255.0, np.inf, float(LEVELS.max() / np.float32(255.0))),
    ],
)
def test_a_capture_made_by_hand_has_the_scale_of_its_pixels(
    images: NDArray[np.generic], saturation: float, full_scale: float
) -> None:
    capture = bgars.Capture(images, RIG, np.ones((5, 7), bool))
    assert (capture.saturation, capture.full_scale) == (saturation, pytest.approx(full_scale))
    told = bgars.Capture(images, RIG, np.ones((5, 7), bool), saturation=200.0)
    assert told.saturation == 200.0
    assert told.full_scale == (200.0 if images.dtype.kind == "f" else full_scale)


@pytest.mark.parametrize("method", ["robust-filter", "specular-filter", "reflectance"])
@pytest.mark.parametrize("scale", [np.uint16(257), np.float32(1 / 255)])
def test_normals_of_a_capture_made_by_hand_are_those_of_its_arrays(method: str, scale: np.generic) -> None:
    sample = bgars.read_capture(bgars.sample_capture())
    images = sample.images * scale
    by_hand = bgars.estimate_normals(bgars.Capture(images, sample.rig, sample.mask), method=method)
    plain = bgars.estimate_normals(images, sample.rig.directions, method=method)
    np.testing.assert_array_equal(by_hand.normals, plain.normals)
    eight_bits = bgars.estimate_normals(sample, method=method)
    # The largest of floats is not quite full scale: single pixels choose other lights.
    angles_deg = bgars.angular_error_deg(by_hand.normals, eight_bits.normals)
    assert np.nanmean(angles_deg) < 0.1
