"""Images as people hold them in arrays, as the kernels read them: one value per pixel, uint8, uint16 or float32."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.records.plain_arrays import plain, without_mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bgars.records.pixels import PixelArray

__all__ = ["LUMINANCE", "grey_pixels", "one_value"]

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue: Recommendation ITU-R BT.709, on linear values."""
COLOUR_NDIM, COLOUR_CHANNELS = 4, (3, 4)


def grey_pixels(name: str, pixels: ArrayLike) -> PixelArray:
    """Return pixels as the kernels read them, copied only where they are not so.

    Floats of other sizes become float32, whole numbers of other types uint8 where none is above 255, else uint16; of
    (L, H, W, 3) the luminance is taken, of (L, H, W, 4) without the fourth channel. What a numpy
    masked array hides is 0.

    Raises
    ------
    InputError
        Other types, or whole numbers below 0 or above 65535.
    """
    array = plain(name, without_mask(pixels, 0))
    if array.dtype.kind == "f":
        array = array.astype(np.float32, copy=False)
    elif array.dtype.kind in "iu" and array.dtype not in (np.uint8, np.uint16):
        array = _of_few_bits(name, array)
    if array.dtype not in (np.uint8, np.uint16, np.float32):
        msg = f"{name}: must be uint8, uint16 or float32, got {array.dtype}"
        raise InputError(msg)
    if array.ndim == COLOUR_NDIM and array.shape[-1] in COLOUR_CHANNELS:
        grey = np.zeros(array.shape[:-1], array.dtype)
        for image, rgb in zip(grey, array, strict=True):
            image[...] = one_value(rgb[..., :3].astype(np.float32), np.array(LUMINANCE, np.float32), array.dtype)
        return grey
    return array


def one_value(rgb: NDArray[np.float32], weights: NDArray[np.float32], dtype: np.dtype[Any]) -> PixelArray:
    """Weighted sums of red, green and blue, (..., 3), rounded where they are whole numbers; as the core's decoder."""
    values: NDArray[np.float32] = rgb @ weights
    if dtype.kind == "f":
        return values
    rounded: PixelArray = np.rint(values).astype(dtype)
    return rounded


def _of_few_bits(name: str, array: NDArray[Any]) -> PixelArray:
    low, high = (int(array.min()), int(array.max())) if array.size else (0, 0)
    if low < 0 or high > np.iinfo(np.uint16).max:
        msg = (
            f"{name}: must be uint8, uint16 or float32, or whole numbers from 0 to {np.iinfo(np.uint16).max}, "
            f"got {array.dtype} from {low} to {high}"
        )
        raise InputError(msg)
    return array.astype(np.uint8) if high <= np.iinfo(np.uint8).max else array.astype(np.uint16)
