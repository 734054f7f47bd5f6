r"""Centres of balls from their highlights, against the other balls; and balls whose highlights are missing.

The highlight of a light with direction l lies where the normal is the half vector h of l and the camera: at c + R h
on a sphere. Patches around these places, in units of R, look alike on all balls. With their median over the balls T,
the patch of one ball is, to first order,

    v(g) = a T(g) + b - a grad T(g) . delta / R,

delta the displacement of its centre (registration by least squares; Lucas & Kanade 1981). What shading,
inter-reflection and wrong lights do to all balls alike is in T: only differences between balls are measured, their mean
is the shadows'.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.inspection.radiance import Radiance

__all__ = ["Highlights", "read_highlights", "sharpen_centres"]

Array = NDArray[np.float64]

REACH = 0.36
"""Patches reach this share of the radius to every side."""
SAMPLES = 11
OUTERMOST = 0.9
MIN_POPULATION = 6
MIN_SHARE = 0.5
MISSING = 0.3
"""Highlights fainter than this share of the usual one count as missing."""
FLOOR_PX = 0.02
LEAST_ALONE = 0.1
MIN_STRENGTH = 4.0
"""Highlights must stand out of the noise of the patches by this factor."""


class Highlights(NamedTuple):
    """Displacement (N, 2) against the population, its uncertainty (N,), inf: unknown; missing highlights (N,)."""

    move_px: Array
    u_px: Array
    missing: NDArray[np.bool_]


def read_highlights(radiance: Radiance, table: Array, vectors: Array, near: bool) -> Highlights:
    """Register the highlights of every ball with the population's.

    Parameters
    ----------
    radiance : Radiance
    table : (N, 5) float64
        Balls, centres good to a tenth of a pixel.
    vectors : (L, 3) float64
        Lights.
    near : bool
        Whether they are positions.
    """
    count = len(table)
    unknown = Highlights(np.zeros((count, 2)), np.full(count, np.inf), np.zeros(count, dtype=np.bool_))
    if count < MIN_POPULATION:
        return unknown
    place = _places(table, vectors, near)
    grid = np.linspace(-REACH, REACH, SAMPLES)
    x = table[:, 0, None, None, None] + table[:, 3, None, None, None] * (place[..., 0, None, None] + grid[None, :])
    y = table[:, 1, None, None, None] + table[:, 3, None, None, None] * (place[..., 1, None, None] + grid[:, None])
    r = np.hypot(place[..., 0, None, None] + grid[None, :], place[..., 1, None, None] + grid[:, None])
    values = np.where(r < OUTERMOST, _interpolate(radiance, x, y), np.nan)
    known = np.isfinite(values)
    common = known.mean(axis=0) > MIN_SHARE
    template = np.nanmedian(np.where(common[None], values, 0.0), axis=0)
    slope_y, slope_x = np.gradient(template, grid, grid, axis=(1, 2))
    usable = known & common[None]
    for shift in (-1, 1):  # slopes reach to the next sample
        for axis in (1, 2):
            usable &= np.roll(common, shift, axis=axis)[None]
    strength = np.where(common, np.abs(slope_x) + np.abs(slope_y), 0.0).max(axis=(1, 2))
    return _register(values, template, slope_x, slope_y, usable, strength, table[:, 3]) or unknown


def _places(table: Array, vectors: Array, near: bool) -> Array:
    """(N, L, 2) places of highlights on the discs, in radii."""
    way = (
        vectors[None, :, :] - np.column_stack([table[:, :2], table[:, 2]])[:, None, :] if near else vectors[None, :, :]
    )
    light = way / np.linalg.norm(way, axis=2, keepdims=True)
    half = light + np.array([0.0, 0.0, 1.0])
    # On a spheroid the normal (x, y, z / q^2) / R^2 points along h at x = h_x R / |(h_x, h_y, q h_z)|.
    size = np.sqrt(half[..., 0] ** 2 + half[..., 1] ** 2 + (table[:, 4, None] * half[..., 2]) ** 2)
    places: Array = half[..., :2] / size[..., None]
    return places


def _interpolate(radiance: Radiance, x: Array, y: Array) -> Array:
    """(N, L, G, G) bilinear values, each light from its own image; NaN where clipped or outside."""
    row, col = radiance.row(y), radiance.col(x)
    row, col = np.broadcast_arrays(row, col)
    inside = (row >= 0) & (row < radiance.height - 1) & (col >= 0) & (col < radiance.width - 1)
    top, left = (
        np.clip(row, 0, radiance.height - 2).astype(np.intp),
        np.clip(col, 0, radiance.width - 2).astype(np.intp),
    )
    down, right = row - top, col - left
    light = np.broadcast_to(np.arange(radiance.lights)[None, :, None, None], row.shape)
    index = top * radiance.width + left
    corners = [radiance.under(light, index + step) for step in (0, 1, radiance.width, radiance.width + 1)]
    upper = corners[0] + right * (corners[1] - corners[0])
    lower = corners[2] + right * (corners[3] - corners[2])
    return np.where(inside, upper + down * (lower - upper), np.nan)


def _register(
    values: Array,
    template: Array,
    slope_x: Array,
    slope_y: Array,
    usable: NDArray[np.bool_],
    strength: Array,
    radius: Array,
) -> Highlights | None:
    """Least squares of every patch, then of every ball over its lights."""
    count, lights = values.shape[:2]
    columns = np.stack([template, np.ones_like(template), slope_x, slope_y], axis=-1).reshape(lights, -1, 4)
    weight = usable.reshape(count, lights, -1).astype(np.float64)
    target = np.where(usable, values, 0.0).reshape(count, lights, -1)
    normal = np.einsum("klm,lmi,lmj->klij", weight, columns, columns, optimize=True)
    right = np.einsum("klm,lmi->kli", weight * target, columns, optimize=True)
    scale = np.sqrt(np.maximum(np.einsum("klii->kli", normal), 1e-20))
    scaled = normal / (scale[..., :, None] * scale[..., None, :]) + 1e-9 * np.eye(4)
    solution = np.linalg.solve(scaled, (right / scale)[..., None])[..., 0] / scale
    fitted = np.einsum("kli,lmi->klm", solution, columns, optimize=True)
    enough = weight.sum(axis=2) > MIN_SHARE * weight.shape[2]
    noise = np.sqrt((weight * (target - fitted) ** 2).sum(axis=2) / np.maximum(weight.sum(axis=2) - 4.0, 1.0))
    if not enough.any() or np.median(strength) * REACH < MIN_STRENGTH * np.median(noise[enough]):
        return None
    gain = solution[..., 0]
    missing = _missing(gain, enough)
    good = enough & (gain > MISSING) & ~missing[:, None]
    safe = np.where(good, gain, 1.0)
    move = -np.where(good[..., None], solution[..., 2:], 0.0) / safe[..., None] * radius[:, None, None]
    middle = np.array(
        [np.median(move[ball, good[ball]], axis=0) if good[ball].any() else [0.0, 0.0] for ball in range(count)]
    )
    off = np.where(good[..., None], move - middle[:, None, :], np.nan)
    seen = good.sum(axis=1)
    spread = 1.4826 * np.nanmedian(np.abs(off)) if good.any() else np.inf
    kept = good & (np.abs(np.nan_to_num(off)).max(axis=2) < 3.0 * spread)
    total = np.maximum(kept.sum(axis=1), 1)
    mean = (move * kept[..., None]).sum(axis=1) / total[:, None]
    known = kept.sum(axis=1) > lights / 2
    u_px = np.where(known, np.hypot(spread / np.sqrt(np.maximum(seen, 1)), FLOOR_PX), np.inf)
    return Highlights(np.where(known[:, None], mean, 0.0), u_px, missing)


def _missing(gain: Array, enough: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Balls with hardly any highlight under most lights."""
    faint = enough & (gain < MISSING * np.median(gain[enough]))
    missing: NDArray[np.bool_] = (enough.sum(axis=1) > 0) & (faint.sum(axis=1) > 0.5 * enough.sum(axis=1))
    return missing


