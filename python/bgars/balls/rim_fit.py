"""The silhouette of each ball to a hundredth of a pixel: a rim model fitted to all lights and all directions."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.balls.rim_model import BASIS, SLOPES, RimModel
from bgars.balls.rim_pixels import TAPER_PX, RimPixels, sector_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

    Array = NDArray[np.float64]

__all__ = ["Circles", "fit_rims", "rim_costs"]

WIDE_ROUNDS = 3
NARROW_ROUNDS = 3
FIRST_BLUR_PX = 0.3
"""Blur of the lens before it is fitted."""
WIDE_REACH_PX, NARROW_REACH_PX = 13.0, 9.0
"""Depth of the bands, and how far circles move within them."""
TOLERANCES = ((0.6, 1),) * 3 + ((0.1, 1),) * 2 + ((0.1, 2),) + ((0.05, 2),) * 6
"""Offset in pixels that halves a weight, and the power of the weight: Cauchy first, then closer."""
MODEL_ERROR_PX = 0.03
"""Scatter of the offset of a sector that its noise does not explain."""
LARGEST_STEP_PX = 1.5
POOL_BALLS = 6
"""Balls from which on the slopes of rims are the median over balls, else over turns of one."""
SEEN_WITHIN_PX = 0.3
"""Offset of a sector within which it supports the circle."""
CENTRE_SHARE, RADIUS_SHARE = 0.6, 1.0
"""Error that all sectors share, as a fraction of their scatter."""
U_MODEL_PX = 0.012
"""What the model of the rim is off by on clean images."""
DARK_RIM_PX, LARGEST_U_MODEL_PX = 0.0012, 0.3
"""Error of the radius where the rim is as bright as the ball, in inverse proportion to that."""
BLUR_SHARE, CENTRE_BLUR_SHARE = 0.1, 0.08
"""The lens blur is known to a tenth of a pixel or so, and a wider one makes the radius smaller; it mixes texture and
shadows beside the rim into it, which moves the centre."""
BLUR_BALLS = 12
BLURS_PX = (0.0, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0)
NOISE_FLOOR = 0.15
"""Grey levels of 255 below which residuals are quantisation."""


@dataclass
class Circles:
    """Circles in array coordinates (row, column of pixel centres are integers), N each.

    Attributes
    ----------
    row, col, radius_px : (N,) float64
        The circles.
    u_centre_px, u_radius_px : (N,) float64
        Standard uncertainties.
    support : (N,) float64
        Fraction of the sectors whose rim was seen on the circle.
    offsets_px : (N, S) float64
        Where each sector's rim lies, outward from the circle; NaN where it was not seen.
    blur_px : float
        Standard deviation of the lens blur.
    """

    row: NDArray[np.float64]
    col: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    u_centre_px: NDArray[np.float64]
    u_radius_px: NDArray[np.float64]
    support: NDArray[np.float64]
    offsets_px: NDArray[np.float64]
    blur_px: float = 0.0

    def take(self, index: slice | NDArray[np.intp]) -> Circles:
        """Some of the circles."""
        columns = {field.name: getattr(self, field.name)[index] for field in fields(self) if field.name != "blur_px"}
        return replace(self, **columns)

    def join(self, other: Circles) -> Circles:
        """These circles and others."""
        columns: dict[str, Any] = {
            field.name: np.concatenate([getattr(self, field.name), getattr(other, field.name)])
            for field in fields(self)
            if field.name != "blur_px"
        }
        return replace(self, **columns)

    def put(self, index: NDArray[np.intp], other: Circles) -> None:
        """Set some of the circles."""
        for field in fields(self):
            if field.name != "blur_px":
                getattr(self, field.name)[index] = getattr(other, field.name)


def fit_rims(
    levels: Levels,
    row: NDArray[np.float64],
    col: NDArray[np.float64],
    radius_px: NDArray[np.float64],
    *,
    blur_px: float | None = None,
    sectors: int | None = None,
) -> Circles:
    """Fit the circle of each ball to its rim in all lights.

    First on half of the pixels of a wide band, then on all pixels of a narrow one.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        Circles to start from, good to a tenth of the radius.
    blur_px : float, optional
        Standard deviation of the lens blur; found from the images by default.
    sectors : int, optional
        Equal angles that a rim is divided into; as many as pixels allow by default.
    """
    sectors = sectors or sector_count(radius_px)
    nothing = 0.0 * row
    circles = Circles(row + 0.0, col + 0.0, radius_px + 0.0, nothing, nothing, nothing, np.zeros((len(row), sectors)))
    if not len(row):
        return circles
    model = RimModel(FIRST_BLUR_PX if blur_px is None else blur_px, WIDE_REACH_PX, levels.threads)
    wide_px = np.clip(0.2 * radius_px, 4.0, 9.0) + TAPER_PX / 2.0
    pixels = RimPixels(levels, circles.row, circles.col, circles.radius_px, wide_px, wide_px, 2, sectors)
    for _ in range(WIDE_ROUNDS):
        _update(circles, *_sector_offsets(pixels, circles, model)[:2])
    radius_px = circles.radius_px.clip(0.5 * radius_px, 2.0 * radius_px)
    pixels = _narrow_band(levels, circles.row, circles.col, circles.radius_px, radius_px, sectors)
    model = RimModel(model.blur_px, NARROW_REACH_PX, levels.threads)
    for turn in range(NARROW_ROUNDS):
        if turn == 1 and blur_px is None:
            model = RimModel(_estimated_blur(pixels, circles), NARROW_REACH_PX, levels.threads)
        offset, variance, jump = _sector_offsets(pixels, circles, model)
        _update(circles, offset, variance)
    circles.blur_px = model.blur_px
    circles.u_radius_px = np.hypot(circles.u_radius_px, _u_model_px(levels, circles, variance, jump))
    circles.u_centre_px = np.hypot(circles.u_centre_px, CENTRE_BLUR_SHARE * circles.blur_px)
    return circles


def rim_costs(levels: Levels, row: Array, col: Array, radius_px: Array, tried: list[Circles]) -> Array:
    """How badly each of several circles explains the same pixels; differences are twice those of log-likelihoods.

    A fit ends in one minimum of several where the rim is a grey level or two; which is the best only their costs tell.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        Circles around whose rims the pixels lie.
    tried : list of Circles
        K times N circles; the blur is that of the first.

    Returns
    -------
    (K, N) float64
        Sum over sectors and lights of n log(mean squared residual): the likelihood concentrated with respect to the
        variances (Seber and Wild 1989, section 2.2).
    """
    pixels = _narrow_band(levels, row, col, radius_px, radius_px, tried[0].offsets_px.shape[1])
    model = RimModel(tried[0].blur_px, NARROW_REACH_PX, levels.threads)
    costs = []
    for circles in tried:
        rest, _, count = _solve(pixels, circles, model)
        number = np.maximum(count - BASIS, 1.0)[..., None]
        left = np.maximum(np.einsum("nsll->nsl", rest[..., 5:, 5:]), 0.0) / number
        seen = (count >= 2 * BASIS)[..., None] & ~np.moveaxis(pixels.clipped, 0, -1)
        costs.append((number * np.log(left + NOISE_FLOOR**2) * seen).sum(axis=(1, 2)))
    return np.stack(costs)


def _narrow_band(levels: Levels, row: Array, col: Array, radius_px: Array, size_px: Array, sectors: int) -> RimPixels:
    """All pixels near the rims; `size_px` are the radii that its depths are in proportion to."""
    in_px, out_px = np.clip(0.15 * size_px, 3.0, 6.0), np.clip(0.14 * size_px, 2.5, 5.0)
    return RimPixels(levels, row, col, radius_px, in_px, out_px, 1, sectors)


def _u_model_px(levels: Levels, circles: Circles, variance: Array, jump: Array) -> Array:
    """(N,) what the radius may be off by because rims are not as modelled: blurred, or dark beside the highlights.

    A rim much darker than the ball shines by what it mirrors, board and shadows, which end before the silhouette does.
    """
    weight = 1.0 / (variance + MODEL_ERROR_PX**2)
    step = np.sqrt((weight * jump**2).sum(axis=(1, 2)) / np.maximum(weight.sum(axis=(1, 2)), 1e-12))
    grid = np.linspace(-0.7, 0.7, 15)
    y, x = (side.ravel() for side in np.meshgrid(grid, grid))
    r = np.rint(circles.row[:, None] - circles.radius_px[:, None] * y).astype(np.intp).clip(0, levels.height - 1)
    c = np.rint(circles.col[:, None] + circles.radius_px[:, None] * x).astype(np.intp).clip(0, levels.width - 1)
    peak = np.quantile(levels.at(r * levels.width + c).max(axis=0), 0.9, axis=1)
    dark = DARK_RIM_PX * np.median(peak) / np.maximum(np.median(step), NOISE_FLOOR)
    return np.full(len(step), math.hypot(min(float(dark), LARGEST_U_MODEL_PX), BLUR_SHARE * circles.blur_px))


def _estimated_blur(pixels: RimPixels, circles: Circles) -> float:
    """The lens blur that leaves the least, over the sectors and lights of most contrast, parabola through three."""
    some = slice(None, None, max(1, len(circles.row) // BLUR_BALLS))
    pixels, circles = pixels.take(some), circles.take(some)
    models = (RimModel(blur_px, NARROW_REACH_PX, pixels.threads) for blur_px in BLURS_PX)
    tried = [_left_over(pixels, circles, model) for model in models]
    logs = np.log(np.stack([left for left, _ in tried]) + 0.02)
    contrast = np.mean([contrast for _, contrast in tried], axis=0)
    # Textured and shadowed sectors say nothing; which these are must not depend on one blur.
    least = logs.min(axis=0)
    best = contrast >= np.quantile(contrast, 2 / 3)
    best &= least <= np.median(least[best])
    costs = logs[:, best].mean(axis=1)
    at = int(np.argmin(costs))
    if not 0 < at < len(BLURS_PX) - 1:
        return BLURS_PX[at]
    curve = np.polyfit(BLURS_PX[at - 1 : at + 2], costs[at - 1 : at + 2], 2)
    return float(-curve[1] / (2 * curve[0]))


def _solve(pixels: RimPixels, circles: Circles, model: RimModel) -> tuple[Array, Array, Array]:
    """Gram matrices (N, S, 5 + L, ..) of what the basis leaves, coefficients (N, S, BASIS, L), pixel counts."""
    rest, coefficients = model.take_out(pixels, circles.row, circles.col, circles.radius_px)
    return rest, coefficients, (pixels.weight**2).sum(axis=2, dtype=np.float64)


def _sector_offsets(pixels: RimPixels, circles: Circles, model: RimModel) -> tuple[Array, Array, Array]:
    """(N, S, L) outward offset of the rim in each sector and light, its variance, and the step in grey levels."""
    rest, coefficients, count = _solve(pixels, circles, model)
    slope = _pooled(coefficients[..., SLOPES, :], pixels.azimuths_rad)
    dd = np.einsum("nskl,nskm,nsml->nsl", slope, rest[..., :5, :5], slope)
    de = np.einsum("nskl,nskl->nsl", slope, rest[..., :5, 5:])
    ee = np.einsum("nsll->nsl", rest[..., 5:, 5:])
    dd = np.maximum(dd, 1e-9)
    offset = de / dd
    left = np.maximum(ee - de * offset, 0.0) / np.maximum(count - BASIS - 1, 1)[..., None]
    variance = (left + NOISE_FLOOR**2) / dd
    bad = (count < 2 * BASIS)[..., None] | (np.moveaxis(pixels.clipped, 0, -1))
    variance = np.where(bad, np.inf, variance)
    arc_px = (2 * math.pi / slope.shape[1]) * circles.radius_px[:, None, None]
    return np.clip(offset, -3.0, 3.0), variance, np.sqrt(dd / arc_px)


def _pooled(slope: Array, azimuths_rad: Array) -> Array:
    """(N, S, 5, L) medians of the coefficients over all balls.

    The derivative must not come from the pixels that it is applied to: noise would enter twice and pull rims inward.
    """
    balls, sectors, terms, _ = slope.shape
    if balls >= POOL_BALLS:
        return np.broadcast_to(np.median(slope, axis=0), slope.shape)
    pooled = np.zeros((1, *slope.shape[1:]))
    mid = (np.arange(sectors) + 0.5) * (2 * math.pi / sectors)
    turn = np.rint((mid[:, None] - azimuths_rad) / (2 * math.pi / sectors)).astype(int) % sectors
    by_turn = np.zeros((sectors, terms))
    flat = np.moveaxis(slope, 2, 3)  # (N, S, L, 5)
    for index in range(sectors):
        here = flat[:, turn == index]
        if here.size:
            by_turn[index] = np.median(here.reshape(-1, terms), axis=0)
    pooled[0] = np.moveaxis(by_turn[turn], 2, 1)
    return np.broadcast_to(pooled, slope.shape)


def _left_over(pixels: RimPixels, circles: Circles, model: RimModel) -> tuple[Array, Array]:
    """(N, S, L) mean squared residual, each sector and light with its rim where it fits best; and the contrast."""
    rest, coefficients, count = _solve(pixels, circles, model)
    slope = coefficients[..., SLOPES, :]
    dd = np.einsum("nskl,nskm,nsml->nsl", slope, rest[..., :5, :5], slope)
    de = np.einsum("nskl,nskl->nsl", slope, rest[..., :5, 5:])
    left = np.einsum("nsll->nsl", rest[..., 5:, 5:]) - de**2 / np.maximum(dd, 1e-9)
    return np.maximum(left, 0.0) / np.maximum(count - BASIS - 1, 1.0)[..., None], dd


def _update(circles: Circles, offset: Array, variance: Array) -> None:
    """One step of the three parameters of each circle, all sectors and lights together, outliers down-weighted."""
    sectors = offset.shape[1]
    mid = (np.arange(sectors) + 0.5) * (2 * math.pi / sectors)
    design = np.stack([np.cos(mid), np.sin(mid), np.ones(sectors)], axis=1)  # x right, y up, radius
    base = 1.0 / (variance + MODEL_ERROR_PX**2)
    base[~np.isfinite(base)] = 0.0
    base[variance > 0.5**2] = 0.0
    spread = np.sqrt(variance + MODEL_ERROR_PX**2)
    step = np.zeros((len(offset), 3))
    weight = base
    for turn in range(len(TOLERANCES)):
        per_sector = weight.sum(axis=2)
        total = (weight * offset).sum(axis=2)
        normal = np.einsum("ns,si,sj->nij", per_sector, design, design) + 1e-6 * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("ns,si->ni", total, design)[..., None])[..., 0]
        residual = offset - (step @ design.T)[..., None]
        scale_px, power = TOLERANCES[turn]
        weight = base / (1.0 + (residual / np.maximum(spread, scale_px)) ** 2) ** power
    length = np.maximum(np.abs(step).max(axis=1), 1e-12)
    step *= np.minimum(1.0, LARGEST_STEP_PX / length)[:, None]
    circles.col += step[:, 0]
    circles.row -= step[:, 1]
    circles.radius_px += step[:, 2]
    # What remains, sector by sector: lights of one sector share texture and shadows, so they count once.
    per_sector = weight.sum(axis=2)
    seen = per_sector > 0
    mean = np.divide((weight * residual).sum(axis=2), per_sector, out=np.zeros_like(per_sector), where=seen)
    circles.offsets_px = np.where(seen, mean, np.nan)
    circles.support = np.mean(seen & (np.abs(mean) < SEEN_WITHIN_PX), axis=1)
    trusted = base.sum(axis=2)
    scatter = np.sqrt((trusted * mean**2).sum(axis=1) / np.maximum(trusted.sum(axis=1), 1e-12))
    normal = np.einsum("ns,si,sj->nij", per_sector, design, design) + 1e-9 * np.eye(3)
    noise = np.linalg.inv(normal)
    number = np.maximum(seen.sum(axis=1), 1)
    by_light = _jackknife(weight, offset, design)
    circles.u_centre_px = np.sqrt(
        np.maximum((noise[:, 0, 0] + noise[:, 1, 1]) / 2, 2.0 * scatter**2 / number) + (CENTRE_SHARE * scatter) ** 2
    )
    circles.u_centre_px = np.maximum(circles.u_centre_px, np.sqrt(by_light[:, :2].mean(axis=1)))
    circles.u_radius_px = np.sqrt(
        np.maximum(noise[:, 2, 2], scatter**2 / number) + (RADIUS_SHARE * scatter) ** 2 + U_MODEL_PX**2
    )


def _jackknife(weight: Array, offset: Array, design: Array) -> Array:
    """(N, 3) variances of shift and radius from fits that leave out one light each (Quenouille 1956)."""
    lights = weight.shape[2]
    normal = np.einsum("nsl,si,sj->nlij", weight, design, design)
    right = np.einsum("nsl,si->nli", weight * offset, design)
    normal = normal.sum(axis=1, keepdims=True) - normal + 1e-6 * np.eye(3)
    right = right.sum(axis=1, keepdims=True) - right
    each = np.linalg.solve(normal, right[..., None])[..., 0]
    variance: Array = np.var(each, axis=1) * (lights - 1)
    return variance
