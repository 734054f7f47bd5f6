"""How sharp shadow edges are: pixel and lens alike everywhere, the lamp's width and height by the way of its light."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.bundle_model import tangents
from bgars.inspection.shadow_model import light_derivatives

if TYPE_CHECKING:
    from bgars.inspection.shadow_edges import Edges
    from bgars.inspection.shadow_model import Balls, Rays

__all__ = ["SHARP_PX", "EdgeSpread", "fit_spread", "lamp_gradients"]

Array = NDArray[np.float64]

SHARPEST_PX = 0.2
"""Least spread of an edge by lens and pixel together."""
SHARP_PX = 0.3
"""A pixel alone: the standard deviation of a box one pixel wide is 0.29."""
BLUNTEST_PX = 12.0
"""Wider spreads are no edges."""
FLOOR_PX = 0.03
"""Least standard uncertainty of the spread of one stretch."""
ROUNDS = 5
CAUCHY = 2.0
"""Scale of the Cauchy loss of spreads, in standard deviations."""
ROWS_OF_BLOCK = 128
"""Rows that are factorised together."""
MIN_STRETCHES = 20
"""Stretches of edge that tell their spread by lamp and lens."""


class EdgeSpread(NamedTuple):
    """``s^2 = sharp^2 + (g_a a)^2 + (g_e e)^2``: standard deviations of an edge.

    In px, and of the lamp in radians seen from the board, along the azimuth and up; `lamp_rad` is that of a round lamp
    that blurs as much on the whole.
    """

    sharp_px: float
    lamp_rad: float
    lamp_azimuth_rad: float = 0.0
    lamp_elevation_rad: float = 0.0


def lamp_gradients(beam: Rays, balls: Balls, vectors: Array) -> tuple[Array, Array]:
    """(N, L, S) change of the distance to an edge, px, by turning its light along the azimuth and up, per radian."""
    ways = tangents(vectors)
    by_light = light_derivatives(beam, balls, (ways[None, :, None, 0], ways[None, :, None, 1]))
    by_light = by_light / np.maximum(beam.slope, 1e-3)[..., None]
    return by_light[..., 0], by_light[..., 1]


def fit_spread(edges: Edges) -> EdgeSpread:
    """Fit the parts of the spread to the measured spreads of all stretches, robustly, none below zero."""
    known = np.isfinite(edges.u_spread_px) & (edges.spread_px > 0) & (edges.spread_px < BLUNTEST_PX)
    if known.sum() < MIN_STRETCHES:
        return EdgeSpread(SHARP_PX, 0.0)
    way, spread = edges.way_px[known] ** 2, edges.spread_px[known] ** 2
    along, up = edges.lamp_azimuth_px[known] ** 2, edges.lamp_elevation_px[known] ** 2
    u = 2.0 * np.maximum(edges.spread_px[known], SHARP_PX) * np.hypot(edges.u_spread_px[known], FLOOR_PX)
    size = np.array([1.0, max(float(along.mean()), 1e-9), max(float(up.mean()), 1e-9)])
    columns = np.column_stack([np.ones_like(way), along, up]) / size
    floor = SHARPEST_PX**2
    weight = 1.0 / u
    part = np.zeros(3)
    for _ in range(ROUNDS):
        part = _nonnegative(columns * weight[:, None], (spread - floor) * weight) / size
        residual = spread - floor - (columns * size) @ part
        scale = max(1.4826 * float(np.median(np.abs(residual / u))), 0.1)
        weight = 1.0 / (u * np.sqrt(1.0 + (residual / (CAUCHY * scale * u)) ** 2))
    by_lamp = part[1] * along + part[2] * up
    round_lamp = float((weight**2 * way * by_lamp).sum() / max(float((weight**2 * way * way).sum()), 1e-30))
    sharp, wide, high = np.sqrt([floor + part[0], part[1], part[2]])
    return EdgeSpread(float(sharp), float(np.sqrt(round_lamp)), float(wide), float(high))


def _nonnegative(columns: Array, values: Array) -> Array:
    """Least squares on a few columns, none of the weights below zero: the best of all choices of columns.

    ``scipy.optimize.nnls`` takes longer to import than a small part to measure.
    """
    triangle, wanted = _triangle(columns, values)
    best, least = np.zeros(columns.shape[1]), float(wanted @ wanted)
    for choice in product((False, True), repeat=columns.shape[1]):
        chosen = np.flatnonzero(choice)
        found = np.zeros(columns.shape[1])
        found[chosen] = np.linalg.lstsq(triangle[:, chosen], wanted, rcond=None)[0] if chosen.size else 0.0
        loss = float(np.sum(np.square(triangle @ found - wanted)))
        if loss < least and (found >= 0.0).all():
            best, least = found, loss
    return best


def _triangle(columns: Array, values: Array) -> tuple[Array, Array]:
    """Triangle of a QR factorisation and the values turned alike, block by block: no product wakes a second thread."""
    rows = np.column_stack([columns, values])
    padding = np.zeros((-len(rows) % ROWS_OF_BLOCK, rows.shape[1]))
    blocks = np.concatenate([rows, padding]).reshape(-1, ROWS_OF_BLOCK, rows.shape[1])
    triangles = cast("Array", np.linalg.qr(blocks, mode="r"))
    triangle = cast("Array", np.linalg.qr(triangles.reshape(-1, rows.shape[1]), mode="r"))
    return triangle[:, :-1], triangle[:, -1]