def sharpen_centres(
    highlights: Highlights, start: Array, fitted: Array, u_fitted: Array, u_common: Array
) -> tuple[Array, Array]:
    """Centres (N, 2) of shadows and highlights together, and their uncertainty (N, 2).

    Parameters
    ----------
    highlights : Highlights
    start : (N, 2) float64
        Centres that the highlights were read at.
    fitted, u_fitted : (N, 2) float64
        Centres of the shadows and their uncertainty.
    u_common : (2,) float64
        The part of it that all balls share: highlights say nothing about that.
    """
    known = np.isfinite(highlights.u_px)
    if known.sum() < MIN_POPULATION:
        return fitted, u_fitted
    by_light = start + highlights.move_px
    by_light = by_light - np.median(by_light[known] - fitted[known], axis=0)
    apart = by_light[known] - fitted[known]
    alone = np.maximum(np.square(u_fitted) - np.square(u_common), LEAST_ALONE * np.square(u_fitted))
    excess = np.square(1.4826 * np.median(np.abs(apart), axis=0)) - np.median(alone[known], axis=0)
    u_light = np.sqrt(np.maximum(np.square(highlights.u_px)[:, None], np.maximum(excess, 0.0)[None, :]))
    u_light = np.where(known[:, None], u_light, np.inf)
    weight, weight_fitted = u_light**-2.0, 1.0 / alone
    total = weight + weight_fitted
    centres = (np.where(known[:, None], by_light, 0.0) * weight + fitted * weight_fitted) / total
    # The mean over the balls is still that of the shadows.
    common = np.median(alone, axis=0) / known.sum() + np.square(u_common)
    return centres, np.sqrt(1.0 / total + common)
