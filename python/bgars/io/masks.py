"""Masks: white = use, or opaque = use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.io.image_formats import format_of, read_pixels
from bgars.io.image_tags import read_tags, upright
from bgars.io.images import MAX_MEGAPIXELS, decode_stack
from bgars.records.plain_arrays import integer_full_scale

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.pixels import BoolArray, PixelArray

__all__ = ["opaque_everywhere", "read_mask", "refuse_nan"]

WITH_ALPHA = (2, 4)


def read_mask(path: Path, shape: tuple[int, int]) -> BoolArray:
    """Read a mask image: white = use, and where the file has an opacity that varies, opaque = use.

    Raises
    ------
    FileFormatError
        The file is not an image, or holds several.
    InputError
        It has another size than the images, or selects no pixel.
    """
    tags = read_tags(path, format_of(path))
    if tags.pages > 1:
        msg = f"{path}: holds {tags.pages} images; a mask is one"
        raise FileFormatError(msg)
    grey = upright(decode_stack([path], channel="mean").images[0], tags.orientation)
    if grey.shape != shape:
        msg = (
            f"{path}: the mask is {grey.shape[1]} x {grey.shape[0]} pixels, but the images are {shape[1]} x {shape[0]}"
        )
        raise InputError(msg)
    opaque = _opaque(path, tags.orientation) if tags.alpha else None
    white = integer_full_scale(grey) or max(float(np.nanmax(grey, initial=0.0)), 1.0)
    use: BoolArray = np.asarray(grey > white / 2)
    if opaque is not None:
        shape_is_in_alpha = bool((grey == grey[0, 0]).all())
        use = opaque if shape_is_in_alpha else use & opaque
    if not use.any():
        top = float(np.nanmax(grey, initial=0.0))
        msg = f"{path}: the mask is empty: no pixel is brighter than half of white ({white:g})"
        if 0.0 < top < white / 2:
            msg += f"; its largest value is {top:g}: multiply the mask so that what to use has {white:g}"
        raise InputError(msg)
    return use


def opaque_everywhere(paths: Sequence[Path], orientation: int) -> BoolArray | None:
    """Return the pixels that no image of some files declares transparent; None where all are opaque."""
    use: BoolArray | None = None
    for path in paths:
        opaque = _opaque(path, orientation)
        if opaque is not None:
            use = opaque if use is None or use.shape != opaque.shape else use & opaque
    return use


def _opaque(path: Path, orientation: int) -> BoolArray | None:
    """True where the opacity of an image is above one half; None where it does not vary."""
    pixels: NDArray[Any] = read_pixels(path, MAX_MEGAPIXELS)
    if pixels.ndim != 3 or pixels.shape[2] not in WITH_ALPHA:  # noqa: PLR2004 - rows, columns, channels
        return None
    alpha = pixels[..., -1]
    low, high = alpha.min(), alpha.max()
    if low == high:
        return None
    full = integer_full_scale(alpha) or 1.0
    opaque: BoolArray = np.asarray(upright(alpha, orientation) > full / 2)
    return opaque


def refuse_nan(images: PixelArray, mask: BoolArray, paths: list[Path]) -> None:
    """Raise InputError where a pixel inside the mask is not finite."""
    if images.dtype.kind != "f":
        return
    for image, path in zip(images, paths, strict=True):
        bad = ~np.isfinite(image) & mask
        if bad.any():
            row, col = np.argwhere(bad)[0]
            msg = (
                f"{path}: {int(bad.sum())} pixels inside the mask are not finite (first at row {row}, column {col}); "
                "mask them out"
            )
            raise InputError(msg)
