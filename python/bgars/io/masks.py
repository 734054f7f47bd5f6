"""Masks: white = use, or opaque = use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import tifffile

from bgars.errors import FileFormatError, InputError
from bgars.io.decoders.tiff import quiet
from bgars.io.image_formats import format_of, read_pixels
from bgars.io.image_stacks import read_stack
from bgars.io.image_tags import read_tags, upright
from bgars.io.images import MAX_MEGAPIXELS, decode_stack
from bgars.records.plain_arrays import integer_full_scale

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.pixels import BoolArray

__all__ = ["opaque_everywhere", "read_mask"]

WITH_ALPHA = (2, 4)


def read_mask(path: Path, shape: tuple[int, int], notes: list[str] | None = None) -> BoolArray:
    """Read a mask image: white = use, and where the file has an opacity that varies, opaque = use.

    A boolean array that tifffile wrote counts as an array: True = use. `notes` gets what is assumed.

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
    bits = _bits(path, [] if notes is None else notes) if tags.white_bits else None
    grey = decode_stack([path], channel="mean").images[0] if bits is None else bits
    grey = upright(grey, tags.orientation)
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


def _bits(path: Path, notes: list[str]) -> NDArray[Any] | None:
    """Bits of a boolean array as white where they are set; None for any other file whose bits of 0 mean white.

    tifffile writes True as 1 into a file that says that 1 is black (TIFF 6.0, section 3), and reads it as True again:
    whoever writes an array means the array. Other programs mean the picture.
    """
    with quiet(), tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        is_array = page.is_shaped or page.software.startswith("tifffile")
    if not is_array:
        notes.append(f"{path.name}: its bits of 0 are used, since 0 is white in this TIFF")
        return None
    notes.append(
        f"{path.name}: its bits of 1 are used, as True of the array that tifffile wrote (viewers show it inverted)"
    )
    shown: NDArray[Any] = read_pixels(path, MAX_MEGAPIXELS)
    return ~shown


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
    kind = format_of(path)
    count = read_tags(path, kind).pages
    one = count == 1
    pages = read_pixels(path, MAX_MEGAPIXELS, kind)[None] if one else read_stack(path, kind, count, MAX_MEGAPIXELS)
    if pages.ndim != 4 or pages.shape[3] not in WITH_ALPHA:  # noqa: PLR2004 - pages, rows, columns, channels
        return None
    alpha: NDArray[Any] = pages[..., -1].min(axis=0)
    low, high = alpha.min(), alpha.max()
    if low == high:
        return None
    full = integer_full_scale(alpha) or 1.0
    opaque: BoolArray = np.asarray(upright(alpha, orientation) > full / 2)
    return opaque
