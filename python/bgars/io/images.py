"""Image files to arrays: decoded in parallel by the Rust core; imageio reads the formats it lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import imageio.v3 as iio
import numpy as np

from bgars import _bgars
from bgars.errors import FileFormatError, InputError, UnsupportedImageError
from bgars.large_arrays import any_content
from bgars.records import integer_full_scale

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.io.recipe import ChannelName
    from bgars.records import BoolArray, FloatArray, PixelArray

__all__ = ["MAX_MEGAPIXELS", "DecodedStack", "decode_stack", "read_mask"]

MAX_MEGAPIXELS = 256.0
"""Largest image a header may claim, in megapixels, unless the caller allows more."""

WEIGHTS: dict[str, tuple[float, float, float]] = {
    "luminance": (0.2126, 0.7152, 0.0722),
    "mean": (1 / 3, 1 / 3, 1 / 3),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
}
COLOR_CHANNELS = (3, 4)
MAX_INTEGER_BITS = 16


class DecodedStack(NamedTuple):
    """Images as they are stored, and what was done to them.

    Attributes
    ----------
    images : (L, H, W) uint8, uint16 or float32
        One image a file.
    linear : bool
        True when response and gains are in the values already (colour files).
    full_scale : float or None
        Largest grey level of the files (255 or 65535); None for float files.
    """

    images: PixelArray
    linear: bool
    full_scale: float | None


def decode_stack(
    paths: Sequence[Path],
    *,
    channel: ChannelName = "luminance",
    response: FloatArray | None = None,
    gains: FloatArray | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
    threads: int | None = None,
) -> DecodedStack:
    """Decode image files of equal size and depth.

    Parameters
    ----------
    paths : sequence of Path
        PNG, TIFF (8 and 16 bit, float), JPEG, BMP, PNM, or whatever imageio reads.
    channel : str
        How red, green and blue become one value: luminance (Rec. 709 on the stored values, no hidden gamma), mean, red,
        green, blue.
    response : (256,) or (65536,) float32, optional
        Inverse response, applied to each channel of colour files before they are combined.
    gains : (L, 3) float32, optional
        Factor of each channel of each image, applied to colour files.
    max_megapixels : float
        A header that claims more is refused before anything is allocated.
    threads : int, optional
        Most threads to decode on.

    Raises
    ------
    FileFormatError
        Missing, truncated, oversized or mismatched files, each named.
    """
    try:
        images, linear, bits = _bgars.decode_stack(
            list(paths),
            channel=channel,
            response=response,
            gains=gains,
            max_megapixels=max_megapixels,
            threads=threads,
            allocate=any_content,
        )
    except UnsupportedImageError:
        return _decode_with_imageio(paths, channel, response, gains, max_megapixels)
    return DecodedStack(images, linear, None if bits > MAX_INTEGER_BITS else 2.0**bits - 1.0)


def read_mask(path: Path, shape: tuple[int, int]) -> BoolArray:
    """Read a mask image, white = use.

    Raises
    ------
    FileFormatError
        The file is not an image.
    InputError
        It has another size than the images, or selects no pixel.
    """
    mask = decode_stack([path], channel="mean").images[0]
    if mask.shape != shape:
        msg = (
            f"{path}: the mask is {mask.shape[1]} x {mask.shape[0]} pixels, but the images are {shape[1]} x {shape[0]}"
        )
        raise InputError(msg)
    white = integer_full_scale(mask) or max(float(mask.max()), 1.0)
    use: BoolArray = mask > white / 2
    if not use.any():
        msg = f"{path}: the mask is empty: no pixel is brighter than half of white ({white:g})"
        raise InputError(msg)
    return use


def _decode_with_imageio(
    paths: Sequence[Path],
    channel: ChannelName,
    response: FloatArray | None,
    gains: FloatArray | None,
    max_megapixels: float,
) -> DecodedStack:
    stack: PixelArray | None = None
    first_shape: tuple[int, ...] = ()
    linear = False
    full_scale = None
    for index, path in enumerate(paths):
        image = _read_one(path, max_megapixels)
        described = (*image.shape[:2], image.dtype.name, image.ndim)
        if stack is None:
            first_shape = described
            full_scale = integer_full_scale(image)
        elif described != first_shape:
            msg = (
                f"{path}: is {described[1]} x {described[0]} pixels of {described[2]}, but the first image of "
                f"the stack "
                f"({paths[0]}) is {first_shape[1]} x {first_shape[0]} of {first_shape[2]}; all must be alike"
            )
            raise FileFormatError(msg)
        if image.ndim > 2:  # noqa: PLR2004 - colour
            linear = response is not None or gains is not None
            image = _combine(image, channel, response, None if gains is None else gains[index])
        if stack is None:
            stack = np.zeros((len(paths), *image.shape), dtype=image.dtype)
        stack[index] = image
    if stack is None:
        msg = "images: at least one file is needed, got none"
        raise InputError(msg)
    return DecodedStack(stack, linear, full_scale)


def _read_one(path: Path, max_megapixels: float) -> PixelArray:
    try:
        # From memory: some plug-ins leave a file open when they fail.
        content, suffix = path.read_bytes(), path.suffix
        if not content:
            msg = f"{path}: is empty (0 bytes), not an image"
            raise FileFormatError(msg)
        _check_shape(path, iio.improps(content, extension=suffix).shape, max_megapixels)
        image = np.asarray(iio.imread(content, extension=suffix))
    except FileFormatError:
        raise
    # The plug-ins of imageio raise whatever their libraries raise; here all of it means one thing.
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        msg = f"{path}: cannot be decoded as an image ({type(error).__name__}: {reason})"
        raise FileFormatError(msg) from error
    _check_shape(path, image.shape, max_megapixels)
    if image.dtype == np.float64:
        image = image.astype(np.float32)
    if image.dtype not in (np.uint8, np.uint16, np.float32):
        msg = f"{path}: pixels of type {image.dtype} are not supported; use uint8, uint16 or float32"
        raise FileFormatError(msg)
    return image


def _check_shape(path: Path, shape: tuple[int, ...], max_megapixels: float) -> None:
    grey = len(shape) == 2  # noqa: PLR2004 - rows, columns
    color = len(shape) == 3 and shape[2] in COLOR_CHANNELS  # noqa: PLR2004 - rows, columns, channels
    if not (grey or color):
        msg = f"{path}: must hold one grey or RGB image, but its shape is {shape}"
        raise FileFormatError(msg)
    megapixels = shape[0] * shape[1] / 1e6
    if megapixels > max_megapixels:
        msg = (
            f"{path}: the header claims {shape[1]} x {shape[0]} pixels = {megapixels:.0f} megapixels, "
            f"more than the limit of {max_megapixels:g} (max_megapixels)"
        )
        raise FileFormatError(msg)


def _combine(
    image: PixelArray, channel: ChannelName, response: FloatArray | None, gains: FloatArray | None
) -> PixelArray:
    """One value a pixel from red, green and blue; the same arithmetic as the core's decoder."""
    weights = np.array(WEIGHTS[channel], dtype=np.float32)
    if gains is not None:
        weights = weights * gains
    rgb = image[..., :3]
    values = rgb.astype(np.float32) if response is None or rgb.dtype.kind != "u" else response[rgb]
    combined: FloatArray = values @ weights
    if response is not None or gains is not None or image.dtype.kind == "f":
        return combined
    rounded = np.rint(combined)
    return rounded.astype(np.uint8) if image.dtype == np.uint8 else rounded.astype(np.uint16)
