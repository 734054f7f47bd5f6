"""How sharp shadow edges are: pixel and lens alike everywhere, the lamp's width and height by the way of its light.

A lamp that is wide blurs an edge, and moves it, too: seen from a board point on the edge, half of the lamp is hidden.
With d the distance to the edge, g its gradient and H its second derivative by the direction of the light, half of a
lamp with covariance S is hidden where ``d + H_tt v / 2 = 0``, t the direction on the lamp along which d does not change
(g t = 0) and v the variance of the lamp there, ``1 / (t^T S^-1 t)``: to second order the median of a quadratic form of
normal variables under the condition that its linear part vanishes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from bgars.inspection.bundle_model import tangents
from bgars.inspection.shadow_model import Balls, Lights, light_derivatives, rays

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.shadow_edges import Edges
    from bgars.inspection.shadow_model import Rays

__all__ = ["SHARP_PX", "EdgeSpread", "fit_spread", "lamp_gradients", "lamp_shift_px"]

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
MIN_STRETCHES = 20
"""Stretches of edge that tell their spread by lamp and lens."""
NUDGE_RAD = 0.02
"""Turn of the light for second differences: small against the angles in which a shadow's shape changes."""


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


def lamp_shift_px(
    x: Array, y: Array, balls: Balls, vectors: Array, near: bool, board: Board, spread: EdgeSpread
) -> Array:
    """(N, L, S) how far outside the measured edge, where half of the lamp is seen, that of the lamp's middle lies."""
    wide, high = spread.lamp_azimuth_rad, spread.lamp_elevation_rad
    lights = Lights.from_table(vectors, near).spread(1, 1)
    beam = rays(x, y, balls, lights, board)
    along, up = lamp_gradients(beam, balls, vectors)
    steep = np.maximum(np.hypot(along, up), 1e-9)
    turn_along, turn_up = -up / steep, along / steep
    ways = tangents(vectors)
    slope = np.maximum(beam.slope, 1e-3)
    second: Array = np.zeros(steep.shape)
    for sign in (-1.0, 1.0):
        way = (
            sign
            * NUDGE_RAD
            * (turn_along[..., None] * ways[None, :, None, 0] + turn_up[..., None] * ways[None, :, None, 1])
        )
        moved = vectors[None, :, None, :] + way
        moved *= (np.linalg.norm(vectors, axis=1)[None, :, None] / np.linalg.norm(moved, axis=-1))[..., None]
        lamp_x, lamp_y, lamp_z = np.moveaxis(moved, -1, 0)
        second = second + rays(x, y, balls, Lights(lamp_x, lamp_y, lamp_z, near), board).distance
    bend = (second - 2.0 * beam.distance) / (NUDGE_RAD**2 * slope)
    least = 1e-12
    # With t across g: 1 / (t_a^2 / wide^2 + t_e^2 / high^2), t = (-g_e, g_a) / |g|.
    variance = 1.0 / (turn_along**2 / max(wide**2, least) + turn_up**2 / max(high**2, least))
    shift: Array = 0.5 * bend * variance
    return shift


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
        part = nnls(columns * weight[:, None], (spread - floor) * weight)[0] / size
        residual = spread - floor - (columns * size) @ part
        scale = max(1.4826 * float(np.median(np.abs(residual / u))), 0.1)
        weight = 1.0 / (u * np.sqrt(1.0 + (residual / (CAUCHY * scale * u)) ** 2))
    by_lamp = part[1] * along + part[2] * up
    round_lamp = float((weight**2 * way * by_lamp).sum() / max(float((weight**2 * way * way).sum()), 1e-30))
    sharp, wide, high = np.sqrt([floor + part[0], part[1], part[2]])
    return EdgeSpread(float(sharp), float(np.sqrt(round_lamp)), float(wide), float(high))
