"""The silhouette of each ball to a hundredth of a pixel: a rim model fitted to all lights and all directions."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from bgars.balls.rim_model import SHAPES, RimTable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels
    from bgars.records import FloatArray

    Array = NDArray[np.float64]

__all__ = ["Circles", "RimPixels", "fit_rims"]

SECTORS = 24
BASIS = 7
"""Board, step, root, ramp inside, ramp outside, board along the rim, step along the rim."""
WIDE_ROUNDS = 3
NARROW_ROUNDS = 3
FIRST_BLUR_PX = 0.3
REACH_PX = 14.0
TOLERANCES = ((0.6, 1),) * 3 + ((0.1, 1),) * 2 + ((0.1, 2),) + ((0.05, 2),) * 6
"""Offset in pixels that halves a weight, and the power of the weight: Cauchy first, then closer."""
MODEL_ERROR_PX = 0.03
LARGEST_STEP_PX = 1.5
POOL_BALLS = 6
SEEN_WITHIN_PX = 0.3
CENTRE_SHARE, RADIUS_SHARE = 0.6, 1.0
"""Error that all sectors share, as a fraction of their scatter."""
U_MODEL_PX = 0.012
"""What the model of the rim is off by on clean images."""
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
    offsets_px : (N, SECTORS) float64
        Where each sector's rim lies, outward from the circle; NaN where it was not seen.
    """

    row: NDArray[np.float64]
    col: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    u_centre_px: NDArray[np.float64]
    u_radius_px: NDArray[np.float64]
    support: NDArray[np.float64]
    offsets_px: NDArray[np.float64]

    def take(self, index: slice | NDArray[np.intp]) -> Circles:
        """Some of the circles."""
        return Circles(*(getattr(self, field.name)[index] for field in fields(self)))


class RimPixels:
    """Pixels around the rims, sorted into sectors of equal angle and padded to equal number.

    Attributes
    ----------
    row, col : (N, SECTORS, P) float32
        Pixels relative to the anchor of the ball.
    weight : (N, SECTORS, P) float32
        0 for padding and for pixels outside the image or the mask.
    levels : (L, N, SECTORS, P) float32
        Grey levels.
    """

    def __init__(
        self,
        levels: Levels,
        circles: Circles,
        in_px: NDArray[np.float64],
        out_px: NDArray[np.float64],
        every: int,
    ) -> None:
        row, col, radius_px = circles.row, circles.col, circles.radius_px
        height, width = levels.height, levels.width
        directions = levels.capture.rig.directions
        self.azimuths_rad = np.arctan2(directions[:, 1], directions[:, 0])
        self.anchor_row = np.rint(row).astype(np.int64)
        self.anchor_col = np.rint(col).astype(np.int64)
        parts = []
        for ball in range(len(row)):
            reach = math.ceil(radius_px[ball] + out_px[ball]) + 1
            span = np.arange(-reach, reach + 1)
            y = (self.anchor_row[ball] + span - row[ball])[:, None]
            x = (self.anchor_col[ball] + span - col[ball])[None, :]
            distance = np.sqrt(x * x + y * y)
            depth = radius_px[ball] - distance
            near = np.flatnonzero((depth < in_px[ball]) & (depth > -out_px[ball]))[::every]
            r, c = np.divmod(near, len(span))
            angle = np.arctan2(-y[r, 0], x[0, c])
            sector = np.floor((angle / (2 * math.pi) % 1.0) * SECTORS).astype(np.int64) % SECTORS
            order = np.argsort(sector, kind="stable")
            counts = np.bincount(sector, minlength=SECTORS)
            parts.append((r[order] - reach, c[order] - reach, sector[order], counts))
        most = max(int(part[3].max()) for part in parts)
        shape = (len(row), SECTORS, most)
        self.row = np.zeros(shape, np.float32)
        self.col = np.zeros(shape, np.float32)
        self.weight = np.zeros(shape, np.float32)
        for ball, (r, c, sector, counts) in enumerate(parts):
            place = np.arange(len(r)) - np.repeat(np.cumsum(counts) - counts, counts)
            self.row[ball, sector, place] = r
            self.col[ball, sector, place] = c
            self.weight[ball, sector, place] = 1.0
        image_row = self.row.astype(np.int64) + self.anchor_row[:, None, None]
        image_col = self.col.astype(np.int64) + self.anchor_col[:, None, None]
        inside = (image_row >= 0) & (image_row < height) & (image_col >= 0) & (image_col < width)
        self.weight *= inside
        pixels = np.where(inside, image_row * width + image_col, 0)
        self.levels = levels.at(pixels) * self.weight
        self.clipped: NDArray[np.bool_] = np.any(levels.clipped_at(pixels) & (self.weight > 0), axis=3)

    def take(self, index: slice | NDArray[np.intp]) -> RimPixels:
        """The pixels of some of the balls."""
        part = copy.copy(self)
        for name in ("anchor_row", "anchor_col", "row", "col", "weight"):
            setattr(part, name, getattr(self, name)[index])
        part.levels, part.clipped = self.levels[:, index], self.clipped[:, index]
        return part


