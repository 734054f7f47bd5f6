"""Circles from highlights: light k shines back from c + R h_k, whatever the silhouette looks like."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels
    from bgars.records.pixels import FloatArray

    Array = NDArray[np.float64]

__all__ = ["MIN_CONTRAST", "HighlightCircles", "half_vectors", "highlight_circles", "mirrors_lights"]

WINDOW = 0.25
"""Half width of the taper that a highlight is centred in, in radii."""
SEARCH = 0.45
SMALLEST_WINDOW_PX = 2.5
"""Half width of the taper on small balls."""
PASSES = 3
SHIFTS = 8
ROUNDS = 6
MOST_PIXELS = 225
MIN_CONTRAST = 4.0
"""Grey levels of 255 of the highlight above its surroundings."""
MIN_RATIO = 0.5
"""The same, of the surroundings."""
MIN_HIGHLIGHTS = 3
"""Three fix the circle of a ball: two coordinates and a radius."""
TOLERANCE, TOLERANCE_PX = 0.015, 0.2
"""Distance of a highlight from its place that quarters its weight: in radii, and in pixels, whose noise it holds."""
MAX_RMS = 0.03
"""Of highlights around their places, in radii, that still are those of one sphere."""
POOL_BALLS = 6
"""Balls whose median tells where the highlight of a light lies off its half vector."""
MIN_DISC_PIXELS, MIRROR_SPOT = 30, 0.05
"""Least pixels of a disc, and most of them, as a share, that the mirror image of a light covers."""
MIRRORED = 0.12
"""Largest distance, in radii, of a mirrored light from where a sphere would show it; of three lights in four."""
NOISE = 0.001
"""Least standard deviation of a highlight's place, in radii: facets and pixels."""


class HighlightCircles(NamedTuple):
    """Circles that explain where the highlights are, N each, NaN where highlights are too few or in disorder.

    The radius is that of the lobe's peak, off by a percent or two, alike for all balls of a material.
    """

    row: Array
    col: Array
    radius_px: Array
    u_centre_px: Array
    u_radius_px: Array


def highlight_circles(levels: Levels, row: Array, col: Array, radius_px: Array) -> HighlightCircles:
    """Centre and radius of each ball from the places of its highlights.

    A smooth surface shines where its normal is the half vector h of light and view (Torrance and Sparrow 1967): at
    c + R h_xy on a sphere. Half vectors spread little, so centres come out well and radii relative to each other.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        Circles to start from, good to a third of the radius.
    """
    half = half_vectors(levels, row, col)
    row, col, radius_px = row + 0.0, col + 0.0, radius_px + 0.0
    start_px = radius_px.copy()
    rms = np.full(len(row), np.inf)
    cover = np.tile(np.eye(3), (len(row), 1, 1))
    for _ in range(PASSES):
        x, y, good = _peaks(levels, row, col, radius_px, half)
        if not (good.sum(axis=1) >= MIN_HIGHLIGHTS).any():
            return HighlightCircles(*np.full((5, len(row)), np.nan))
        x, y = x - col[:, None], row[:, None] - y
        offset = np.zeros_like(half[0])
        for turn in range(2):
            step, rms, cover = _fit(x, y, good, half + offset, start_px)
            if turn == 0 and len(row) >= POOL_BALLS:
                offset = _common_offset(x, y, good, half, step)
        found = rms < MAX_RMS
        found &= (step[:, 2] > 0.6 * start_px) & (step[:, 2] < 1.6 * start_px)
        found &= np.hypot(step[:, 0], step[:, 1]) < 0.35 * start_px
        col = np.where(found, col + step[:, 0], col)
        row = np.where(found, row - step[:, 1], row)
        radius_px = np.where(found, step[:, 2], radius_px)
    sigma = np.hypot(rms, NOISE) * radius_px
    nothing = np.where(found, 0.0, np.nan)
    return HighlightCircles(
        row + nothing,
        col + nothing,
        radius_px + nothing,
        sigma * np.sqrt((cover[:, 0, 0] + cover[:, 1, 1]) / 2) + nothing,
        sigma * np.sqrt(cover[:, 2, 2]) + nothing,
    )


