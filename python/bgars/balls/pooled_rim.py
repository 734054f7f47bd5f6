"""How much smaller silhouettes are than the circles of their highlights, from all rims of a part together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.balls.rim_fit import Circles, rim_costs
from bgars.balls.rim_pixels import sector_count

if TYPE_CHECKING:
    from bgars.balls.highlights import HighlightCircles
    from bgars.balls.levels import Levels

__all__ = ["COST_SCALE", "POOLED_ERROR", "RATIO_ERROR", "pooled_ratio"]

COST_SCALE = 20.0
"""Difference of costs that speaks clearly for one of two circles: residuals of neighbouring pixels are alike."""
RATIOS = np.linspace(0.86, 1.06, 11)
"""Silhouette over highlight radius: 1 for a sphere; less for flat balls, and for caps lower than half a ball."""
RATIO_ERROR = 0.03
"""Standard deviation of the ratio of spheres: off-specular peaks, wide lobes, lamps that are elsewhere."""
POOLED_ERROR = 0.012
"""Standard deviation of the ratio found here: metal mirrors board and shadows, which end before the silhouette does."""
BLUR_PX = 0.3
"""Blur of the lens before it is known."""
BALLS = 60
"""More than these say nothing new."""


def pooled_ratio(levels: Levels, shine: HighlightCircles) -> float:
    """Ratio of silhouette to highlight radius that explains the rims of all balls best.

    The rim of metal is a grey level or two, and that of one ball is lost in noise and among the edges of what it
    mirrors. These differ from ball to ball; the silhouette is in all of them in the same proportion to the highlights.

    Parameters
    ----------
    levels : Levels
        The capture.
    shine : HighlightCircles
        Circles from highlights, without NaN.
    """
    some = slice(None, None, max(1, math.ceil(len(shine.row) / BALLS)))
    row, col, radius_px = shine.row[some], shine.col[some], shine.radius_px[some]
    nothing = np.zeros_like(row)
    offsets = np.zeros((len(row), sector_count(radius_px)))
    tried = [
        Circles(row, col, ratio * radius_px, nothing, nothing, nothing, offsets, blur_px=BLUR_PX) for ratio in RATIOS
    ]
    costs = rim_costs(levels, row, col, RATIOS.mean() * radius_px, tried).sum(axis=1)
    costs = costs / COST_SCALE + ((RATIOS - 1.0) / RATIO_ERROR) ** 2
    at = int(np.clip(np.argmin(costs), 1, len(RATIOS) - 2))
    curve = np.polyfit(RATIOS[at - 1 : at + 2], costs[at - 1 : at + 2], 2)
    lowest = -curve[1] / (2.0 * curve[0]) if curve[0] > 0 else RATIOS[int(np.argmin(costs))]
    return float(np.clip(lowest, RATIOS[0], RATIOS[-1]))
