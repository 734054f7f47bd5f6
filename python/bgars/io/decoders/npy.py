"""NumPy arrays as images, or as the stack of all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["npy_array", "read_npy"]


def read_npy(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return the pixels of an array (H, W) or (H, W, channels)."""
    array = npy_array(path)
    if array.ndim < 2:  # noqa: PLR2004 - rows and columns
        msg = f"{path}: must hold one grey or RGB image, but its shape is {array.shape}"
        raise FileFormatError(msg)
    check_size(path, array.shape[0], array.shape[1], max_megapixels)
    if array.dtype == np.bool_:
        return np.asarray(array).astype(np.uint8) * np.uint8(255)
    return np.array(array)


def npy_array(path: Path) -> NDArray[Any]:
    """Return an array that is not in memory yet: its header and the size of its file fit each other."""
    return np.load(path, mmap_mode="r", allow_pickle=False)  # type: ignore[no-any-return]
