"""TIFF by tifffile: float pixels, and the pages of a stack."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size
from bgars.io.decoders.tiff_photometric import by_pillow, light_of, needs_pillow

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["page_pixels", "quiet", "read_tiff", "read_tiff_pages"]

PLANAR_SEPARATE = 2


def read_tiff(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return the pixels of the only full page."""
    pixels: PixelArray = read_tiff_pages(path, 1, max_megapixels)[0]
    return pixels


@contextmanager
def quiet() -> Iterator[None]:
    """Keep tifffile from logging what it finds damaged: one message names the file."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def page_pixels(path: Path, page: Any, index: int, workers: int | None = None) -> NDArray[Any]:  # noqa: ANN401 - or frame
    """Return the grey (H, W) or colour (H, W, channels) values of a page, more is brighter.

    Raises
    ------
    FileFormatError
        They mean something else.
    """
    if needs_pillow(page):
        return by_pillow(path, index)
    pixels = np.asarray(page.asarray(maxworkers=workers))
    if pixels.ndim == 3 and getattr(page, "planarconfig", 1) == PLANAR_SEPARATE:  # noqa: PLR2004 - colour
        pixels = np.moveaxis(pixels, 0, -1)
    return light_of(path, page, index, pixels)


def read_tiff_pages(path: Path, count: int, max_megapixels: float) -> NDArray[Any]:
    """Return (count, H, W) or (count, H, W, channels) pixels of the full pages of a file.

    Raises
    ------
    FileFormatError
        Another number of pages, or pages that differ.
    """
    import tifffile  # noqa: PLC0415 - most captures never need it

    with quiet(), tifffile.TiffFile(path) as file:
        pages: list[Any] = [
            (place, page) for place, page in enumerate(file.pages) if not getattr(page, "is_reduced", False)
        ]
        if len(pages) != count:
            msg = f"{path}: holds {len(pages)} images, but {count} are expected"
            raise FileFormatError(msg)
        stack: list[NDArray[Any]] = []
        for place, page in pages:
            check_size(path, page.imagelength, page.imagewidth, max_megapixels)
            pixels = page_pixels(path, page, place)
            if pixels.shape[:2] != (page.imagelength, page.imagewidth):
                msg = f"{path}: must hold one grey or RGB image per page, but its shape is {pixels.shape}"
                raise FileFormatError(msg)
            if pixels.dtype == np.bool_:
                pixels = pixels.astype(np.uint8) * np.uint8(255)
            if stack and (pixels.shape, pixels.dtype) != (stack[0].shape, stack[0].dtype):
                msg = f"{path}: page {len(stack)} is {pixels.shape} {pixels.dtype}, but page 0 {stack[0].shape}"
                raise FileFormatError(msg)
            stack.append(pixels)
    return np.stack(stack)
