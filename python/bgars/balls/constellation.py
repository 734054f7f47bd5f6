"""Balls by their highlights alone: the spots of all lights form one figure, as large as the ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.balls.highlights import MIN_CONTRAST, HighlightCircles, half_vectors, highlight_circles
from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels
    from bgars.records.pixels import FloatArray

    Array = NDArray[np.float64]

__all__ = ["shining_circles"]

SIZES = np.geomspace(0.7, 5.0, 28)
"""Radii to try, in scales of a centre: the slopes of metal are those of its highlights, well inside the ball."""
REACH = 0.12
"""How far from its place a spot still counts, in radii: centres are rough, and spots are no points."""
LEAST_RANK = 0.25
"""Of the lights, how many may show no spot: hidden by a neighbour, clipped, or lost in dirt."""
TOP = 0.8
"""Of the best figure's contrast, what others of a plateau of sizes have: its middle is taken."""
NEAR, SAME = 0.2, 0.5
"""Distance of centres, in radii, that see the same figure, and of figures that are the same ball."""


def shining_circles(levels: Levels, reduced: FloatArray, row: Array, col: Array, scale_px: Array) -> HighlightCircles:
    """Circles whose highlights stand where a sphere mirrors each light, one per place, in full pixels.

    A sphere mirrors light k at c + R h_k, with h_k the half vector of light and view (Torrance and Sparrow 1967). The
    contrast of a figure is that of its weakest spots but a quarter, each against the median of all lights at its place:
    texture, rims and board are in it, and no spot of another light.

    Parameters
    ----------
    levels : Levels
        The capture.
    reduced : (L, H, W) float32
        Its reduced images.
    row, col, scale_px : (N,) float64
        Rough centres and scales, in pixels of `reduced`.
    """
    factor = levels.height // reduced.shape[1]
    contrast = (reduced - light_median(reduced)).astype(np.float32)
    half = half_vectors(levels, (row + 0.5) * factor - 0.5, (col + 0.5) * factor - 0.5)
    radii = scale_px[:, None] * SIZES
    figure = _weakest(contrast, row, col, radii, half)
    best = figure.max(axis=1)
    plateau = figure >= TOP * np.maximum(best, MIN_CONTRAST)[:, None]
    size = np.exp((np.log(radii) * plateau).sum(axis=1) / np.maximum(plateau.sum(axis=1), 1))
    index = np.flatnonzero(best > MIN_CONTRAST)
    index = index[np.argsort(-best[index], kind="stable")]
    index = index[_apart(row[index], col[index], size[index], NEAR)]
    # Windows are as large as the usual ball: the sizes of each call must be alike.
    octave = np.rint(np.log2(size[index]))
    found = []
    for group in (index[octave == step] for step in np.unique(octave)):
        start = (row[group] + 0.5) * factor - 0.5, (col[group] + 0.5) * factor - 0.5, size[group] * factor
        found.append((np.stack(highlight_circles(levels, *start)), best[group]))
    if not found:
        return HighlightCircles(*np.zeros((5, 0)))
    circles, contrasts = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    order = np.argsort(-contrasts, kind="stable")
    shine = HighlightCircles(*circles[:, order[np.isfinite(circles[2, order])]])
    keep = _apart(shine.row, shine.col, shine.radius_px, SAME)
    return HighlightCircles(*(column[keep] for column in shine))


def _apart(row: Array, col: Array, size: Array, share: float) -> NDArray[np.intp]:
    """Indices of circles (best first) whose centre is not within a share of the size of a better one's."""
    keep: list[int] = []
    for at in range(len(row)):
        apart = np.hypot(row[keep] - row[at], col[keep] - col[at])
        if not (apart < share * np.minimum(size[keep], size[at])).any():
            keep.append(at)
    return np.array(keep, np.intp)


def _weakest(contrast: FloatArray, row: Array, col: Array, radii: Array, half: Array) -> Array:
    """(N, K) contrast of the weakest spots but some of the figures of these radii around each centre."""
    lights, height, width = contrast.shape
    step = np.maximum(REACH * radii, 1.0)[..., None]
    spots = np.full((*radii.shape, lights), -np.inf, np.float32)
    light = np.arange(lights)
    for down in (-1.0, 0.0, 1.0):
        for right in (-1.0, 0.0, 1.0):
            r = np.rint(row[:, None, None] - radii[..., None] * half[:, None, :, 1] + down * step).astype(np.intp)
            c = np.rint(col[:, None, None] + radii[..., None] * half[:, None, :, 0] + right * step).astype(np.intp)
            seen = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            here = contrast[light, r.clip(0, height - 1), c.clip(0, width - 1)]
            spots = np.maximum(spots, np.where(seen, here, -np.inf))
    rank = int(LEAST_RANK * lights)
    weakest: Array = np.partition(spots, rank, axis=2)[..., rank]
    return weakest
