"""What a pixel near the rim of a ball reads: a step and a square root, averaged over the pixel and blurred."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records import FloatArray

__all__ = ["SHAPES", "RimTable"]

SHAPES = 4
"""Depth profiles: step, square root and ramp inside the rim, ramp outside."""
ANGLES = 31
STEPS_PER_PX = 64
THINNEST_PX = 0.08


class RimTable:
    """Depth profiles averaged over a square pixel and a Gaussian blur, tabulated over depth and direction.

    Near the rim of a sphere n_z = sqrt(2 t / R) with t the depth inside the silhouette, so radiance is a series in
    sqrt(t) there. A pixel averages it over a box; along a direction the box is two boxes of widths |cos| and |sin|,
    one after the other; two more with the variance of the blur stand for the Gaussian. Averages over boxes are
    differences of repeated integrals, in closed form for powers of t.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the lens blur.
    reach_px : float
        Largest depth, inside and outside.
    """

    def __init__(self, blur_px: float, reach_px: float) -> None:
        self.blur_px = blur_px
        self.reach_px = reach_px
        count = 2 * math.ceil(reach_px * STEPS_PER_PX) + 1
        self.first_px = -(count // 2) / STEPS_PER_PX
        self.count = count
        depth_px = self.first_px + np.arange(count) / STEPS_PER_PX
        angles_rad = np.linspace(0.0, math.pi / 4, ANGLES)
        table = np.zeros((ANGLES, count, 2 * SHAPES))
        soft = math.sqrt(6.0) * blur_px
        for index, angle in enumerate(angles_rad):
            widths = [max(w, THINNEST_PX) for w in (math.cos(angle), math.sin(angle), soft, soft)]
            table[index] = _profiles(depth_px, widths)
        self.table: FloatArray = table.reshape(-1, 2 * SHAPES).astype(np.float32)

    def look_up(self, depth_px: NDArray[np.floating], fold: NDArray[np.int32]) -> FloatArray:
        """(..., 2 SHAPES) profiles and their derivatives by depth, at depths and folded directions (:meth:`fold`)."""
        inside = np.clip(depth_px, self.first_px, -self.first_px)
        place = np.rint((inside - self.first_px) * STEPS_PER_PX).astype(np.int32)
        found: FloatArray = self.table.take(place + fold * self.count, axis=0)
        return found

    @staticmethod
    def fold(x: NDArray[np.floating], y: NDArray[np.floating]) -> NDArray[np.int32]:
        """Index of directions (x, y), folded into an eighth of the circle."""
        ax, ay = np.abs(x), np.abs(y)
        angle = np.arctan2(np.minimum(ax, ay), np.maximum(ax, ay))
        folded: NDArray[np.int32] = np.rint(angle * ((ANGLES - 1) / (math.pi / 4))).astype(np.int32)
        return folded


def _profiles(depth_px: NDArray[np.float64], widths_px: list[float]) -> NDArray[np.float64]:
    """(T, 2 SHAPES): averages over four boxes of the step, root and ramps, then their derivatives."""
    profiles = np.zeros((len(depth_px), 2 * SHAPES))
    volume = math.prod(widths_px)
    for corner in range(16):
        signs = [1 if corner >> bit & 1 else -1 for bit in range(4)]
        shift = sum(sign * width / 2 for sign, width in zip(signs, widths_px, strict=True))
        weight = math.prod(signs) / volume
        inside = np.maximum(depth_px + shift, 0.0)
        outside = np.maximum(-depth_px - shift, 0.0)
        root = np.sqrt(inside)
        profiles[:, 0] += weight * inside**4 / 24
        profiles[:, 1] += weight * inside**4 * root * (16 / 945)
        profiles[:, 2] += weight * inside**5 / 120
        profiles[:, 3] += weight * outside**5 / 120
        profiles[:, 4] += weight * inside**3 / 6
        profiles[:, 5] += weight * inside**3 * root * (8 / 105)
        profiles[:, 6] += weight * inside**4 / 24
        profiles[:, 7] -= weight * outside**4 / 24
    return profiles
