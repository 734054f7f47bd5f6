"""Solder that joins neighbours: a ridge where board should be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.pixels import FloatArray

__all__ = ["joined_pairs"]

NEIGHBOUR = 1.3
"""Farthest neighbours, in pitches."""
WIDTHS = (0.15, 0.25, 0.4, 0.6)
"""Half widths of a ridge to try, in radii."""
MIN_RIDGE = 0.35
"""Mean slope away from the line between two balls, as a sine, that a bridge has at least."""
ABOVE_OTHERS = 0.1
"""And so much more than the median gap of the part."""
CLEAR = 0.25
"""So much more needs no other witness; less than that must shine as well."""
USUAL_RIDGE = 0.2
"""What stands for the median gap where there are fewer than `ENOUGH_PAIRS`."""
ENOUGH_PAIRS = 4
"""Gaps whose median says what is usual."""
BRIGHTER = 1.2
"""Brightest level of a gap, over that of the board, from which on it shines."""


def joined_pairs(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    radius: NDArray[np.float64],
    pitch: float,
    slopes: tuple[FloatArray, FloatArray],
    brightest: FloatArray,
) -> list[tuple[int, int]]:
    """Indices of neighbours that are joined.

    A bridge slopes away from the line between two centres on both sides. So does, weakly, the shadowed board of narrow
    gaps; that is alike in all gaps and darker than lit board, while solder shines.

    Parameters
    ----------
    x, y, radius : (N,) float64
        Circles in pixels of `slopes`, x right and y up, origin at the image centre.
    pitch : float
        Distance of neighbours in the same pixels.
    slopes : two (H, W) float32
        See :func:`bgars.balls.outward.slope_field`.
    brightest : (H, W) float32
        Highest level over the lights.
    """
    height, width = brightest.shape
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    reach = np.maximum(NEIGHBOUR * pitch, 1.02 * (radius[:, None] + radius))
    pairs = [(int(i), int(j)) for i, j in np.argwhere(apart < reach) if i < j]
    if not pairs:
        return []
    board = _board_level(x, y, radius, brightest)
    i, j = np.array(pairs).T
    apart, gap = apart[i, j], np.maximum(apart[i, j] - radius[i] - radius[j], 1.0)
    along_x, along_y = (((end[j] - end[i]) / apart)[:, None, None] for end in (x, y))
    across = np.linspace(-0.6, 0.6, 25)
    u = (radius[i, None] + gap[:, None] * np.linspace(0.3, 0.7, 9))[:, :, None]
    v = (np.minimum(radius[i], radius[j])[:, None] * across)[:, None, :]
    row = np.rint(height / 2 - 0.5 - (y[i, None, None] + along_y * u + along_x * v)).astype(int).clip(0, height - 1)
    col = np.rint(x[i, None, None] + along_x * u - along_y * v + width / 2 - 0.5).astype(int).clip(0, width - 1)
    away = ((along_x * slopes[1][row, col] - along_y * slopes[0][row, col]) * np.sign(v)).mean(axis=1)
    ridges = np.max([away[:, np.abs(across) < half].mean(axis=1) for half in WIDTHS], axis=0)
    levels = brightest[row[..., 8:17], col[..., 8:17]].mean(axis=(1, 2))
    usual = float(np.median(ridges)) if len(pairs) >= ENOUGH_PAIRS else USUAL_RIDGE
    joined = (ridges > MIN_RIDGE) & (ridges > usual + ABOVE_OTHERS)
    joined &= (levels > BRIGHTER * board) | (ridges > usual + CLEAR)
    joined |= apart < radius[i] + radius[j]
    return [pair for pair, is_joined in zip(pairs, joined, strict=True) if is_joined]


def _board_level(
    x: NDArray[np.float64], y: NDArray[np.float64], radius: NDArray[np.float64], brightest: FloatArray
) -> float:
    """Median over the pixels outside all circles."""
    height, width = brightest.shape
    board = np.ones(brightest.shape, np.bool_)
    for x_, y_, r in zip(x + width / 2 - 0.5, height / 2 - 0.5 - y, 1.1 * radius, strict=True):
        rows = slice(max(int(y_ - r), 0), max(int(y_ + r) + 2, 0))
        cols = slice(max(int(x_ - r), 0), max(int(x_ + r) + 2, 0))
        board[rows, cols] = False
    return float(np.median(brightest[board])) if board.any() else 0.0
