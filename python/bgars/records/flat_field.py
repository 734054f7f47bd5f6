"""The flat field of a station."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bgars.records.short import Short

__all__ = ["FlatField"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FlatField(Short):
    """How even each light is on a flat board: smooth maps, one polynomial per light.

    Attributes
    ----------
    coefficients : (L, T) float64
        Of Legendre polynomials P_i(x) P_j(y), i + j <= degree, x and y from -1 to 1 across the image, y up; the order
        is that of ``station_apply.legendre_terms``. Levels are those of the flat board, 255 = full scale.
    degree : int
        Of the polynomials.
    size_px : (int, int)
        Height and width of the images.
    residual : float
        Relative residual of the board's levels, noise removed, root mean square.
    """

    coefficients: Array
    degree: int
    size_px: tuple[int, int]
    residual: float = 0.0
