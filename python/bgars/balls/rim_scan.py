"""Coarse circles: the radius around a centre where most directions see an edge in several lights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars import _bgars

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.pixels import FloatArray

    Array = NDArray[np.floating]

__all__ = ["CoarseCircles", "scan_rims", "seen_by_most"]

DIRECTIONS = 24
RADII = 48
PEAK_ADVANTAGE = 100.0
AROUND_RIM = np.geomspace(0.78, 1.28, 21)
RIM_BINS = np.flatnonzero(np.abs(np.log(AROUND_RIM)) < 0.06)  # noqa: PLR2004 - of the radius
BESIDE_BINS = np.flatnonzero(np.abs(np.log(AROUND_RIM)) > 0.09)  # noqa: PLR2004 - of the radius
SIDE = 4
"""Radii between a rim and what must be smoother than it."""
DARK_LEVELS = 0.3
"""Grey levels added before the square root, which evens out the noise."""
SOME, MOST = 3 / 8, 5 / 8
"""Shares of the lights: that show a rim for certain, and that show no ends of shadows."""


class CoarseCircles(NamedTuple):
    """Circles to a pixel or two, N each, in array coordinates."""

    row: NDArray[np.float64]
    col: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    strength: NDArray[np.float64]
    share: NDArray[np.float64]


def scan_rims(
    image: FloatArray,
    row: NDArray[np.float64],
    col: NDArray[np.float64],
    scale_px: NDArray[np.float64],
    *,
    span: tuple[float, float] = (0.3, 1.5),
    rims: int = 2,
    threads: int | None = None,
) -> CoarseCircles:
    """Find the circle of the strongest rim around each centre.

    An edge of a highlight, a shadow or a texture shows in one or two lights or on one side; the rim of a ball shows at
    the same radius in every direction, each time in about half of the lights. So: the third largest edge over lights,
    its lower quartile over directions, its maximum over radii, less the edges farther in and out, because shading is
    smooth and a rim is sharp.

    Parameters
    ----------
    image : (L, H, W) float32
        Linear grey levels of 255.
    row, col, scale_px : (N,) float64
        Centres and scales, in pixels of `image`.
    span : (float, float)
        Radii to try, in scales.
    rims : int
        Radii to follow up for each centre.
    threads : int, optional
        Largest number of threads; by default one per core.
    """
    if not len(row):
        return CoarseCircles(*(np.zeros(0) for _ in range(5)))
    roots = _roots(image)

    def edges(row: Array, col: Array, radii: Array) -> FloatArray:
        return _edges(roots, row, col, radii, SOME, threads)

    angle = (np.arange(DIRECTIONS) + 0.5) * (2 * math.pi / DIRECTIONS)
    radii = scale_px[:, None] * np.geomspace(span[0], span[1], RADII)
    edge = edges(row, col, radii)
    wide = np.maximum(edge, np.maximum(np.roll(edge, 1, axis=2), np.roll(edge, -1, axis=2)))
    profile = np.quantile(wide, 0.25, axis=1) + 0.25 * np.median(edge, axis=1)
    around = np.pad(profile, ((0, 0), (SIDE, SIDE)), mode="edge")
    sharp = profile - 0.5 * (around[:, : -2 * SIDE] + around[:, 2 * SIDE :])
    around = np.pad(sharp, ((0, 0), (2, 2)), constant_values=-np.inf)
    neighbours = np.max([around[:, shift : shift + RADII] for shift in (0, 1, 3, 4)], axis=0)
    sharp = np.where(sharp >= neighbours, sharp, sharp - PEAK_ADVANTAGE)
    best = np.argsort(-sharp[:, 1:-1], axis=1)[:, :rims] + 1
    radius_px = np.take_along_axis(radii, best, axis=1).ravel()
    row, col = np.repeat(row, rims).astype(np.float64), np.repeat(col, rims).astype(np.float64)
    near = np.geomspace(0.75, 1.33, 33)
    for reach in (0.3, 0.15):
        radii = radius_px[:, None] * near
        edge = edges(row, col, radii)
        pick = np.argmax(edge * np.maximum(0.02, 1.0 - np.abs(np.log(near)) / reach), axis=2)
        weight = np.take_along_axis(edge, pick[..., None], axis=2)[..., 0]
        found = np.take_along_axis(radii, pick, axis=1)
        step = _circle_step(found - radius_px[:, None], weight, angle, radius_px)
        col += step[:, 0]
        row -= step[:, 1]
        radius_px = radius_px + step[:, 2]
    edge = edges(row, col, radius_px[:, None] * AROUND_RIM)
    rim = edge[:, :, RIM_BINS].max(axis=2)
    beside = np.median(edge[:, :, BESIDE_BINS], axis=2)
    share = (rim > 1.5 * beside + 0.08).mean(axis=1)
    return CoarseCircles(
        np.asarray(row, np.float64),
        np.asarray(col, np.float64),
        radius_px,
        np.quantile(rim - beside, 0.25, axis=1),
        share,
    )


def seen_by_most(image: FloatArray, circles: CoarseCircles, threads: int | None = None) -> NDArray[np.float64]:
    """(N,) edges of circles that most lights show, the lower quartile over directions: small where shadows end.

    Parameters
    ----------
    image : (L, H, W) float32
        Linear grey levels of 255.
    circles : CoarseCircles
    threads : int, optional
    """
    if not len(circles.row):
        return np.zeros(0)
    radii = circles.radius_px[:, None] * AROUND_RIM[RIM_BINS]
    edge = _edges(_roots(image), circles.row, circles.col, radii, MOST, threads)
    seen: NDArray[np.float64] = np.quantile(edge.max(axis=2), 0.25, axis=1)
    return seen


def _roots(image: FloatArray) -> FloatArray:
    roots: FloatArray = np.sqrt(np.maximum(image, 0.0) + np.float32(DARK_LEVELS))
    return roots


def _edges(roots: FloatArray, row: Array, col: Array, radii: Array, share: float, threads: int | None) -> FloatArray:
    """(N, A, radii) changes of sqrt(level) from ring to ring that a share of the lights shows."""
    rank = max(1, round(len(roots) * share))
    centres = np.stack([row, col], axis=1).astype(np.float64)
    return _bgars.ring_edges(
        roots, centres, np.asarray(radii, np.float64), directions=DIRECTIONS, rank=rank, threads=threads
    )


def _circle_step(residual: Array, weight: FloatArray, angle: Array, radius_px: Array) -> Array:
    """Shift right, shift up and growth that bring a circle onto rims found by direction, robustly."""
    design = np.stack([np.cos(angle), np.sin(angle), np.ones(len(angle))], axis=1)
    step = np.zeros((len(residual), 3))
    use = weight
    for _ in range(6):
        normal = np.einsum("na,ai,aj->nij", use, design, design) + 1e-6 * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("na,na,ai->ni", use, residual, design)[..., None])[..., 0]
        left = (residual - step @ design.T) / (0.05 * radius_px[:, None])
        use = weight / (1.0 + left**2) ** 2
    limit = 0.3 * radius_px[:, None]
    clipped: Array = np.clip(step, -limit, limit)
    return clipped
