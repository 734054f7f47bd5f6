r"""How far all edges of shadows are off together because grey levels are rounded, and cut off at zero.

Noise makes the mean of rounded levels right. Without noise a smooth board, or a black shadow, reads the same wrong
level everywhere, while the slope of the edge between them, which passes through many levels, reads right. With Gaussian
noise of standard deviation sigma the mean of levels rounded to steps q is off, RMS over all levels, by at most

    q / sqrt 12  exp(-2 pi^2 sigma^2 / q^2)

(q / sqrt 12 without noise; with it the first harmonic remains: Widrow & Kollar, "Quantization noise", 2008), and noise
around a level m cut off at zero lifts its mean by sigma phi(m / sigma) - m Phi(-m / sigma). A level off by e moves the
fitted edge by about EDGE e s / c with s the spread and c the contrast: the same way on all balls.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.inspection.radiance import Radiance
    from bgars.inspection.shadow_edges import Edges

__all__ = ["edge_bias_px"]

Array = NDArray[np.float64]

EDGE = 2.0
"""Move of the fitted edge in s e / c: 0.9 to 2.3 for lit levels of 19 to 24 that are rounded without noise."""
BESIDE_SIGMAS, BESIDE_PX = 3.0, 1.5
"""How far outside the edge the board is lit."""
PLATEAU_SHARE = 0.25
"""Levels farther from the usual one, over the contrast, are something else: another shadow, a ball."""
INV_SQRT_2PI = 0.3989422804014327


def edge_bias_px(radiance: Radiance, edges: Edges, spread_px: float) -> float:
    """Standard uncertainty of the place of all shadow edges together, by rounding and cut-off.

    Parameters
    ----------
    radiance : Radiance
        The images.
    edges : Edges
        Measured with them.
    spread_px : float
        Standard deviation of a sharp edge.
    """
    known = np.isfinite(edges.contrast_levels)
    if not known.any() or radiance.capture.images.dtype.kind == "f":
        return 0.0
    contrast = edges.contrast_levels[known]
    high = contrast * edges.high[known] / (edges.high[known] - edges.low[known])
    noise = float(np.median(edges.noise_levels[known.any(axis=2)]))
    step = _step_levels(radiance, float(np.median(high)))
    smooth = max(_scatter_levels(radiance, edges, spread_px) ** 2 - step**2 / 12.0, 0.0)
    rounding = step / np.sqrt(12.0) * np.exp(-2.0 * np.pi**2 * smooth / step**2)
    # Boards that read many different levels are wrong by as many different roundings.
    _, counts = np.unique(np.rint(high / step), return_counts=True)
    rounding *= float(np.sqrt(np.square(counts / counts.sum()).sum()))
    low = max(float(np.median(high - contrast)), 0.0)
    # Black is lifted by no more than it reads.
    lifted = min(_lifted(low, noise, _pedestal_levels(radiance)), low)
    return EDGE * spread_px * float(np.hypot(rounding, lifted)) / float(np.median(contrast))


def _scatter_levels(radiance: Radiance, edges: Edges, spread_px: float) -> float:
    """Standard deviation of the codes of lit board beside the edges: what the residuals at an edge are is no guide."""
    known = np.isfinite(edges.contrast_levels)
    number = np.maximum(known.sum(axis=2, keepdims=True), 1)
    x, y = (
        (edges.x - edges.x.sum(axis=2, keepdims=True) / number),
        (edges.y - edges.y.sum(axis=2, keepdims=True) / number),
    )
    farther = 1.0 + (BESIDE_SIGMAS * spread_px + BESIDE_PX) / np.maximum(np.hypot(x, y), 1.0)
    row = np.rint(radiance.row(edges.y + (farther - 1.0) * y)).astype(np.intp)
    col = np.rint(radiance.col(edges.x + (farther - 1.0) * x)).astype(np.intp)
    use = known & (row >= 0) & (row < radiance.height) & (col >= 0) & (col < radiance.width)
    light = np.broadcast_to(np.arange(radiance.lights)[:, None], use.shape)[use]
    levels = radiance.under(light, row[use] * radiance.width + col[use]) / radiance.scale
    light, levels = light[np.isfinite(levels)], levels[np.isfinite(levels)]  # clipped ones say nothing
    usual = np.array(
        [np.median(levels[light == index]) if (light == index).any() else 0.0 for index in range(radiance.lights)]
    )
    off = levels - usual[light]
    off = off[np.abs(off) < PLATEAU_SHARE * float(np.median(edges.contrast_levels[known]))]
    return float(np.sqrt(np.mean(np.square(off)))) if off.size else 0.0


def _step_levels(radiance: Radiance, level: float) -> float:
    """Step from code to code at a linear level, in grey levels of 255."""
    table = radiance.capture.response
    if table is None:
        return 1.0 / radiance.scale
    code = int(np.clip(np.searchsorted(table, level * radiance.scale), 1, len(table) - 1))
    return max(float(table[code] - table[code - 1]) / radiance.scale, 1e-6)


def _pedestal_levels(radiance: Radiance) -> float:
    """Codes that no light reads, over a grey level of 255."""
    dark = radiance.capture.dark
    return float(radiance.capture.black_level if dark is None else np.median(dark)) / radiance.scale


def _lifted(low: float, noise: float, pedestal: float) -> float:
    """Rise of the mean of a shadow's level where noise is cut off at zero."""
    if noise <= 0.0:
        return 0.0
    above = (max(low - INV_SQRT_2PI * noise, 0.0) + pedestal) / noise
    return noise * float(INV_SQRT_2PI * np.exp(-0.5 * above**2) - 0.5 * above * math.erfc(above / math.sqrt(2.0)))