def fit_rims(
    levels: Levels,
    row: NDArray[np.float64],
    col: NDArray[np.float64],
    radius_px: NDArray[np.float64],
    *,
    blur_px: float | None = None,
) -> Circles:
    """Fit the circle of each ball to its rim in all lights.

    First on every few pixels of a wide band, then on all pixels of a narrow one.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        Circles to start from, good to a tenth of the radius.
    blur_px : float, optional
        Standard deviation of the lens blur; found from the images by default.
    """
    circles = Circles(
        row + 0.0, col + 0.0, radius_px + 0.0, 0.0 * row, 0.0 * row, 0.0 * row, np.zeros((len(row), SECTORS))
    )
    if not len(row):
        return circles
    table = RimTable(FIRST_BLUR_PX if blur_px is None else blur_px, REACH_PX)
    pixels = RimPixels(levels, circles, np.clip(0.2 * radius_px, 4.0, 9.0), np.clip(0.2 * radius_px, 4.0, 9.0), 3)
    for _ in range(WIDE_ROUNDS):
        _update(circles, *_sector_offsets(pixels, circles, table))
    radius_px = circles.radius_px.clip(0.5 * radius_px, 2.0 * radius_px)
    pixels = RimPixels(levels, circles, np.clip(0.15 * radius_px, 3.0, 6.0), np.clip(0.14 * radius_px, 2.5, 5.0), 1)
    for turn in range(NARROW_ROUNDS):
        if turn == 1 and blur_px is None:
            table = RimTable(_estimated_blur(pixels, circles), REACH_PX)
        _update(circles, *_sector_offsets(pixels, circles, table))
    return circles


