"""One connected part of a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Component"]


@dataclass(frozen=True)
class Component:
    """One connected part of a height map; without an anchor its mean is 0, its height against other parts unknown.

    Attributes
    ----------
    pixels : int
        Number of pixels.
    first_row, first_col : int
        Its first pixel in reading order.
    anchor_pixels : int
        Known heights that fix it; 0: its height is arbitrary.
    anchor_rms_px : float
        Root mean square distance from them; NaN without any.
    """

    pixels: int
    first_row: int
    first_col: int
    anchor_pixels: int = 0
    anchor_rms_px: float = math.nan
