"""Blur by the lens."""

from __future__ import annotations

import numpy as np

from bgars.simulate.solids import Array

__all__ = ["blur"]


def blur(values: Array, sigma_px: float, reach_px: int) -> Array:
    """Gaussian blur of (R, C) values; the result is smaller by `reach_px` on every side.

    Sums run in a fixed order, so the bits do not depend on the tile.
    """
    if reach_px == 0:
        return values
    place = np.arange(-reach_px, reach_px + 1)
    weights = np.exp(-0.5 * (place / sigma_px) ** 2)
    weights /= weights.sum()
    rows = values.shape[0] - 2 * reach_px
    cols = values.shape[1] - 2 * reach_px
    down = np.zeros((rows, values.shape[1]))
    for index, weight in enumerate(weights):
        down += weight * values[index : index + rows]
    across = np.zeros((rows, cols))
    for index, weight in enumerate(weights):
        across += weight * down[:, index : index + cols]
    return across
