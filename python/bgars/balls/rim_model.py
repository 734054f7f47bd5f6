"""What a pixel near the rim of a ball reads: a step and a square root, averaged over the pixel and blurred."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.rim_pixels import RimPixels

    Array = NDArray[np.float64]

__all__ = ["BASIS", "SLOPES", "RimModel"]

BASIS = 7
"""Board, step, root, ramp inside, ramp outside, board along the rim, step along the rim."""
SLOPES = (1, 2, 3, 4, 6)
"""What of the basis moves with the rim: the derivatives by the radius, in this order."""


class RimModel:
    """Depth profiles averaged over a square pixel and a Gaussian blur, tabulated over depth and direction.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the lens blur.
    reach_px : float
        Largest depth, inside and outside.
    threads : int, optional
        Largest number of threads; by default one per core.
    """

    def __init__(self, blur_px: float, reach_px: float, threads: int | None = None) -> None:
        self.blur_px = blur_px
        self.threads = threads
        self.table = _bgars.rim_profiles(blur_px, reach_px, threads=threads)

    def take_out(self, pixels: RimPixels, row: Array, col: Array, radius_px: Array) -> tuple[Array, Array]:
        """Fit the basis to each light in each sector of the circles, and to its own derivatives by the radius.

        Returns
        -------
        rest : (N, SECTORS, 5 + L, 5 + L) float64
            Products of what the fit leaves of the derivatives (:data:`SLOPES`) and of the lights.
        coefficients : (N, SECTORS, BASIS, L) float64
            Of the lights.
        """
        circles = np.stack([row - pixels.anchor_row, col - pixels.anchor_col, radius_px], axis=1)
        return _bgars.eliminate_rims(pixels, circles, self.table, blur_px=self.blur_px, threads=self.threads)
