r"""Where the edges of the shadows really are: short stretches of edge, each measured across.

Near the predicted edge of a shadow, at signed distance d, the board reads

    I = T [lo + (hi - lo) Phi(d / s)] + e,

T the board's own texture (mean of the lights that reach the pixel, each divided by its gain), s the spread of the edge
by pixel, lens and size of the lamp. A stretch of edge has its own lo and hi (light from neighbouring balls differs
along
the edge), and to first order a displacement a and a change b of the spread:

    I = lo T (1 - Phi) + hi T Phi - (hi - lo) [a T phi / s + b T (d / s) phi / s],

linear in four unknowns: least squares, then once more with Cauchy weights.

That holds for displacements below s. The coarse search goes by area: with H the unit step and r the reach,

    I = lo T (1 - H) + hi T H - (hi - lo) a T [|d| < r/2] / r

has the exact displacement a of any edge, sharp or blunt, that lies within r/2 (three unknowns; lit and dark, inside and
outside of r/2, have r/2 of pixels each).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from bgars.inspection.edge_fit import Group, fit_stretches, group_sum
from bgars.inspection.shadow_model import Balls, Lights, Rays, edge_at, near_edge, rays

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.radiance import Radiance
    from bgars.inspection.shadow_map import ShadowMap

__all__ = ["EdgeSettings", "Edges", "measure_edges"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SECTORS, FEWEST_SECTORS = 20, 4
WIDEST_RAD = np.radians(100.0)
LINE_SPACING_PX = 1.45
"""Distance of neighbouring lines along the edge: above sqrt(2), so that no two lines share a pixel."""
MAX_LINES = 96
FEW_LINES = 48
FEWEST_LINES = 12
LINES_A_STRETCH = 3
LINES_AT_ONCE = 6000
MIN_LIGHTS_LIT = 2
LOWEST_TANGENT = 0.08
"""Tangent points lower than this share of the radius are left out: there the ball meets the board."""
MAX_GROWTH = 0.3
INV_SQRT_2PI = 0.3989422804014327


class EdgeSettings(NamedTuple):
    """How edges are looked for.

    Spread of a sharp edge, growth of the spread along the ray, distance to look to on both sides, distance of pixels.
    `coarse`: by area instead, see the head of this file; finds edges up to half of `reach_px` away.
    `thorough`: more lines across the edges of large balls.
    """

    spread_px: float
    lamp_spread_rad: float
    reach_px: float
    stride_px: int = 1
    coarse: bool = False
    thorough: bool = False

    @property
    def coarse_px(self) -> float | None:
        """Reach where the search is coarse, else None."""
        return self.reach_px if self.coarse else None


@dataclass(frozen=True)
class Edges:
    """Stretches of shadow edges, arrays (N, L, S).

    Attributes
    ----------
    x, y : measured points, px
    shift_px : displacement against the prediction, outward
    u_px : standard uncertainty of the displacement; inf where nothing was measured
    spread_px, u_spread_px : measured spread of the edge
    way_px : way of the light from the tangent point to the board, over the slope of D: penumbra per radian of lamp
    low, high : shadow and lit level over the board's texture
    contrast_levels : high - low in grey levels of 255
    noise_levels : (N, L) residual of the fit in grey levels of 255
    looked_at : bool, True where enough board was seen on both sides of the predicted edge
    """

    x: Array
    y: Array
    shift_px: Array
    u_px: Array
    spread_px: Array
    u_spread_px: Array
    way_px: Array
    low: Array
    high: Array
    contrast_levels: Array
    noise_levels: Array
    looked_at: NDArray[np.bool_]

    def take(self, balls: NDArray[np.bool_]) -> Edges:
        """Some of the balls."""
        return Edges(*(getattr(self, part.name)[balls] for part in fields(self)))

    def lit_levels(self, otherwise: Array) -> Array:
        """(N, L) median lit level over the board's texture, `otherwise` where unknown: the gains as they really are."""
        known = np.isfinite(self.high)
        some: NDArray[np.bool_] = np.asarray(known.any(axis=2))
        high = np.where(some[:, :, None], self.high, 1.0)
        levels: Array = np.where(some, np.nanmedian(high, axis=2), otherwise)
        return np.where(levels > 0, levels, otherwise)