def _estimated_blur(pixels: RimPixels, circles: Circles) -> float:
    """The lens blur that leaves the least, over the sectors and lights of most contrast, parabola through three."""
    some = slice(None, None, max(1, len(circles.row) // BLUR_BALLS))
    costs: list[float] = []
    best = np.zeros(0, np.bool_)
    for blur_px in BLURS_PX:
        left, contrast = _left_over(pixels.take(some), circles.take(some), RimTable(blur_px, REACH_PX))
        if not costs:
            best = contrast >= np.quantile(contrast, 2 / 3)
            best = best & (left <= np.median(left[best]))
        costs.append(float(np.mean(np.log(left[best] + 0.02))))
    at = int(np.argmin(costs))
    if not 0 < at < len(BLURS_PX) - 1:
        return BLURS_PX[at]
    curve = np.polyfit(BLURS_PX[at - 1 : at + 2], costs[at - 1 : at + 2], 2)
    return float(-curve[1] / (2 * curve[0]))


def _columns(pixels: RimPixels, circles: Circles, table: RimTable) -> FloatArray:
    """(N, S, P, BASIS + 5 + L) basis, derivatives of the basis by radius, levels."""
    y = (circles.row - pixels.anchor_row).astype(np.float32)[:, None, None] - pixels.row
    x = pixels.col - (circles.col - pixels.anchor_col).astype(np.float32)[:, None, None]
    distance = np.sqrt(x * x + y * y)
    # The mean distance of the points of a pixel is a little more than that of its centre, across the direction.
    spread = np.float32(1.0 / 24.0 + 0.5 * table.blur_px**2)
    radius = circles.radius_px.astype(np.float32)[:, None, None]
    depth = radius - distance - spread / np.maximum(distance, np.float32(0.5))
    shapes = table.look_up(depth, table.fold(x, y))
    mid = ((np.arange(SECTORS) + 0.5) * (2 * math.pi / SECTORS)).astype(np.float32)
    along = (y * np.cos(mid)[:, None] - x * np.sin(mid)[:, None]) / (radius * np.float32(2 * math.pi / SECTORS / 2))
    columns = np.zeros((*depth.shape, BASIS + 5 + len(pixels.levels)), np.float32)
    columns[..., 0] = 1.0
    columns[..., 1:5] = shapes[..., :SHAPES]
    columns[..., 5] = along
    columns[..., 6] = along * shapes[..., 0]
    columns[..., 7:11] = shapes[..., SHAPES:]
    columns[..., 11] = along * shapes[..., SHAPES]
    columns *= pixels.weight[..., None]
    columns[..., 12:] = np.moveaxis(pixels.levels, 0, -1)
    return columns


def _solve(pixels: RimPixels, circles: Circles, table: RimTable) -> tuple[Array, Array, Array]:
    """Gram matrices (N, S, 5 + L, ..) of what the basis leaves, coefficients (N, S, BASIS, L), pixel counts."""
    columns = _columns(pixels, circles, table)
    gram = (np.swapaxes(columns, 2, 3) @ columns).astype(np.float64)
    basis = gram[..., :BASIS, :BASIS] + 0.0
    trace = np.trace(basis, axis1=-2, axis2=-1)[..., None]
    diagonal = np.arange(BASIS)
    basis[..., diagonal, diagonal] += 1e-6 * trace + 1e-9
    right = gram[..., :BASIS, BASIS:]
    solved = np.linalg.solve(basis, right)
    rest = gram[..., BASIS:, BASIS:] - np.swapaxes(right, -1, -2) @ solved
    coefficients = solved[..., 5:]  # (N, S, BASIS, L)
    count: Array = pixels.weight.sum(axis=2).astype(np.float64)
    return np.asarray(rest), np.asarray(coefficients), count


def _sector_offsets(pixels: RimPixels, circles: Circles, table: RimTable) -> tuple[Array, Array]:
    """(N, S, L) outward offset of the rim in each sector and light, and its variance."""
    rest, coefficients, count = _solve(pixels, circles, table)
    slope = _pooled(coefficients[..., [1, 2, 3, 4, 6], :], pixels.azimuths_rad)
    dd = np.einsum("nskl,nskm,nsml->nsl", slope, rest[..., :5, :5], slope)
    de = np.einsum("nskl,nskl->nsl", slope, rest[..., :5, 5:])
    ee = np.einsum("nsll->nsl", rest[..., 5:, 5:])
    dd = np.maximum(dd, 1e-9)
    offset = de / dd
    left = np.maximum(ee - de * offset, 0.0) / np.maximum(count - BASIS - 1, 1)[..., None]
    variance = (left + NOISE_FLOOR**2) / dd
    bad = (count < 2 * BASIS)[..., None] | (np.moveaxis(pixels.clipped, 0, -1))
    variance = np.where(bad, np.inf, variance)
    return np.clip(offset, -3.0, 3.0), variance


def _pooled(slope: Array, azimuths_rad: Array) -> Array:
    """(N, S, 5, L) medians of the coefficients over all balls.

    The derivative must not come from the pixels that it is applied to: noise would enter twice and pull rims inward.
    """
    balls, _, terms, _ = slope.shape
    if balls >= POOL_BALLS:
        return np.broadcast_to(np.median(slope, axis=0), slope.shape)
    pooled = np.zeros((1, *slope.shape[1:]))
    mid = (np.arange(SECTORS) + 0.5) * (2 * math.pi / SECTORS)
    turn = np.rint((mid[:, None] - azimuths_rad) / (2 * math.pi / SECTORS)).astype(int) % SECTORS
    by_turn = np.zeros((SECTORS, terms))
    flat = np.moveaxis(slope, 2, 3)  # (N, S, L, 5)
    for index in range(SECTORS):
        here = flat[:, turn == index]
        if here.size:
            by_turn[index] = np.median(here.reshape(-1, terms), axis=0)
    pooled[0] = np.moveaxis(by_turn[turn], 2, 1)
    return np.broadcast_to(pooled, slope.shape)


def _left_over(pixels: RimPixels, circles: Circles, table: RimTable) -> tuple[Array, Array]:
    """(N, S, L) mean squared residual, each sector and light with its rim where it fits best; and the contrast."""
    rest, coefficients, count = _solve(pixels, circles, table)
    slope = coefficients[..., [1, 2, 3, 4, 6], :]
    dd = np.einsum("nskl,nskm,nsml->nsl", slope, rest[..., :5, :5], slope)
    de = np.einsum("nskl,nskl->nsl", slope, rest[..., :5, 5:])
    left = np.einsum("nsll->nsl", rest[..., 5:, 5:]) - de**2 / np.maximum(dd, 1e-9)
    return np.maximum(left, 0.0) / np.maximum(count - BASIS - 1, 1.0)[..., None], dd


def _update(circles: Circles, offset: Array, variance: Array) -> None:
    """One step of the three parameters of each circle, all sectors and lights together, outliers down-weighted."""
    mid = (np.arange(SECTORS) + 0.5) * (2 * math.pi / SECTORS)
    design = np.stack([np.cos(mid), np.sin(mid), np.ones(SECTORS)], axis=1)  # x right, y up, radius
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
    circles.u_centre_px = np.sqrt(
        np.maximum((noise[:, 0, 0] + noise[:, 1, 1]) / 2, 2.0 * scatter**2 / number) + (CENTRE_SHARE * scatter) ** 2
    )
    circles.u_radius_px = np.sqrt(
        np.maximum(noise[:, 2, 2], scatter**2 / number) + (RADIUS_SHARE * scatter) ** 2 + U_MODEL_PX**2
    )
