"""One file with the images of all lights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat

__all__ = ["read_stack"]

CHANNELS = (3, 4)


def read_stack(path: Path, kind: ImageFormat, count: int, max_megapixels: float) -> NDArray[Any]:
    """Return (count, H, W) or (count, H, W, channels) pixels of a TIFF with as many pages, or of an array.

    Raises
    ------
    FileFormatError
        The file holds another number of images, or cannot be read.
    """
    try:
        if kind.decoder == "tiff":
            from bgars.io.decoders.tiff import read_tiff_pages  # noqa: PLC0415 - with its library

            return read_tiff_pages(path, count, max_megapixels)
        from bgars.io.decoders.npy import npy_array  # noqa: PLC0415 - beside it

        return _lights_first(npy_array(path), count, path, max_megapixels)
    except (FileFormatError, MemoryError):
        raise
    except Exception as error:  # decoders raise whatever their libraries raise; here all of it means one thing
        reason = " ".join(str(error).split())[:200]
        msg = f"{path}: cannot be decoded as a stack of images ({type(error).__name__}: {reason})"
        raise FileFormatError(msg) from error


def _lights_first(array: NDArray[Any], count: int, path: Path, max_megapixels: float) -> NDArray[Any]:
    """Bring an array (L, H, W[, channels]) or (H, W, L) to the first form."""
    shape = array.shape
    if (len(shape) == 4 and shape[0] == count and shape[3] in CHANNELS) or (len(shape) == 3 and shape[0] == count):  # noqa: PLR2004
        check_size(path, shape[1], shape[2], max_megapixels)
        return np.asarray(array)
    if len(shape) == 3 and shape[2] == count:  # noqa: PLR2004 - rows, columns, lights
        check_size(path, shape[0], shape[1], max_megapixels)
        return np.ascontiguousarray(np.moveaxis(array, 2, 0))
    msg = f"{path}: must hold {count} images, one per light, as (lights, rows, columns), but its shape is {shape}"
    raise FileFormatError(msg)
