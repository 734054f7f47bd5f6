"""Slow plain twins of the kernels of shadows: whole arrays of all pixels near all edges, in numpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from bgars.inspection.board import Board
from bgars.inspection.edge_fit import Group, fit_stretches, group_sum
from bgars.inspection.radiance import Radiance
from bgars.inspection.shadow_edges import (
    WIDEST_RAD,
    EdgeSettings,
    Lines,
    edge_lines,
    stretches_of,
)
from bgars.inspection.shadow_map import ShadowMap
from bgars.inspection.shadow_model import Balls, Lights, Rays, edge_at, near_edge, rays
from bgars.inspection.spread import lamp_gradients
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]
Index = NDArray[np.intp]

MIN_LIGHTS_LIT = 2
LOWEST_TANGENT = 0.08
MAX_GROWTH = 0.3


def shadowed(x: Array, y: Array, ball: Balls, lamp: Lights, board: Board, margin_px: float) -> NDArray[np.bool_]:
    """Board points of a grid whose rays pass a ball closer than its radius and a margin."""
    if lamp.near:
        beam = rays(x, y, ball, lamp, board)
        return (beam.distance < ball.radius + margin_px) & (beam.along > 0.0)
    # The board as its tangent plane under the ball: a map has margins. Everything is linear in x or in y.
    slope_x, slope_y = (part / ball.q for part in board.slopes(ball.x, ball.y))
    to_z = lamp.z / ball.q
    length = np.sqrt(lamp.x**2 + lamp.y**2 + to_z**2)
    to_x, to_y, to_z = lamp.x / length, lamp.y / length, to_z / length
    across_x, across_y, down = x - ball.x, y - ball.y, ball.z / ball.q
    along = (across_x * (to_x + slope_x * to_z) - down * to_z) + across_y * (to_y + slope_y * to_z)
    square = np.square(across_x) + np.square(across_y) + np.square((slope_x * across_x - down) + slope_y * across_y)
    square -= along * along
    return (square < np.square(ball.radius + margin_px)) & (along < 0.0)


def slow_edges(
    radiance: Radiance,
    shadows: ShadowMap,
    table: Array,
    vectors: Array,
    near: bool,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    count: int,
) -> list[Array]:
    """(N, L, S) arrays in the order of the fields of `Edges`."""
    angles = (np.arange(count) + 0.5) / count * 2.0 * WIDEST_RAD - WIDEST_RAD
    balls, lights = Balls.from_table(table), Lights.from_table(vectors, near)
    sectors = stretches_of(len(angles), settings.reach_px / settings.stride_px)
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
    lines = edge_lines(angles, np.median(table, axis=0), vectors, near, board, settings)
    spread = np.sqrt(settings.spread_px**2 + (np.array(lines.lamp_spread_rad)[place] * way) ** 2)
    reach = np.array(lines.reach_px)[place]
    point = (edge.x[pick], edge.y[pick])
    pixels = _pixels(radiance, shadows, balls, board, gains, settings, here, point, ball, light, spread, reach)
    lit = _lit(pixels.distance, lines, light, place)
    sector = (ball * len(vectors) + light) * sectors + place * sectors // len(angles)
    solved = _solve(
        radiance,
        pixels,
        lit,
        sector,
        angles[place],
        way,
        spread,
        shape,
        wide_balls,
        wide_lights,
        vectors,
        board,
        settings,
    )
    return solved


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
    reach: Array,
) -> _Pixels:
    """Pixels across the edge at points (M,), on the row or column that crosses it more steeply."""
    row, col = np.rint(radiance.row(point[1])).astype(np.intp), np.rint(radiance.col(point[0])).astype(np.intp)
    steps = int(np.ceil(reach.max() / settings.stride_px))
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
    usable &= ~shadows.hidden.reshape(-1)[at] & (np.abs(distance) <= reach[None, :])
    texture = np.where(usable, total / np.maximum(weight_sum, 1e-9), 0.0).astype(np.float64)
    usable &= texture > 0
    weight = usable.astype(np.float64)
    return _Pixels(distance / spread[None, :], texture, np.where(usable, value, 0.0), weight)


def _lit(distance: Array, lines: Lines, light: Index, place: Index) -> tuple[Array, Array]:
    """Share of the light at pixels (O, M) and its growth per spread, by the cubic through the nodes of their line."""
    share, growth = np.zeros(distance.shape), np.zeros(distance.shape)
    if lines.coarse:
        return share, growth
    for which in set(zip(light.tolist(), place.tolist(), strict=True)):
        mine = (light == which[0]) & (place == which[1])
        limit, profile = lines.limit[which[1]], lines.profiles[which]
        curve = CubicHermiteSpline(np.linspace(-limit, limit, len(profile)), profile[:, 0], profile[:, 1])
        at = np.clip(distance[:, mine], -limit, limit)
        share[:, mine] = curve(at)
        growth[:, mine] = np.where(np.abs(distance[:, mine]) < limit, curve(at, 1), 0.0)
    return share, growth


def _solve(
    radiance: Radiance,
    pixels: _Pixels,
    profile: tuple[Array, Array],
    sector: Index,
    angle: Array,
    way: Array,
    spread: Array,
    shape: tuple[int, int, int],
    balls: Balls,
    lights: Lights,
    vectors: Array,
    board: Board,
    settings: EdgeSettings,
) -> list[Array]:
    """Least squares of every stretch; then its point."""
    size = shape[0] * shape[1] * shape[2]
    coarse_px, sharp_px = settings.reach_px if settings.coarse else None, settings.spread_px
    if coarse_px is None:
        lit = profile[0]
        bell = profile[1] / spread[None, :] * pixels.texture
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
    moved = fit.solution[:, 2].reshape(shape)
    shift = blurred + 0.5 * settings.spread_px**2 * curvature - np.where(measured, moved / safe, 0.0)
    along, up = lamp_gradients(beam, balls, vectors)
    bad = ~measured
    return [
        np.where(bad, 0.0, edge.x + shift * beam.gradient_x / beam.slope),
        np.where(bad, 0.0, edge.y + shift * beam.gradient_y / beam.slope),
        np.where(bad, 0.0, shift),
        np.where(bad, np.inf, fit.deviation[:, 2].reshape(shape) / safe),
        np.where(bad, np.nan, widened),
        u_widened,
        mean_way,
        along,
        up,
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