def measure_edges(
    radiance: Radiance,
    shadows: ShadowMap,
    table: Array,
    vectors: Array,
    near: bool,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    threads: int,
) -> Edges:
    """Measure the edges of the shadows of all balls under all lights.

    Parameters
    ----------
    radiance, shadows
        The images, and what is hidden or shadowed where.
    table : (N, 5) float64
        Predicted balls.
    vectors : (L, 3) float64
        Lights.
    near : bool
        Whether they are positions.
    board : Board
    gains : (N, L) float64
        Irradiance of the board around each ball under each light, relative.
    settings : EdgeSettings
    threads : int
    """
    radius = float(np.median(table[:, 3]))
    most = MAX_LINES if settings.thorough else FEW_LINES
    count = int(np.clip(2.0 * WIDEST_RAD * radius / LINE_SPACING_PX, FEWEST_LINES, most))
    angles = (np.arange(count) + 0.5) / count * 2.0 * WIDEST_RAD - WIDEST_RAD
    step = max(1, LINES_AT_ONCE // (len(vectors) * count))
    parts = [slice(first, first + step) for first in range(0, len(table), step)]

    def work(part: slice) -> list[Array]:
        return _measure(radiance, shadows, table[part], vectors, near, board, gains[part], settings, angles)

    with ThreadPoolExecutor(threads) as pool:
        pieces = list(pool.map(work, parts))
    return Edges(*(np.concatenate(piece) for piece in zip(*pieces, strict=True)))


def _measure(
    radiance: Radiance,
    shadows: ShadowMap,
    table: Array,
    vectors: Array,
    near: bool,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    angles: Array,
) -> list[Array]:
    """The same for some of the balls."""
    balls, lights = Balls.from_table(table), Lights.from_table(vectors, near)
    sectors = int(np.clip(len(angles) // LINES_A_STRETCH, FEWEST_SECTORS, SECTORS))
    shape = (len(table), len(vectors), sectors)
    wide_balls, wide_lights = balls.spread(2), lights.spread(1, 1)
    edge = edge_at(angles[None, None, :], wide_balls, wide_lights, board)
    beam = rays(edge.x, edge.y, wide_balls, wide_lights, board)
    row, col = np.rint(radiance.row(edge.y)).astype(np.intp), np.rint(radiance.col(edge.x)).astype(np.intp)
    inside = (row >= 0) & (row < radiance.height) & (col >= 0) & (col < radiance.width)
    keep = inside & (edge.tangent_height > LOWEST_TANGENT * wide_balls.radius) & (beam.along > 0)
    ball, light, place = np.nonzero(keep)
    row, col = row[keep], col[keep]
    hidden = shadows.hidden.reshape(-1)[shadows.pixels(row, col)]
    ball, light, place = ball[~hidden], light[~hidden], place[~hidden]
    pick = (ball, light, place)
    here = Rays(*(np.broadcast_to(part, keep.shape)[pick] for part in beam))
    way = here.along / here.slope
    spread = np.sqrt(settings.spread_px**2 + (settings.lamp_spread_rad * way) ** 2)
    point = (edge.x[pick], edge.y[pick])
    pixels = _pixels(radiance, shadows, balls, board, gains, settings, here, point, ball, light, spread)
    sector = (ball * len(vectors) + light) * sectors + place * sectors // len(angles)
    return _solve(radiance, pixels, sector, angles[place], way, spread, shape, wide_balls, wide_lights, board, settings)


class _Pixels(NamedTuple):
    """Pixels on lines across the edge, (O, M): signed distance over the spread, texture, value, weight."""

    distance: Array
    texture: Array
    value: Array
    weight: Array


def _pixels(
    radiance: Radiance,
    shadows: ShadowMap,
    balls: Balls,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    beam: Rays,
    point: tuple[Array, Array],
    ball: Index,
    light: Index,
    spread: Array,
) -> _Pixels:
    """Pixels across the edge at points (M,), on the row or column that crosses it more steeply."""
    row, col = np.rint(radiance.row(point[1])).astype(np.intp), np.rint(radiance.col(point[0])).astype(np.intp)
    steps = int(np.ceil(settings.reach_px / settings.stride_px))
    offsets = (np.arange(-steps, steps + 1) * settings.stride_px)[:, None]
    along_cols = np.abs(beam.gradient_x) >= np.abs(beam.gradient_y)
    rows = row[None, :] + np.where(along_cols[None, :], 0, offsets)
    cols = col[None, :] + np.where(along_cols[None, :], offsets, 0)
    usable = (rows >= 0) & (rows < radiance.height) & (cols >= 0) & (cols < radiance.width)
    rows, cols = np.clip(rows, 0, radiance.height - 1), np.clip(cols, 0, radiance.width - 1)
    around = near_edge(beam, *point, balls.take(ball), board)
    distance = around.distance(radiance.x(cols) - point[0], radiance.y(rows) - point[1])
    at = shadows.pixels(rows, cols)
    counts = np.take(shadows.count.reshape(len(shadows.count), -1), at, axis=1)
    values = radiance.at(rows * radiance.width + cols)
    line = (light[None, :], np.arange(len(rows))[:, None], np.arange(len(ball))[None, :])
    value = values[line].astype(np.float64)
    lit = counts == 0
    if np.isfinite(radiance.capture.saturation) or radiance.masked:
        lit &= np.isfinite(values)
        values[~lit] = 0.0
    else:
        values *= lit
    total = values.sum(axis=0)
    weight_sum = np.einsum("lom,lm->om", lit, gains[ball].T.astype(np.float32))
    usable &= (lit.sum(axis=0, dtype=np.uint8) >= MIN_LIGHTS_LIT) & (counts[line] <= 1) & np.isfinite(value)
    usable &= ~shadows.hidden.reshape(-1)[at] & (np.abs(distance) <= settings.reach_px)
    texture = np.where(usable, total / np.maximum(weight_sum, 1e-9), 0.0).astype(np.float64)
    usable &= texture > 0
    weight = usable.astype(np.float64)
    return _Pixels(distance / spread[None, :], texture, np.where(usable, value, 0.0), weight)


def _solve(
    radiance: Radiance,
    pixels: _Pixels,
    sector: Index,
    angle: Array,
    way: Array,
    spread: Array,
    shape: tuple[int, int, int],
    balls: Balls,
    lights: Lights,
    board: Board,
    settings: EdgeSettings,
) -> list[Array]:
    """Least squares of every stretch; then its point."""
    size = shape[0] * shape[1] * shape[2]
    coarse_px, sharp_px = settings.coarse_px, settings.spread_px
    if coarse_px is None:
        lit = ndtr(pixels.distance)
        bell = INV_SQRT_2PI * np.exp(-0.5 * pixels.distance**2) / spread[None, :] * pixels.texture
        columns = [pixels.texture * (1.0 - lit), pixels.texture * lit, bell, bell * pixels.distance]
    else:
        lit = (pixels.distance >= 0.0).astype(np.float64)
        bell = (np.abs(pixels.distance * spread[None, :]) < 0.5 * coarse_px) / coarse_px * pixels.texture
        columns = [pixels.texture * (1.0 - lit), pixels.texture * lit, bell]
    group = Group(sector, size, shape[2])
    fit = fit_stretches(columns, pixels.value, pixels.weight, group, robust=coarse_px is None)
    contrast = (fit.solution[:, 1] - fit.solution[:, 0]).reshape(shape)
    pixel_sum = np.maximum(group_sum(fit.weight.sum(axis=0), sector, size), 1e-9)
    texture = (group_sum((fit.weight * pixels.texture).sum(axis=0), sector, size) / pixel_sum).reshape(shape)
    per_line = (fit.weight * bell**2).sum(axis=0)
    information = group_sum(per_line, sector, size)
    measured = fit.measured.reshape(shape) & (contrast > 0) & (information.reshape(shape) > 0)
    safe = np.where(measured, contrast, 1.0)
    mass = np.maximum(information, 1e-30)
    mean_angle, mean_way, mean_spread = (
        (group_sum(per_line * part, sector, size) / mass).reshape(shape) for part in (angle, way, spread)
    )
    edge = edge_at(mean_angle, balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    if coarse_px is None:
        widened = mean_spread - np.where(measured, fit.solution[:, 3].reshape(shape) / safe, 0.0)
        u_widened = np.where(measured, fit.deviation[:, 3].reshape(shape) / safe, np.inf)
    else:
        widened, u_widened = mean_spread, np.full(shape, np.inf)
    # A blurred convex shadow looks smaller than it is, by half of the squared spread times the curvature of its edge.
    tangent_along = (beam.toward_y * beam.gradient_x - beam.toward_x * beam.gradient_y) / beam.slope
    curvature = (1.0 - tangent_along**2) / (beam.distance * beam.slope)
    # And texture that grows outward by g a pixel, blurred with the shadow, moves its edge inward by g s^2.
    blurred = (
        0.0 if coarse_px is not None else sharp_px**2 * _texture_growth(pixels, spread, sector, size).reshape(shape)
    )
    shift = (
        blurred + 0.5 * mean_spread**2 * curvature - np.where(measured, fit.solution[:, 2].reshape(shape) / safe, 0.0)
    )
    bad = ~measured
    return [
        np.where(bad, 0.0, edge.x + shift * beam.gradient_x / beam.slope),
        np.where(bad, 0.0, edge.y + shift * beam.gradient_y / beam.slope),
        np.where(bad, 0.0, shift),
        np.where(bad, np.inf, fit.deviation[:, 2].reshape(shape) / safe),
        np.where(bad, np.nan, widened),
        u_widened,
        mean_way,
        np.where(bad, np.nan, fit.solution[:, 0].reshape(shape)),
        np.where(bad, np.nan, fit.solution[:, 1].reshape(shape)),
        np.where(bad, np.nan, contrast * texture / radiance.scale),
        fit.noise.reshape(shape[:2]) / radiance.scale,
        fit.measured.reshape(shape),
    ]


def _texture_growth(pixels: _Pixels, spread: Array, sector: Index, size: int) -> Array:
    """Relative growth of the board's texture per pixel across the edge, outward, for each stretch."""
    near = pixels.weight * np.exp(-0.5 * np.square(pixels.distance / 2.0))
    across = pixels.distance * spread[None, :]
    total, first, level, second, mixed = (
        group_sum(part.sum(axis=0), sector, size)
        for part in (near, near * across, near * pixels.texture, near * across**2, near * across * pixels.texture)
    )
    total = np.maximum(total, 1e-9)
    variance = second - first**2 / total
    growth = (mixed - first * level / total) / np.maximum(variance, 1e-9)
    relative: Array = np.where((variance > 0) & (level > 0), growth * total / np.maximum(level, 1e-9), 0.0)
    return np.clip(relative, -MAX_GROWTH, MAX_GROWTH)
