"""Where the outline of a ball is, from what the last pixels inside it must look like.

Toward its rim a ball turns away from the camera as the square root of the distance: whatever a smooth ball shows is a
power series in the cosine c of that angle, c^2 = 1 - (r / R)^2, and no constant. And a mirror reflects all light at
grazing incidence (Fresnel 1823), however black it is: where the ground that it stands on and what it shows of it at the
rim are one, its edge is no step at all, but dark inside and as bright as the ground on the outline. Both are fitted to
the pixels of a band around the outline, blurred; which of them explains the pixels has the say.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bgars.station.outline import FLOOR_PX

if TYPE_CHECKING:
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["fit_rim", "fresnel", "sharpened"]

Array = NDArray[np.float64]

INSIDE, OUTSIDE = (5.0, 0.10), (4.0, 0.06)
"""Width of the band on either side: pixels at least, share of the radius."""
SECTORS = 36
LIT = 0.8
"""A ground is lit where it is so bright, of its light's brightest sector."""
LEAST_LEVEL = 0.5
"""Dimmest ground that a mirror's edge is seen against, in grey levels."""
LEAST_STEPS = 8.0
"""The same in steps of grey levels, where no noise blurs them."""
STEP_PX = 0.05
MIRROR_WAVES, MATT_WAVES = 2, 8
"""Waves around the ball in the level beside its outline: even ground, or the shading of a ring of lights."""
FREE, TIED = 30.0, 0.15
"""Standard deviations of coefficients: any, and those that say how uneven a lit ground is as the rim shows it."""
EXPLAINED = 6.0
"""Reduced chi square up to which a band is explained."""
ROUNDS, MOST_DAMPING, LEAST_GAIN = 30, 1e6, 0.05
METALS = ((1.6, 0.05), (3.0, 3.0))
"""Starts of the refractive index: a glass or lacquer, a metal."""
LOW = np.array([-np.inf, -np.inf, -np.inf, math.log(0.2), math.log(1.1), 0.0])
HIGH = np.array([np.inf, np.inf, np.inf, math.log(4.0), math.log(8.0), 12.0])
PARTS = 8
LEAST_PIXELS, MOST_PIXELS = 200, 5000
UNEXPLAINED_PX = 0.15
"""Shading runs into the edge of a matt ball, and a mirror is brighter at its rim: laws of edges differ by so much."""
STRAYED_PX = 1.5


class _Band(NamedTuple):
    """Pixels around an outline: places from the image centre, levels of the ground's, and their standard deviations."""

    places_px: Array
    levels: Array
    u_levels: Array
    matt: bool


class _Fit(NamedTuple):
    circle_px: Array
    variances_px2: Array
    edge_px: float
    chi_square: float


def fresnel(cosine: Array, index: complex) -> Array:
    """Share of unpolarised light that a smooth surface of a complex refractive index reflects.

    Examples
    --------
    >>> [round(float(value), 3) for value in fresnel(np.array([1.0, 0.0]), 1.5)]
    [0.04, 1.0]
    """
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / complex(index) ** 2)
    across = np.abs((cosine - index * inner) / (cosine + index * inner)) ** 2
    along = np.abs((index * cosine - inner) / (index * cosine + inner)) ** 2
    share: Array = 0.5 * (across + along)
    return share


def fit_rim(levels: Levels, outline: Outline, *, matt: bool) -> Outline | None:
    """Return the outline as the band around it has it; None where no law explains the band."""
    band = _band_of(levels, outline, matt)
    if band is None:
        return None
    edge = max(outline.edge_px, 0.4) if math.isfinite(outline.edge_px) else 0.6
    start = np.array([*outline.circle_px, math.log(edge)])
    fits = [_solve(band, start)]
    if not matt:
        starts = [np.array([*start, math.log(n), k]) for n, k in METALS]
        fits.append(_solve(band, min(starts, key=lambda one: float(np.square(_residuals(band, one)).sum()))))
    count = len(band.levels)
    best = min(fit.chi_square for fit in fits)
    reduced = best / count
    if reduced > EXPLAINED:
        return None
    # Either law is as likely as the other before the pixels are seen; where they do not tell, both count.
    weight = np.exp(-0.5 * np.array([fit.chi_square - best for fit in fits]) / max(reduced, 1.0))
    weight /= weight.sum()
    circles = np.array([fit.circle_px for fit in fits])
    middle = weight @ circles
    variances = np.array([fit.variances_px2 for fit in fits])
    u = np.sqrt(weight @ (variances + (circles - middle) ** 2) + FLOOR_PX**2)
    x, y, radius = (float(value) for value in middle)
    edge_px = float(weight @ np.array([fit.edge_px for fit in fits]))
    return replace(outline, x_px=x, y_px=y, radius_px=radius, u_centre_px=float(u[:2].max()), u_radius_px=float(u[2]),
                   edge_px=edge_px)  # fmt: skip