def mirrors_lights(reduced: FloatArray, directions: Array, row: float, col: float, radius_px: float) -> bool:
    """Whether the brightest spot in a disc is where a sphere would mirror each light.

    Parameters
    ----------
    reduced : (L, H, W) float32
        Linear grey levels.
    directions : (L, 3) float64
        Unit vectors toward the lights.
    row, col, radius_px : float
        The disc, in pixels of `reduced`.
    """
    middle: Array = directions + np.array([0.0, 0.0, 1.0])
    half = middle[:, :2] / np.linalg.norm(middle, axis=1)[:, None]
    rows, cols = np.mgrid[: reduced.shape[1], : reduced.shape[2]]
    x: Array = (cols - col) / radius_px
    y: Array = (row - rows) / radius_px
    inside = x * x + y * y < 0.9  # noqa: PLR2004 - off the rim
    if inside.sum() < MIN_DISC_PIXELS:
        return False
    shown: FloatArray = reduced[:, inside]
    x, y = x[inside], y[inside]
    peak = shown.max(axis=1)
    bright = shown >= 0.7 * peak[:, None]
    place = np.stack([(bright * axis).sum(axis=1) / bright.sum(axis=1) for axis in (x, y)], axis=1)
    away = place - half
    near = np.hypot(away[:, 0], away[:, 1]) < MIRRORED
    # A small spot on a dark ball: a matte ball is bright over a large part of it.
    spot = (bright.mean(axis=1) < MIRROR_SPOT) & (peak > MIN_CONTRAST)
    return bool((near & spot).mean() >= 0.75)  # noqa: PLR2004 - a highlight may be hidden or clipped


def half_vectors(levels: Levels, row: Array, col: Array) -> Array:
    """(N, L, 2) components x and y of the half vectors at each ball, view along z."""
    rig, pixel_um = levels.capture.rig, levels.capture.pixel_pitch_um
    if rig.positions_um is not None and pixel_um is not None:
        x_um = (col + 0.5 - levels.width / 2) * pixel_um
        y_um = (levels.height / 2 - row - 0.5) * pixel_um
        place = np.stack([x_um, y_um, np.zeros_like(x_um)], axis=1)
        light = rig.positions_um[None] - place[:, None]
        light = light / np.linalg.norm(light, axis=2, keepdims=True)
    else:
        light = np.broadcast_to(rig.directions, (len(row), *rig.directions.shape))
    half = light + np.array([0.0, 0.0, 1.0])
    unit: Array = (half / np.linalg.norm(half, axis=2, keepdims=True))[..., :2]
    return unit


