"""Numbers with which programs mark the pixels of a height map that have no height."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["without_marks"]

NO_HEIGHT = 1e9
"""Beyond it is nothing: a kilometre in um. 1e30, the largest float, and the ends of 32-bit integers are."""
MARKS = (-9999.0, -99999.0, -32768.0, -32767.0, 9999.0, 99999.0, 32767.0, 65535.0)
"""What is usual otherwise: no-data of rasters, and the ends of 16-bit integers."""
GAP = 0.1
"""Share of the other heights' range that a mark is away from all of them, as a surface that ends there is not.

That a height is one of a few numbers exactly, and the lowest or highest, is chance already: float32 has a thousand
others to the micrometre there. Levels that were clipped to 16 bits also end in one, but reach it without a gap.
"""


def without_marks(heights: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return heights (H, W) with NaN where they are marks, and what is to be said of it.

    Examples
    --------
    >>> without_marks(np.float32([[-9999.0, 1.0, 2.0]]))
    (array([[nan,  1.,  2.]], dtype=float32), ('-9999 taken as no height (1 of 3 pixels)',))
    """
    notes: list[str] = []
    with np.errstate(invalid="ignore"):
        beyond = np.isfinite(heights) & (np.abs(heights) >= NO_HEIGHT)
    if beyond.any():
        notes.append(_told(heights, beyond))
        heights = np.where(beyond, np.float32(np.nan), heights)
    for _ in MARKS:
        value = _mark_of(heights[np.isfinite(heights)])
        if value is None:
            break
        notes.append(_told(heights, heights == value))
        heights = np.where(heights == value, np.float32(np.nan), heights)
    return heights, tuple(notes)


def _mark_of(heights: FloatArray) -> float | None:
    """The lowest or highest of some heights, where it is a mark."""
    for value in (heights.min(), heights.max()) if heights.size else ():
        if float(value) in MARKS:
            others = heights[heights != value]
            if not others.size or np.abs(others - value).min() > GAP * np.ptp(others):
                return float(value)
    return None


def _told(heights: FloatArray, is_mark: BoolArray) -> str:
    count = int(np.count_nonzero(is_mark))
    return f"{heights[is_mark][0]:.6g} taken as no height ({count} of {heights.size} pixels)"
