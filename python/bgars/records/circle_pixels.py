"""The pixels inside circles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

__all__ = ["inside_circles"]


def inside_circles(circles_px: Iterable[tuple[float, float, float]], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return (H, W) True for pixels whose centre is strictly inside a circle.

    Parameters
    ----------
    circles_px : iterable of (x, y, radius)
        x right and y up from the image centre.
    shape : (H, W)

    Examples
    --------
    >>> inside_circles([(0.5, 0.5, 1.0)], (2, 4)).astype(int).tolist()
    [[0, 0, 1, 0], [0, 0, 0, 0]]
    """
    height, width = shape
    inside: NDArray[np.bool_] = np.zeros(shape, np.bool_)
    for x_px, y_px, radius_px in circles_px:
        col, row = x_px + width / 2 - 0.5, height / 2 - y_px - 0.5
        first_row, first_col = max(math.floor(row - radius_px), 0), max(math.floor(col - radius_px), 0)
        end_row, end_col = max(math.ceil(row + radius_px) + 1, 0), max(math.ceil(col + radius_px) + 1, 0)
        part = inside[first_row:end_row, first_col:end_col]
        down = (np.arange(part.shape[0]) + first_row - row)[:, None]
        across = np.arange(part.shape[1]) + first_col - col
        part |= down**2 + across**2 < radius_px**2
    return inside
