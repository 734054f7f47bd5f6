r"""How the board brightens across the edge of a shadow: pixel, lens, and a lamp of some extent, seen past a round ball.

A board point sees the part of the lamp that the ball does not hide. With the lamp as parts k of weight w_k, n the
board's normal and d_k the signed distance of the point to the edge of the shadow of part k, the share of the light is

    F = sum_k w_k (n . l_k) S(d_k) / sum_k w_k (n . l_k),

S a step, blurred by the lens (Gaussian) and the pixel (a square, seen along the normal of the edge: a trapezoid). The
edge is thus not where the middle of the lamp has its edge: a ball is round and hides less than half of a wide lamp
there, and a part of the lamp that stands higher brings more light.

A lamp is a piece of a ring about the camera's axis, as wide as its `azimuth` and as high as its `elevation` say, and
fades towards its rim (density ``1 - r^2`` along both): between a sharp-edged diffuser and a Gaussian.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.normal_distribution import normal_distribution
from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays
from bgars.inspection.spread import lamp_gradients

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.shadow_model import Edge, Rays
    from bgars.inspection.spread import EdgeSpread

__all__ = ["NODES", "WIDEST_RAD", "Lamp", "edge_bends_px", "edge_profiles", "pixel_step"]

Array = NDArray[np.float64]

NODES = 33
"""Places across an edge where its profile is known; cubic between them."""
WIDE_PARTS, HIGH_PARTS = 5, 3
"""Parts of a lamp, each with the same share of its light: a few LEDs in a few rows behind a diffuser."""
POINT_PX = 0.005
"""Lamps that shift no edge by more, to second order, are points whose light is blurred."""
LEAST_LENS_PX = 0.05
PIXEL_VARIANCE = 1.0 / 12.0
THINNEST = 0.02
"""Least width of a pixel's square across an edge, in pixels: beyond it, the trapezoid is a box to 1e-4."""
LEAST_COSINE = 0.2
"""Lamps closer to the axis than this are not pieces of a ring."""
WIDEST_RAD = np.radians(100.0)
"""Half of the arc of a shadow, from its tip, that is looked at: beyond, the ball hides it."""
ANGLES, WAVES = 40, 4
"""Places along an edge that its bends are known at, and cosines along it: one for each common term of edges."""


class Lamp(NamedTuple):
    """Standard deviations of a lamp along the azimuth and up, radians on the sphere."""

    azimuth_rad: float
    elevation_rad: float


def edge_profiles(
    edge: Edge, beam: Rays, ball: Balls, vectors: Array, near: bool, board: Board, lens_px: float, lamp: Lamp, at: Array
) -> tuple[Array, Array]:
    """Share of the light and its growth per pixel, (L, S, NODES) each, across the edges of one ball.

    Parameters
    ----------
    edge, beam : (1, L, S)
        Points of the edges and their rays.
    ball : Balls
        Of shape (1, 1, 1).
    vectors : (L, 3) float64
    near : bool
    board : Board
    lens_px : float
        Standard deviation of an edge's blur by lens and pixel together.
    lamp : Lamp
    at : (L, S, NODES) float64
        Distances to the edges, outward, px.
    """
    slope = np.maximum(beam.slope[0], 1e-3)
    across_x, across_y = beam.gradient_x[0] / slope, beam.gradient_y[0] / slope
    x = edge.x[0][..., None] + at * across_x[..., None]
    y = edge.y[0][..., None] + at * across_y[..., None]
    parts, weight, within = _parts(vectors, lamp)
    penumbra = _penumbra_variance(beam, ball, vectors, lamp)[0][..., None]
    if float(penumbra.max()) < 2.0 * POINT_PX * float(ball.radius.max()):
        parts, weight, within = vectors[None], np.ones((1, len(vectors))), 1.0
    blur = np.sqrt(max(lens_px**2 - PIXEL_VARIANCE, LEAST_LENS_PX**2) + within * penumbra)
    share, growth = np.zeros(at.shape), np.zeros(at.shape)
    for part, light in zip(parts, weight, strict=True):
        seen = rays(x, y, ball, Lights.from_table(part, near).spread(0, 2), board)
        distance = (seen.distance - ball.radius) / np.maximum(seen.slope, 1e-3)
        lit, steep = pixel_step(distance, blur, across_x[..., None], across_y[..., None])
        share += light[:, None, None] * lit
        growth += light[:, None, None] * steep
    return share, growth