def _peaks(
    levels: Levels, row: Array, col: Array, radius_px: Array, half: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(N, L) columns and rows of the highlights, and whether there is one, by mean shift of what stands out."""
    largest = float(np.median(radius_px))
    every = max(1, round(math.sqrt(4 * (SEARCH * largest) ** 2 / MOST_PIXELS)))
    reach = max(math.ceil(SEARCH * largest / every), 2)
    span = np.arange(-reach, reach + 1) * every
    middle_col = np.rint(col[:, None] + radius_px[:, None] * half[..., 0]).astype(np.int64)
    middle_row = np.rint(row[:, None] - radius_px[:, None] * half[..., 1]).astype(np.int64)
    c, r = middle_col[..., None] + span, middle_row[..., None] + span
    inside = ((r >= 0) & (r < levels.height))[..., :, None] & ((c >= 0) & (c < levels.width))[..., None, :]
    pixels = np.where(inside, (r * levels.width)[..., :, None] + c[..., None, :], 0)
    value = np.moveaxis(levels.of_lights(np.moveaxis(pixels, 1, 0)), 0, 1)
    reaches = (0.92 * radius_px[:, None, None]) ** 2
    aside, above = (c - col[:, None, None]) ** 2, (r - row[:, None, None]) ** 2
    inside &= aside[..., None, :] < (reaches - above)[..., :, None]
    flat = inside.reshape(*inside.shape[:2], -1)
    enough = flat.sum(axis=2) >= 0.4 * flat.shape[2]
    # Sorted, brightest first, pixels off the ball last.
    ranked = -np.sort(np.where(flat, -value.reshape(flat.shape), np.float32(np.inf)), axis=2)
    number = np.maximum(flat.sum(axis=2, keepdims=True), 1)
    base, high = (np.take_along_axis(ranked, (number * part).astype(np.int64), axis=2)[..., 0] for part in (0.5, 0.03))
    base, high = np.where(enough, base, np.float32(0.0)), np.where(enough, high, np.float32(0.0))
    good = enough & (high - base > MIN_CONTRAST) & (high - base > MIN_RATIO * base)
    size = (high - base)[..., None, None]
    shine = np.clip(value - (base[..., None, None] + np.float32(0.4) * size), 0.0, size) * inside
    x, y, total = _mean_shift(shine, span, np.maximum(WINDOW * radius_px, SMALLEST_WINDOW_PX))
    return middle_col + x, middle_row + y, good & (total > 1e-6)  # noqa: PLR2004 - nothing


def _mean_shift(shine: FloatArray, span: NDArray[np.int64], width_px: Array) -> tuple[Array, Array, FloatArray]:
    """(N, L) columns and rows of the middle of what shines, and how much does, within a taper that follows it.

    Parameters
    ----------
    shine : (N, L, S, S) float32
        Windows of light, in grey levels.
    span : (S,) int64
        Places of their rows and columns in pixels.
    width_px : (N,) float64
        Half width of the taper of each ball.
    """
    place, width = span.astype(np.float32), width_px.astype(np.float32)[:, None, None]
    # From the brightest region, not from where it is expected: the start may be off.
    taper = shine**2
    for turn in range(SHIFTS + 1):
        total = np.maximum(taper.sum(axis=(2, 3)), np.float32(1e-9))
        x, y = taper.sum(axis=2) @ place / total, taper.sum(axis=3) @ place / total
        if turn < SHIFTS:
            across, along = (((place - middle[..., None]) / width) ** 2 for middle in (x, y))
            taper = shine * np.maximum((1.0 - along)[..., :, None] - across[..., None, :], 0.0) ** 2
    return x.astype(np.float64), y.astype(np.float64), total


def _fit(x: Array, y: Array, good: NDArray[np.bool_], place: Array, radius_px: Array) -> tuple[Array, Array, Array]:
    """(N, 3) shift right, shift up and radius, residual RMS in radii, (N, 3, 3) cofactors; robust."""
    count, lights = x.shape
    design = np.zeros((count, lights, 2, 3))
    design[..., 0, 0] = design[..., 1, 1] = 1.0
    design[..., 2] = place
    target = np.stack([x, y], axis=2)
    weight = good.astype(np.float64)
    closest = np.hypot(TOLERANCE, TOLERANCE_PX / radius_px)
    tolerances = np.geomspace(np.maximum(0.2, closest), closest, ROUNDS)
    step = np.zeros((count, 3))
    step[:, 2] = radius_px
    for tolerance in tolerances:
        normal = np.einsum("nl,nlci,nlcj->nij", weight, design, design) + 1e-6 * np.eye(3)
        right = np.einsum("nl,nlci,nlc->ni", weight, design, target) + 1e-6 * np.array([0.0, 0.0, 1.0]) * step[:, 2:]
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        left = np.einsum("nlci,ni->nlc", design, step) - target
        distance = np.hypot(left[..., 0], left[..., 1]) / radius_px[:, None]
        weight = good / (1.0 + (distance / tolerance[:, None]) ** 2) ** 2
    used = weight.sum(axis=1)
    rms = np.sqrt((weight * distance**2).sum(axis=1) / np.maximum(2.0 * used - 3.0, 0.5))
    number = good.sum(axis=1)
    rms[~np.isfinite(rms) | (number < MIN_HIGHLIGHTS) | (used < np.maximum(0.6 * number, 2.0))] = np.inf
    return step, rms, np.linalg.inv(normal)


def _common_offset(x: Array, y: Array, good: NDArray[np.bool_], half: Array, step: Array) -> Array:
    """(L, 2) what all balls' highlights are off by, in radii, without what a shift or another radius would explain."""
    at = (np.stack([x, y], axis=2) - step[:, None, :2]) / np.maximum(step[:, None, 2:], 1.0) - half
    at[~good] = np.nan
    seen = good.sum(axis=0) >= POOL_BALLS
    offset = np.zeros(at.shape[1:])
    if seen.sum() < MIN_HIGHLIGHTS:
        return offset
    offset[seen] = np.nanmedian(at[:, seen], axis=0)
    mean = half[:, seen].mean(axis=0)
    design = np.zeros((int(seen.sum()), 2, 3))
    design[:, 0, 0] = design[:, 1, 1] = 1.0
    design[..., 2] = mean
    flat = design.reshape(-1, 3)
    offset[seen] -= (flat @ np.linalg.lstsq(flat, offset[seen].ravel(), rcond=None)[0]).reshape(-1, 2)
    return offset
