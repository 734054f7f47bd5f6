"""How sharp shadow edges are: pixel and lens alike everywhere, the lamp's size by the way of its light."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from bgars.inspection.shadow_edges import Edges

__all__ = ["SHARP_PX", "EdgeSpread", "fit_spread"]

SHARPEST_PX = 0.2
SHARP_PX = 0.3
"""A pixel alone: the standard deviation of a box one pixel wide is 0.29."""
BLUNTEST_PX = 5.0
FLOOR_PX = 0.03
ROUNDS = 5
CAUCHY = 2.0
MIN_STRETCHES = 20


class EdgeSpread(NamedTuple):
    """s^2 = sharp^2 + (lamp way)^2: standard deviations in px, and in radians seen from the board."""

    sharp_px: float
    lamp_rad: float


def fit_spread(edges: Edges) -> EdgeSpread:
    """Fit both parts of the spread to the measured spreads of all stretches, robustly, none below zero."""
    known = np.isfinite(edges.u_spread_px) & (edges.spread_px > 0) & (edges.spread_px < BLUNTEST_PX)
    if known.sum() < MIN_STRETCHES:
        return EdgeSpread(SHARP_PX, 0.0)
    way, spread = edges.way_px[known] ** 2, edges.spread_px[known] ** 2
    u = 2.0 * np.maximum(edges.spread_px[known], SHARP_PX) * np.hypot(edges.u_spread_px[known], FLOOR_PX)
    weight = 1.0 / u**2
    sharp, lamp = float(np.median(spread)), 0.0
    for _ in range(ROUNDS):
        total, mean_way, mean_spread = weight.sum(), np.average(way, weights=weight), np.average(spread, weights=weight)
        variance = float((weight * (way - mean_way) ** 2).sum())
        lamp = float((weight * (way - mean_way) * (spread - mean_spread)).sum()) / max(variance, 1e-12 * float(total))
        lamp = max(lamp, 0.0)
        sharp = float(mean_spread - lamp * mean_way)
        if sharp < SHARPEST_PX**2:
            sharp = SHARPEST_PX**2
            lamp = max(float((weight * way * (spread - sharp)).sum() / (weight * way * way).sum()), 0.0)
        residual = spread - sharp - lamp * way
        scale = max(1.4826 * float(np.median(np.abs(residual / u))), 0.1)
        weight = 1.0 / (u**2 * (1.0 + (residual / (CAUCHY * scale * u)) ** 2))
    return EdgeSpread(float(np.sqrt(sharp)), float(np.sqrt(lamp)))
