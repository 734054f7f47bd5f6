"""The kinds of pixel arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars
from bgars.records.plain_arrays import (
    plain,
)

__all__ = ["BoolArray", "FloatArray", "PixelArray", "float_full_scale"]

PixelArray = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
FloatArray = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


def float_full_scale(pixels: PixelArray, threads: int | None) -> float:
    """Return the largest finite value of float pixels: their full scale, where no saturation level is known."""
    return _bgars.float_full_scale(plain("images", pixels, np.float32), threads=threads)
