"""A first height for every ball: where predicted shadow edges are darkest inside and brightest outside."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.radiance import Radiance

__all__ = ["edge_steps", "first_heights", "radius_at"]

Array = NDArray[np.float64]

HEIGHTS = np.linspace(-0.6, 1.15, 36)
"""Heights of the centre that are tried, in radii of the outline; below 0 the outline is the foot of a cap."""
CAP_MARGIN = 0.1
"""Step of brightness that speaks for a cap: balls are the rule, and little of a cap's shadow is seen."""
ANGLES = np.radians(np.linspace(-60.0, 60.0, 13))
BESIDE = 0.09
"""Points inside and outside lie this share of the radius off the edge."""
CLIP = (-0.5, 1.0)
"""Bounds of a step of brightness, over the board: one bright speck counts no more."""
DARK = 0.5
"""Board darker than this share of its mean over the lights is in a shadow."""
MIN_POINTS = 3
"""Points of an edge that must be seen."""
USUAL_HEIGHT = 2.0 / 3.0
"""Height of the centre, in radii, where no ball shows its own."""
WEAK_STEP = 0.08
"""Step below which a ball shows no height of its own."""
TOP_SHARE = 0.7
"""Of the best score, what still belongs to the top whose middle is taken."""


def edge_steps(
    radiance: Radiance,
    balls: Balls,
    lights: Lights,
    images: NDArray[np.intp],
    hidden: Balls,
    board: Board,
    gains: Array,
) -> Array:
    """Mean relative step of brightness from inside to outside of predicted edges, clipped; NaN where nothing is seen.

    Parameters
    ----------
    radiance : Radiance
    balls, lights : Balls, Lights
        Predictions; arrays that broadcast with each other, without an axis for the points on the edge.
    images : ndarray of int
        Which image each prediction is looked for in; broadcasts, too.
    hidden : Balls
        (N,) all balls, whose silhouettes hide the board.
    board : Board
    gains : (L,) float64
        Relative irradiance of the board under each light.
    """
    balls, lights = balls.spread(1), Lights(lights.x[..., None], lights.y[..., None], lights.z[..., None], lights.near)
    edge = edge_at(ANGLES, balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    off = np.maximum(BESIDE * balls.radius, 1.5) / beam.slope
    out_x, out_y = beam.gradient_x * off, beam.gradient_y * off
    # Both sides at once, inside first.
    side = np.array([-1.0, 1.0]).reshape(-1, *[1] * out_x.ndim)
    x, y = edge.x + side * out_x, edge.y + side * out_y
    row, col = np.rint(radiance.row(y)).astype(np.intp), np.rint(radiance.col(x)).astype(np.intp)
    seen = (row >= 0) & (row < radiance.height) & (col >= 0) & (col < radiance.width) & (edge.tangent_height > 0)
    row, col = np.clip(row, 0, radiance.height - 1), np.clip(col, 0, radiance.width - 1)
    values = radiance.at(row * radiance.width + col) / gains.astype(np.float32).reshape(-1, *[1] * row.ndim)
    texture = np.nan_to_num(values).mean(axis=0)
    image = np.broadcast_to(images[..., None], row.shape)
    own = np.take_along_axis(values, image[None], axis=0)[0]
    seen &= np.isfinite(own) & (texture > 0)
    reach = hidden.radius + 2.0
    near = (hidden.x > x.min() - reach) & (hidden.x < x.max() + reach)
    near &= (hidden.y > y.min() - reach) & (hidden.y < y.max() + reach)
    for index in np.flatnonzero(near):
        seen &= np.square(x - hidden.x[index]) + np.square(y - hidden.y[index]) > reach[index] ** 2
    sides = np.where(seen, own / np.where(texture > 0, texture, 1.0), np.nan)
    # Dark on both sides: the shadow of a neighbour, which says nothing.
    dark = (sides[0] < DARK) & (sides[1] < DARK)
    step = np.where(dark, np.nan, np.clip(sides[1] - sides[0], *CLIP))
    known = np.isfinite(step)
    points = known.sum(axis=-1)
    mean: Array = np.where(
        points >= MIN_POINTS, np.where(known, step, 0.0).sum(axis=-1) / np.maximum(points, 1), np.nan
    )
    return mean


def first_heights(
    radiance: Radiance,
    table: Array,
    vectors: Array,
    near: bool,
    board: Board,
    gains: Array,
    neighbours: list[Array],
    threads: int,
) -> tuple[Array, Array]:
    """(N,) heights of the centres, and (N, L) the step of brightness under each light there (NaN: not seen).

    Parameters
    ----------
    radiance : Radiance
    table : (N, 5) float64
        Balls as spheres, any height.
    vectors, near : (L, 3), bool
        Lights.
    board : Board
    gains : (L,) float64
    neighbours : list of (m, 5) float64
        Per ball, the balls (itself too) that may hide the board around it.
    threads : int
    """
    heights, steps = np.zeros(len(table)), np.full((len(table), len(vectors)), np.nan)
    seen = np.full((len(table), len(HEIGHTS), len(vectors)), np.nan)
    lights = Lights.from_table(vectors, near).spread(1, 0)
    images = np.arange(len(vectors))[None, :]
    scores = np.zeros((len(table), len(HEIGHTS)))

    def look(index: int) -> None:
        row = table[index]
        tried = np.repeat(row[None, :], len(HEIGHTS), axis=0)
        tried[:, 2] = HEIGHTS * row[3]
        tried[:, 3] = radius_at(tried[:, 2], row[3])
        step = edge_steps(
            radiance,
            Balls.from_table(tried).spread(1),
            lights,
            images,
            Balls.from_table(neighbours[index]),
            board,
            gains,
        )
        seen[index] = step
        known = np.isfinite(step)
        scores[index] = np.where(known, step, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 3.0)
        scores[index] -= np.where(HEIGHTS < 0.0, CAP_MARGIN, 0.0)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(look, range(len(table))))
    usual = np.median(scores, axis=0)
    common = _middle(usual) if usual.max() >= WEAK_STEP else USUAL_HEIGHT
    for index, row in enumerate(table):
        height = _middle(scores[index]) if scores[index].max() >= WEAK_STEP else common
        heights[index] = height * row[3]
        steps[index] = seen[index, int(np.argmin(np.abs(HEIGHTS - height)))]
    return heights, steps


def radius_at(height: Array, outline: Array | float) -> Array:
    """Radius of a sphere by the height of its centre and its outline: that of a cap is its foot."""
    radius: Array = np.hypot(outline, np.minimum(height, 0.0))
    return radius


def _middle(score: Array) -> float:
    """Where a score that is flat at the top has its middle, in radii."""
    best = int(np.argmax(score))
    over = np.maximum(score - TOP_SHARE * score[best], 0.0)
    first, last = best, best
    while first > 0 and over[first - 1] > 0:
        first -= 1
    while last + 1 < len(score) and over[last + 1] > 0:
        last += 1
    part = slice(first, last + 1)
    return float(np.average(HEIGHTS[part], weights=over[part])) if over[best] > 0 else float(HEIGHTS[best])
