"""A height map as seen from the front and above, true to scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.report.painter import Painter

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL import Image

    Array = NDArray[np.float64]

__all__ = ["relief"]

ELEVATION_DEG, TURN_DEG = 38.0, -28.0
"""Of the view: how far above the board, and the turn about the vertical, counter-clockwise."""
MARGIN = 0.02


def relief(z: Array, spacing: float, colors: Array, width_px: int) -> Image.Image:
    """Draw a surface in parallel projection.

    Parameters
    ----------
    z : (H, W) float64
        Heights, the first row at the back; NaN leaves a hole.
    spacing : float
        Between rows and columns, in the unit of the heights.
    colors : (H, W, 3) float64
        Red, green, blue from 0 to 1.
    width_px : int
        Of the picture.

    Returns
    -------
    PIL.Image.Image
        RGBA, transparent where nothing is.
    """
    rows, cols = z.shape
    turn, rise = np.radians(TURN_DEG), np.radians(ELEVATION_DEG)
    x, y = np.meshgrid((np.arange(cols) - cols / 2) * spacing, (rows / 2 - np.arange(rows)) * spacing)
    right, back = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    places = np.stack([right, back * np.sin(rise) + z * np.cos(rise)], axis=2)
    corners = np.stack([places[:-1, :-1], places[:-1, 1:], places[1:, 1:], places[1:, :-1]], axis=2).reshape(-1, 4, 2)
    depth = (back * np.cos(rise) - z * np.sin(rise))[:-1, :-1].ravel()
    known = np.flatnonzero(np.isfinite(corners[..., 1]).all(axis=1))
    order = known[np.argsort(-depth[known], kind="stable")]
    seen = corners[order].reshape(-1, 2)
    low, high = (seen.min(axis=0), seen.max(axis=0)) if len(seen) else (np.zeros(2), np.ones(2))
    room = MARGIN * float((high - low).max()) + spacing
    low, high = low - room, high + room
    size = width_px, max(1, round(width_px * float((high[1] - low[1]) / (high[0] - low[0]))))
    painter = Painter.of(low, high, size)
    painter.polygons(corners[order], colors[:-1, :-1].reshape(-1, 3)[order])
    return painter.picture()
