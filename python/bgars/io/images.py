"""Image files to arrays: decoded in parallel by the Rust core; other decoders read the formats it lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars import _bgars
from bgars.errors import FileFormatError, InputError, UnsupportedImageError
from bgars.io.image_formats import format_of, read_pixels
from bgars.io.image_stacks import read_stack
from bgars.io.image_tags import read_tags
from bgars.records.given_pixels import LUMINANCE, one_value
from bgars.records.plain_arrays import integer_full_scale

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from bgars.io.recipe import ChannelName
    from bgars.records.pixels import FloatArray, PixelArray

__all__ = ["MAX_MEGAPIXELS", "DecodedStack", "decode_pages", "decode_stack"]

MAX_MEGAPIXELS = 256.0
"""Largest image a header may claim, in megapixels, unless the caller allows more."""

WEIGHTS: dict[str, tuple[float, float, float]] = {
    "luminance": LUMINANCE,
    "mean": (1 / 3, 1 / 3, 1 / 3),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
}
COLOR_CHANNELS = (3, 4)
GREY_CHANNELS = (1, 2)
FLOAT32_BYTES = 4
MAX_INTEGER_BITS = 16


class DecodedStack(NamedTuple):
    """Images as they are stored, and what was done to them.

    Attributes
    ----------
    images : (L, H, W) uint8, uint16 or float32
        One image per file.
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
        Images of any of :data:`~bgars.io.image_formats.IMAGE_FORMATS`, one per file.
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
        Largest number of threads.

    Raises
    ------
    FileFormatError
        Missing, truncated, oversized or mismatched files, each named.
    """
    if not all(_core_reads(path) for path in paths):
        return _decode_arrays(paths, channel, response, gains, max_megapixels)
    try:
        images, linear, bits = _bgars.decode_stack(
            list(paths),
            channel=channel,
            response=response,
            gains=gains,
            max_megapixels=max_megapixels,
            threads=threads,
            allocate=np.zeros,
        )
    except UnsupportedImageError:
        return _decode_arrays(paths, channel, response, gains, max_megapixels)
    except FileFormatError as error:  # some decoders end their reasons in a line feed
        raise FileFormatError("".join(str(error).splitlines())) from error
    return DecodedStack(images, linear, None if bits > MAX_INTEGER_BITS else 2.0**bits - 1.0)


def _core_reads(path: Path) -> bool:
    """Whether the compiled decoder reads the image of a file: of a TIFF it takes the first page."""
    kind = format_of(path)
    return kind.core and not (kind.stack and read_tags(path, kind).preview_first)


def decode_pages(
    path: Path,
    count: int,
    *,
    channel: ChannelName = "luminance",
    response: FloatArray | None = None,
    gains: FloatArray | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
) -> DecodedStack:
    """Decode a file that holds the images of all lights: a multi-page TIFF, or an array (L, H, W[, channels]).

    Raises
    ------
    FileFormatError
        The file does not hold `count` images.
    """
    kind = format_of(path)
    if not kind.stack:
        msg = f"{path}: is one {kind.name} image, but {count} lights need an image each"
        raise FileFormatError(msg)
    return _stack_of([path] * count, iter(read_stack(path, kind, count, max_megapixels)), channel, response, gains)


def _decode_arrays(
    paths: Sequence[Path],
    channel: ChannelName,
    response: FloatArray | None,
    gains: FloatArray | None,
    max_megapixels: float,
) -> DecodedStack:
    return _stack_of(paths, (read_pixels(path, max_megapixels) for path in paths), channel, response, gains)


def _stack_of(
    paths: Sequence[Path],
    images: Iterator[PixelArray],
    channel: ChannelName,
    response: FloatArray | None,
    gains: FloatArray | None,
) -> DecodedStack:
    """One value per pixel of images that must be alike."""
    stack: PixelArray | None = None
    first_shape: tuple[int | str, ...] = ()
    linear = False
    full_scale = None
    for index, (path, pixels) in enumerate(zip(paths, images, strict=True)):
        image = _supported(pixels, path)
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


def _supported(pixels: PixelArray, path: Path) -> PixelArray:
    """Return pixels (H, W) or (H, W, 3 or 4) of a type that the kernels know; grey with alpha loses the alpha."""
    image = pixels
    if image.ndim == 3 and image.shape[2] in GREY_CHANNELS:  # noqa: PLR2004 - rows, columns, channels
        image = image[..., 0]
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in COLOR_CHANNELS)):  # noqa: PLR2004 - as above
        msg = f"{path}: must hold one grey or RGB image, but its shape is {image.shape}"
        raise FileFormatError(msg)
    if image.dtype.kind == "f" and image.dtype.itemsize != FLOAT32_BYTES:
        image = image.astype(np.float32)
    if image.dtype.kind not in "uf" or image.dtype.newbyteorder("=") not in (np.uint8, np.uint16, np.float32):
        msg = f"{path}: pixels of type {image.dtype} are not supported; use uint8, uint16 or float32"
        raise FileFormatError(msg)
    native: PixelArray = np.ascontiguousarray(image, dtype=image.dtype.newbyteorder("="))  # type: ignore[assignment]
    return native


def _combine(
    image: PixelArray, channel: ChannelName, response: FloatArray | None, gains: FloatArray | None
) -> PixelArray:
    """One value per pixel from red, green and blue; the same arithmetic as the core's decoder."""
    weights = np.array(WEIGHTS[channel], dtype=np.float32)
    if gains is not None:
        weights = weights * gains
    rgb = image[..., :3]
    values = rgb.astype(np.float32) if response is None or rgb.dtype.kind != "u" else response[rgb]
    is_linear = response is not None or gains is not None
    return one_value(values, weights, np.dtype(np.float32) if is_linear else image.dtype)