def sharpened(levels: Levels, outline: Outline | None, *, matt: bool) -> Outline | None:
    """Return an outline as the pixels around it have it, where a law of their levels explains them."""
    if outline is None:
        return None
    fitted = fit_rim(levels, outline, matt=matt)
    if fitted is not None and float(np.abs(fitted.circle_px - outline.circle_px).max()) < STRAYED_PX:
        return fitted
    return replace(outline, u_radius_px=math.hypot(outline.u_radius_px, UNEXPLAINED_PX))


def _band_of(levels: Levels, outline: Outline, matt: bool) -> _Band | None:
    """Mean of the lights: of a mirror, of those only that light the ground beside a pixel."""
    height, width = levels.images.shape[1:]
    rows, cols = np.mgrid[:height, :width]
    x, y = cols + 0.5 - width / 2.0, height / 2.0 - rows - 0.5
    apart = np.hypot(x - outline.x_px, y - outline.y_px)
    inner = outline.radius_px - max(INSIDE[0], INSIDE[1] * outline.radius_px)
    outer = outline.radius_px + max(OUTSIDE[0], OUTSIDE[1] * outline.radius_px)
    use = (apart > inner) & (apart < outer)
    # The ground begins beyond the blur of the edge.
    beyond_px = outline.radius_px + max(2.0, 2.5 * float(np.nan_to_num(outline.edge_px)))
    if int(use.sum()) < LEAST_PIXELS or not (apart[use] > beyond_px).any():
        return None
    places_of = np.flatnonzero(use)[:: math.ceil(int(use.sum()) / MOST_PIXELS)]
    seen = levels.images.reshape(len(levels.images), -1)[:, places_of]
    places = np.column_stack([x.ravel()[places_of], y.ravel()[places_of]])
    apart = apart.ravel()[places_of]
    if matt:
        mean = seen.mean(axis=0)
        scale = float(np.percentile(mean, 95))
        if scale < max(LEAST_LEVEL, LEAST_STEPS * levels.rounding) or (seen >= levels.clip).any():
            return None
        return _Band(places, mean / scale, np.full(len(mean), levels.noise / math.sqrt(len(seen)) / scale), True)
    turn = np.arctan2(places[:, 1] - outline.y_px, places[:, 0] - outline.x_px) / (2.0 * math.pi) % 1.0 * SECTORS
    sector = turn.astype(int) % SECTORS
    ground = apart > beyond_px
    level = np.full((len(seen), SECTORS), np.nan)
    for index in range(SECTORS):
        here = ground & (sector == index)
        if here.any():
            level[:, index] = seen[:, here].mean(axis=1)
    lit = level > np.maximum(LIT * np.nanpercentile(level, 95, axis=1, keepdims=True), LEAST_LEVEL)
    lit &= (seen < levels.clip).all()
    if not lit.any() or float(np.median(level[lit])) < LEAST_STEPS * levels.rounding:
        return None
    # The level of the ground between sectors, or its steps would be seen.
    smooth = ndimage.gaussian_filter1d(np.nan_to_num(np.where(lit, level, 0.0)), 0.7, axis=1, mode="wrap")
    share = ndimage.gaussian_filter1d(lit.astype(np.float64), 0.7, axis=1, mode="wrap")
    smooth = np.where(lit, smooth / np.maximum(share, 1e-9), 0.0)
    right = np.floor(turn - 0.5).astype(int) % SECTORS
    part = (turn - 0.5) % 1.0
    next_one = (right + 1) % SECTORS
    both = lit[:, right] & lit[:, next_one]
    base = (smooth[:, right] * (1.0 - part) + smooth[:, next_one] * part) * both
    total = base.sum(axis=0)
    good = both.any(axis=0)
    good &= total > 0
    value = (seen * both).sum(axis=0)[good] / total[good]
    # The ground itself says how rough it is, and how much noise there is where black is cut off.
    beside = both[:, ground & good]
    square = np.sum(np.square((seen - base)[:, ground & good]), where=beside, axis=1)
    noise = np.maximum(np.sqrt(square / np.maximum(beside.sum(axis=1), 1)), levels.noise)
    u = np.sqrt((both[:, good] * noise[:, None] ** 2).sum(axis=0)) / total[good]
    if int(good.sum()) < LEAST_PIXELS:
        return None
    return _Band(places[good], value, u, False)


