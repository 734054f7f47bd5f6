"""Pixels around the rims of balls, and what they read in every light."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

__all__ = ["TAPER_PX", "RimPixels", "sector_count"]

MOST_SECTORS, FEWEST_SECTORS = 24, 12
"""Equal angles that a rim is divided into."""
LEAST_ARC_PX = 4.0
"""A narrower sector has hardly more pixels than the basis of the rim has terms."""
TAPER_PX = 1.0
"""Width over which the weight of pixels falls to nothing at the edges of a band."""


def sector_count(radius_px: NDArray[np.float64]) -> int:
    """Sectors that the rims of circles like these are divided into."""
    arcs = 2.0 * np.pi * float(np.median(radius_px)) / LEAST_ARC_PX if len(radius_px) else MOST_SECTORS
    return int(np.clip(arcs, FEWEST_SECTORS, MOST_SECTORS))


class RimPixels:
    """Pixels around the rims, sorted into sectors of equal angle and padded to equal number.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        The circles.
    in_px, out_px : (N,) float64
        Depths of the bands inside and outside.
    every : int
        One pixel in how many is taken.
    sectors : int
        Equal angles (S) that a rim is divided into.

    Attributes
    ----------
    row, col : (N, S, P) float32
        Pixels relative to the anchor of the ball.
    weight : (N, S, P) float32
        Roots of the pixels' weights: 1, less toward the edges of the band, so that pixels come and go without a jump;
        0 for padding and for pixels outside the image or the mask.
    levels : (L, N, S, P) float32
        Grey levels times `weight`.
    """

    def __init__(
        self,
        levels: Levels,
        row: NDArray[np.float64],
        col: NDArray[np.float64],
        radius_px: NDArray[np.float64],
        in_px: NDArray[np.float64],
        out_px: NDArray[np.float64],
        every: int,
        sectors: int,
    ) -> None:
        directions = levels.capture.rig.directions
        self.threads = levels.threads
        self.azimuths_rad = np.arctan2(directions[:, 1], directions[:, 0])
        self.anchor_row = np.rint(row).astype(np.int64)
        self.anchor_col = np.rint(col).astype(np.int64)
        circles, depths = np.stack([row, col, radius_px], axis=1), np.stack([in_px, out_px], axis=1)
        self.row, self.col, self.weight = _bgars.rim_bands(
            circles, depths, every=every, sectors=sectors, threads=levels.threads
        )
        height, width = levels.height, levels.width
        image_row = self.row.astype(np.int64) + self.anchor_row[:, None, None]
        image_col = self.col.astype(np.int64) + self.anchor_col[:, None, None]
        inside = (image_row >= 0) & (image_row < height) & (image_col >= 0) & (image_col < width)
        self.weight *= inside
        y = (row - self.anchor_row)[:, None, None] - self.row
        x = self.col - (col - self.anchor_col)[:, None, None]
        depth = radius_px[:, None, None] - np.hypot(x, y)
        margin = np.minimum(in_px[:, None, None] - depth, depth + out_px[:, None, None])
        self.weight *= np.sqrt(np.clip(margin / TAPER_PX, 0.0, 1.0)).astype(np.float32)
        pixels = np.where(inside, image_row * width + image_col, 0)
        self.levels = levels.at(pixels) * self.weight
        self.clipped: NDArray[np.bool_] = np.any(levels.clipped_at(pixels) & (self.weight > 0), axis=3)

    def take(self, index: slice | NDArray[np.intp]) -> RimPixels:
        """The pixels of some of the balls."""
        part = copy.copy(self)
        for name in ("anchor_row", "anchor_col", "row", "col", "weight"):
            setattr(part, name, np.ascontiguousarray(getattr(self, name)[index]))
        part.levels, part.clipped = np.ascontiguousarray(self.levels[:, index]), self.clipped[:, index]
        return part