def edge_bends_px(ball: Array, vectors: Array, near: bool, board: Board, spread: EdgeSpread) -> Array:
    """(WAVES,) blur of a ball's shadow edges, squared, times their curvature: sizes of its cosines cos k a along them.

    a is the angle from the tip; mean over all lights. A low light draws the shadow out, and its tip becomes both the
    bluntest and the most curved part of the edge.

    Parameters
    ----------
    ball : (5,) float64
        x, y, z, radius, q.
    vectors, near, board
        Lights, whether they are positions, and what the shadows lie on.
    spread : EdgeSpread
        Of edges, by lens and lamp.
    """
    angles_rad = (np.arange(ANGLES) + 0.5) / ANGLES * 2.0 * WIDEST_RAD - WIDEST_RAD
    balls, lights = Balls.from_table(ball[None]).spread(2), Lights.from_table(vectors, near).spread(1, 1)
    edge = edge_at(angles_rad, balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    lamp = Lamp(spread.lamp_azimuth_rad, spread.lamp_elevation_rad)
    bends_px = (spread.sharp_px**2 + _penumbra_variance(beam, balls, vectors, lamp)) * beam.curvature
    order = np.arange(WAVES)
    sizes: Array = np.abs(np.cos(order[:, None] * angles_rad) @ bends_px.mean(axis=(0, 1))) / ANGLES
    return np.where(order > 0, 2.0, 1.0) * sizes


def pixel_step(distance: Array, blur: Array, across_x: Array, across_y: Array) -> tuple[Array, Array]:
    """A step at 0, blurred by a Gaussian and by a pixel's square: its value and slope at signed distances."""
    wide, thin = np.maximum(np.abs(across_x), THINNEST), np.maximum(np.abs(across_y), THINNEST)
    value, slope = np.zeros(distance.shape), np.zeros(distance.shape)
    for sign, offset in ((1.0, wide + thin), (-1.0, wide - thin), (-1.0, thin - wide), (1.0, -wide - thin)):
        place = distance + 0.5 * offset
        scaled = place / blur
        below, density = normal_distribution(scaled), np.exp(-0.5 * scaled * scaled) / np.sqrt(2.0 * np.pi)
        # First and second integral of the normal distribution function.
        slope += sign * (place * below + blur * density)
        value += sign * 0.5 * ((place * place + blur * blur) * below + place * blur * density)
    return value / (wide * thin), slope / (wide * thin)


def _parts(vectors: Array, lamp: Lamp) -> tuple[Array, Array, float]:
    """Parts of lamps (K, L, 3), shares of the light they bring to a level board (K, L), variance within a part."""
    across, within = _equal_parts(WIDE_PARTS)
    upward, within_high = _equal_parts(HIGH_PARTS)
    level = np.hypot(vectors[:, 0], vectors[:, 1])
    length = np.linalg.norm(vectors, axis=1)
    azimuth, elevation = np.arctan2(vectors[:, 1], vectors[:, 0]), np.arctan2(vectors[:, 2], level)
    turn = lamp.azimuth_rad / np.maximum(level / length, LEAST_COSINE)
    turned = azimuth + np.repeat(across, HIGH_PARTS)[:, None] * turn
    raised = elevation + np.tile(upward, WIDE_PARTS)[:, None] * lamp.elevation_rad
    parts = np.stack([np.cos(raised) * np.cos(turned), np.cos(raised) * np.sin(turned), np.sin(raised)], axis=-1)
    weight = np.maximum(parts[..., 2], 0.0)
    return parts * length[:, None], weight / weight.sum(axis=0), max(within, within_high)


def _equal_parts(count: int) -> tuple[Array, float]:
    """Middles of parts of equal light, in standard deviations of the density ``1 - r^2``, and their own variance."""
    fine = (np.arange(2000) + 0.5) / 1000.0 - 1.0
    density = 1.0 - fine**2
    share = np.cumsum(density) / density.sum()
    part = np.minimum((share * count).astype(np.intp), count - 1)
    middle = np.bincount(part, fine * density) / np.bincount(part, density)
    total = float((density * fine**2).sum() / density.sum())
    middle_variance = float((middle**2).mean())
    return middle / np.sqrt(total), 1.0 - middle_variance / total


def _penumbra_variance(beam: Rays, ball: Balls, vectors: Array, lamp: Lamp) -> Array:
    """(1, L, S) variance of an edge's blur by the lamp, px^2."""
    along, up = lamp_gradients(beam, ball, vectors)
    variance: Array = np.square(along * lamp.azimuth_rad) + np.square(up * lamp.elevation_rad)
    return variance