def _columns(band: _Band, unknowns: Array) -> tuple[Array, Array]:
    """Columns (N, K) that a law is a sum of, and standard deviations (K,) of their coefficients."""
    circle, blur = unknowns[:3], math.exp(unknowns[3])
    offset = band.places_px - circle[:2]
    apart = np.hypot(*offset.T)
    pad = 6.0 * blur
    line = np.arange(apart.min() - pad, apart.max() + pad, STEP_PX)
    cosine = np.sqrt(np.maximum(1.0 - np.minimum(line / circle[2], 1.0) ** 2, 0.0))
    # The step itself lies between points of the line: shares of a step, or the fit would see stairs.
    inside = np.clip(0.5 + (circle[2] - line) / STEP_PX, 0.0, 1.0)
    outward = (line - circle[2]) / circle[2] * (1.0 - inside)
    around = np.arctan2(offset[:, 1], offset[:, 0])
    orders = range(1, 1 + (MATT_WAVES if band.matt else MIRROR_WAVES))
    one = np.ones((len(apart), 1))
    whole = np.hstack([one, *[wave(n * around)[:, None] for n in orders for wave in (np.cos, np.sin)]])
    if len(unknowns) > 4:  # noqa: PLR2004 - a refractive index
        mirror = fresnel(cosine, complex(math.exp(unknowns[4]), unknowns[5])) * inside
        profiles = [1.0 - inside + mirror, mirror * cosine, mirror * cosine**2, outward]
        factors, sizes = [whole, one, one, one], [FREE, TIED, TIED, TIED]
    else:
        profiles = [1.0 - inside, inside, cosine, cosine**2, outward]
        beside = whole if band.matt else one
        factors, sizes = [beside, whole, beside, beside, one], [FREE, FREE, FREE, FREE, 1.0]
    smooth = ndimage.gaussian_filter1d(np.array(profiles), blur / STEP_PX, axis=1, mode="nearest", truncate=5.0)
    parts = [np.interp(apart, line, profile)[:, None] * factor for profile, factor in zip(smooth, factors, strict=True)]
    spreads = np.concatenate([np.full(part.shape[1], size) for part, size in zip(parts, sizes, strict=True)])
    return np.hstack(parts), spreads


def _residuals(band: _Band, unknowns: Array) -> Array:
    """What the best sum of columns leaves (variable projection, Golub & Pereyra 1973); coefficients have spreads."""
    columns, spreads = _columns(band, unknowns)
    scaled = columns / band.u_levels[:, None]
    right = band.levels / band.u_levels
    normal = scaled.T @ scaled + np.diag(1.0 / spreads**2)
    found = np.linalg.solve(normal, scaled.T @ right)
    return np.concatenate([right - scaled @ found, found / spreads])


def _solve(band: _Band, start: Array) -> _Fit:
    """Levenberg-Marquardt over circle, blur and refractive index."""
    low, high = LOW[: len(start)], HIGH[: len(start)]
    values, damping = np.clip(start, low, high), 1e-3
    residuals = _residuals(band, values)
    jacobian = normal = np.eye(len(start))
    for _ in range(ROUNDS):
        step = 1e-3
        columns = []
        for axis in np.eye(len(start)):
            side = step if float((values + step * axis - high).max()) <= 0 else -step
            columns.append((_residuals(band, values + side * axis) - residuals) / side)
        jacobian = np.column_stack(columns)
        normal = jacobian.T @ jacobian
        cost = float(residuals @ residuals)
        gain = 0.0
        while damping < MOST_DAMPING:
            damped = normal + damping * np.diag(np.diag(normal) + 1e-9)
            ahead = np.clip(values - np.linalg.solve(damped, jacobian.T @ residuals), low, high)
            there = _residuals(band, ahead)
            gain = cost - float(there @ there)
            if gain > 0:
                values, residuals, damping = ahead, there, max(damping / 8.0, 1e-7)
                break
            damping *= 8.0
        if gain < LEAST_GAIN:
            break
    variances = np.maximum(
        np.diag(np.linalg.pinv(normal))[:3] * max(1.0, float(residuals @ residuals) / len(band.levels)),
        _left_out(band, values, jacobian[:, :3], residuals),
    )
    return _Fit(values[:3], variances, math.exp(values[3]), float(residuals @ residuals))


def _left_out(band: _Band, values: Array, jacobian: Array, residuals: Array) -> Array:
    """Variances by leaving out parts of the outline, one at a time: what is no law is not alike all around."""
    count = len(band.levels)
    around = np.arctan2(*(band.places_px - values[:2]).T[::-1])
    part = ((around / (2.0 * math.pi) + 0.5) * PARTS).astype(int) % PARTS
    normal, right = jacobian.T @ jacobian, jacobian.T @ residuals
    total = np.zeros(len(normal))
    for index in range(PARTS):
        rows = jacobian[:count][part == index]
        left = normal - rows.T @ rows
        moved = np.linalg.solve(
            left + 1e-9 * np.diag(np.diag(normal)), right - rows.T @ residuals[:count][part == index]
        )
        total += moved**2
    found: Array = (PARTS - 1) / PARTS * total
    return found
