"""All circles of balls in a capture, with or without a mask."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.balls.outward import outward_centres, slope_field
from bgars.balls.rim_fit import Circles, fit_rims
from bgars.balls.rim_scan import CoarseCircles, scan_rims

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

__all__ = ["find_circles"]

WORKING_SIZE_PX = 512
FLOOR_LEVELS = 2.0
MIN_SHARE = 0.7
MIN_SUPPORT = 0.6


def find_circles(levels: Levels) -> Circles:
    factor = max(1, max(levels.height, levels.width) // WORKING_SIZE_PX)
    capture = levels.capture
    reduced = levels.reduced(factor)
    pixel_um = None if capture.pixel_pitch_um is None else capture.pixel_pitch_um * factor
    slope_x, slope_y = slope_field(reduced, capture.rig, pixel_um, FLOOR_LEVELS)
    centres = np.array(outward_centres(slope_x, slope_y)).reshape(-1, 4)
    centres = centres[_best_of_place(centres)]
    row, col = ((centres[:, i] + 0.5) * factor - 0.5 for i in (0, 1))
    coarse = scan_rims(levels, row, col, centres[:, 2] * factor)
    keep = _without_overlaps(coarse)
    if not len(keep):
        return Circles(*(np.zeros(0) for _ in range(6)), np.zeros((0, 24)))
    circles, _ = fit_rims(levels, *(column[keep] for column in coarse[:3]))
    return circles


def _best_of_place(centres: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of centres (best first) that no better one of about the same scale is next to."""
    keep: list[int] = []
    for index, (row, col, scale_px, _) in enumerate(centres):
        if keep:
            other = centres[keep]
            distance = np.hypot(other[:, 0] - row, other[:, 1] - col)
            ratio = scale_px / other[:, 2]
            if ((distance < 0.3 * np.minimum(scale_px, other[:, 2]) + 1) & (ratio < 2.0) & (ratio > 0.5)).any():
                continue
        keep.append(index)
    return np.array(keep, np.intp)


def _without_overlaps(coarse: CoarseCircles) -> NDArray[np.intp]:
    """Indices of circles with rims all around, strongest first, that do not run far into a stronger one."""
    keep: list[int] = []
    for index in np.argsort(-coarse.strength * coarse.share):
        if coarse.share[index] < MIN_SHARE:
            continue
        distance = np.hypot(coarse.row[keep] - coarse.row[index], coarse.col[keep] - coarse.col[index])
        if (distance < 0.85 * (coarse.radius_px[keep] + coarse.radius_px[index])).any():
            continue
        keep.append(int(index))
    return np.array(keep, np.intp)
