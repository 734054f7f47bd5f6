"""What the numbers of a TIFF page mean: grey, red green blue, or what has to be turned into one of them.

TIFF 6.0, sections 4 to 8, 16 and 21. tifffile returns them as they are stored.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["by_pillow", "is_palette", "light_of", "needs_pillow"]

PHOTOMETRIC, INK_SET = 262, 332
WHITE_IS_ZERO, BLACK_IS_ZERO, RGB, PALETTE, SEPARATED, YCBCR, LINEAR_RAW = 0, 1, 2, 3, 5, 6, 34892
AS_STORED = (BLACK_IS_ZERO, RGB, LINEAR_RAW)
CMYK_INKS = 1
JPEG = 7
CMYK, NDIM = 4, 3
MAX_BITS = 16
BYTE = 8
READ = "grey, RGB, palette, CMYK and YCbCr are"


def is_palette(page: Any) -> bool:  # noqa: ANN401 - tifffile has pages and frames
    """Whether the numbers of a page are places in a table of colours, which has three channels."""
    return _kind_of(page) == PALETTE


def needs_pillow(page: Any) -> bool:  # noqa: ANN401 - as above
    """Whether tifffile alone cannot read a page: luma and two differences of colour (section 21), or JPEG."""
    is_jpeg = page.keyframe.compression == JPEG and _kind_of(page) in (BLACK_IS_ZERO, RGB)
    return _kind_of(page) == YCBCR or is_jpeg


def light_of(path: Path, page: Any, index: int, pixels: NDArray[Any]) -> NDArray[Any]:  # noqa: ANN401 - as above
    """Return grey (H, W) or colour (H, W, channels) where more is brighter, of the stored `pixels` of page `index`.

    Raises
    ------
    FileFormatError
        They mean something else, named.
    """
    kind = _kind_of(page)
    if kind is None or kind in AS_STORED:
        return pixels
    is_code = pixels.dtype.kind in "bu" and page.keyframe.bitspersample <= MAX_BITS
    if kind == WHITE_IS_ZERO and pixels.dtype == np.bool_:
        return ~pixels
    if kind == WHITE_IS_ZERO and is_code:
        return np.asarray(pixels.dtype.type(2**page.keyframe.bitspersample - 1) - pixels)
    if kind == PALETTE and is_code and pixels.ndim == NDIM - 1:
        return _of_palette(page.keyframe.colormap, pixels)
    if kind == SEPARATED and is_code and _is_cmyk(page, pixels):
        return _of_inks(pixels, 2**page.keyframe.bitspersample - 1)
    where = f"page {index} " if index else ""
    name = getattr(kind, "name", kind)
    msg = (
        f"{path}: {where}holds {pixels.dtype} in {_channels(pixels)} of {name} (PhotometricInterpretation), "
        f"which is not read; {READ}"
    )
    raise FileFormatError(msg)


def _kind_of(page: Any) -> int | None:  # noqa: ANN401 - as above
    """The tag of a page; None without one, which tifffile does not tell from 0 (white)."""
    return page.keyframe.photometric if PHOTOMETRIC in page.keyframe.tags else None


def _channels(pixels: NDArray[Any]) -> str:
    count = pixels.shape[2] if pixels.ndim == NDIM else 1
    return f"{count} channel{'s'[: count - 1]}"


def _is_cmyk(page: Any, pixels: NDArray[Any]) -> bool:  # noqa: ANN401 - as above
    inks = page.keyframe.tags.get(INK_SET)
    return pixels.ndim == NDIM and pixels.shape[2] >= CMYK and (inks is None or int(inks.value) == CMYK_INKS)


def _of_palette(table: NDArray[np.uint16], places: NDArray[Any]) -> NDArray[Any]:
    """Colours of a table (3, 2^bits) of 16 bits, to which most programs widen 8 bits, times 256 or 257."""
    low, high = table & 0xFF, table >> BYTE
    if not high.any():  # a few programs forget to
        table = table.astype(np.uint8)
    elif not low.any() or (low == high).all():
        table = high.astype(np.uint8)
    return np.ascontiguousarray(np.moveaxis(table[:, places.astype(np.intp)], 0, -1))


def _of_inks(pixels: NDArray[Any], full: int) -> NDArray[Any]:
    """Red, green and blue that cyan, magenta, yellow and black leave: each takes its share (as Pillow, libtiff)."""
    left = np.uint32(full) - pixels[..., :CMYK].astype(np.uint32)  # 65535^2 fits
    colors = (left[..., :3] * left[..., 3:] + np.uint32(full // 2)) // np.uint32(full)
    return np.asarray(colors.astype(pixels.dtype))


def by_pillow(path: Path, index: int) -> NDArray[np.uint8]:
    """Return grey, or red, green and blue, of a page that :func:`needs_pillow`."""
    from PIL import Image  # noqa: PLC0415 - most captures never need it

    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own limit of size: the caller has one
        image: Image.Image = Image.open(file, formats=("TIFF",))
        image.seek(index)
        return np.asarray(image.convert("RGB") if image.mode == "YCbCr" else image)
