"""What a pixel near the rim of a ball reads: a step and a square root, averaged over the pixel and blurred."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records import FloatArray

__all__ = ["SHAPES", "RimTable"]

SHAPES = 4
"""Depth profiles: step, square root and ramp inside the rim, ramp outside."""
ANGLES = 16
STEPS_PER_PX = 64


class RimTable:
    """Depth profiles averaged over a square pixel and a Gaussian blur, tabulated over depth and direction.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the lens blur.
    reach_px : float
        Largest depth, inside and outside.
    threads : int, optional
        Most threads to work on; by default one a core.
    """

    def __init__(self, blur_px: float, reach_px: float, threads: int | None = None) -> None:
        self.blur_px = blur_px
        self.reach_px = reach_px
        table = _bgars.rim_profiles(blur_px, reach_px, threads=threads)
        self.count = table.shape[1]
        self.first_px = -(self.count // 2) / STEPS_PER_PX
        # Beside each value the step to the next depth, so that one look-up serves both.
        rise = np.diff(table, axis=1, append=table[:, -1:])
        self.table: FloatArray = np.concatenate([table, rise], axis=2).reshape(-1, 4 * SHAPES)

    def look_up(self, depth_px: NDArray[np.floating], fold: NDArray[np.int32]) -> FloatArray:
        """(..., 2 SHAPES) profiles and their derivatives by depth, at depths and folded directions (:meth:`fold`).

        Linear between the depths of the table: with the nearest one circles move by jumps, which weak rims amplify.
        """
        inside = np.clip(depth_px, self.first_px, -self.first_px)
        place = (inside - self.first_px) * STEPS_PER_PX
        below = place.astype(np.int32)
        found = self.table.take(below + fold * self.count, axis=0)
        part = (place - below).astype(np.float32)[..., None]
        values: FloatArray = found[..., : 2 * SHAPES] + part * found[..., 2 * SHAPES :]
        return values

    @staticmethod
    def fold(x: NDArray[np.floating], y: NDArray[np.floating]) -> NDArray[np.int32]:
        """Index of directions (x, y), folded into an eighth of the circle."""
        ax, ay = np.abs(x), np.abs(y)
        angle = np.arctan2(np.minimum(ax, ay), np.maximum(ax, ay))
        folded: NDArray[np.int32] = np.rint(angle * ((ANGLES - 1) / (math.pi / 4))).astype(np.int32)
        return folded
