"""Grey levels of a capture as calibration reads them: linear, of 255, without the dark level, with noise and clip."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bgars.errors import InputError
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["Levels", "linear_levels", "noise_of"]

Array = NDArray[np.float64]

QUANTISED = 0.29
"""Standard deviation of rounding, of a step."""
DITHERED = 0.4
"""Noise, of a step of grey levels, that makes means of levels true to less than a step."""
SAMPLE = 500_000
"""Pixels that the noise is taken from, about."""


class Levels(NamedTuple):
    """Linear grey levels, 255 = full scale."""

    images: Array
    clip: float
    noise: float
    rounding: float = 0.0
    """Step of the grey levels where noise does not blur it; 0 where it does."""


def linear_levels(capture: Capture) -> Levels:
    """Return the images (L, H, W) of a capture, the level that counts as clipped, and the noise of a pixel.

    Raises
    ------
    InputError
        Images without any light.
    """
    need_whole(capture)
    full = capture.full_scale if math.isfinite(capture.full_scale) else float(capture.images.max())
    if not full > 0:
        msg = f"{capture.name}: all pixels are 0"
        raise InputError(msg)
    table = capture.response

    def linear(values: NDArray[np.generic]) -> Array:
        levels: Array = (values if table is None else table[values.astype(np.intp)]).astype(np.float64)
        return levels

    images = linear(capture.images)
    if math.isinf(capture.saturation):
        clip = float(images.max()) if capture.images.dtype.kind == "u" else math.inf
        clip = min(clip, full) if capture.images.dtype.kind != "u" else full
    else:
        clip = float(linear(np.array([min(capture.saturation, full)]))[0])
    if capture.dark is not None:
        dark: Array | float = linear(capture.dark)
    else:
        dark = float(linear(np.array([round(capture.black_level)]))[0]) if capture.black_level else 0.0
    clipped = images >= clip
    images -= dark
    images *= 255.0 / full
    top = (clip - float(np.max(dark))) * 255.0 / full
    images[clipped] = np.maximum(images[clipped], top)
    step = 255.0 / full if capture.images.dtype.kind == "u" else 0.0
    noise = noise_of(images)
    return Levels(images, top, max(noise, QUANTISED * step, 1e-3), step if noise < DITHERED * step else 0.0)


def noise_of(images: Array) -> float:
    """Noise of a pixel: robust scatter of what a quadratic surface leaves (Immerkaer 1996, with a median)."""
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]]) / 6.0
    step = max(1, math.ceil(math.sqrt(images.size / SAMPLE)))
    found = []
    for image in images:
        side = max(16, int(math.sqrt(image.size)) // step)
        row, col = max(0, (image.shape[0] - side) // 2), max(0, (image.shape[1] - side) // 2)
        part = image[row : row + side, col : col + side]
        rough = np.abs(ndimage.convolve(part, kernel))
        found.append(1.4826 * float(np.median(rough)))
    return float(np.median(found))
