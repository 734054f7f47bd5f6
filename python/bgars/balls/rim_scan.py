"""Coarse circles: at which radius around a centre do most directions see an edge in several lights?"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

__all__ = ["CoarseCircles", "scan_rims"]

DIRECTIONS = 32
RADII = 56
SMALLEST, LARGEST = 0.3, 1.5
"""Radii to try, in scales of the centre."""
CHUNK = 256


class CoarseCircles(NamedTuple):
    """Circles to a pixel or two, N each, in array coordinates."""

    row: NDArray[np.float64]
    col: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    strength: NDArray[np.float64]
    share: NDArray[np.float64]


def scan_rims(
    levels: Levels, row: NDArray[np.float64], col: NDArray[np.float64], scale_px: NDArray[np.float64]
) -> CoarseCircles:
    """Find the circle of the strongest rim around each centre.

    An edge of a highlight, a shadow or a texture shows in one or two lights or on one side; the rim of a ball shows at
    the same radius in every direction, each time in about half of the lights. So: the third largest edge over lights,
    its lower quartile over directions, its maximum over radii.
    """
    parts = [
        _scan(levels, row[at : at + CHUNK], col[at : at + CHUNK], scale_px[at : at + CHUNK])
        for at in range(0, len(row), CHUNK)
    ]
    return CoarseCircles(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _scan(levels: Levels, row, col, scale_px) -> CoarseCircles:
    angle = (np.arange(DIRECTIONS) + 0.5) * (2 * math.pi / DIRECTIONS)
    ratio = np.geomspace(SMALLEST, LARGEST, RADII)
    row, col = row.copy(), col.copy()
    radius_px = scale_px.copy()
    wide = True
    for turn in range(3):
        radii = radius_px[:, None] * (ratio if wide else np.geomspace(0.75, 1.33, 33))
        edge = _edges(levels, row, col, radii, angle)  # (N, A, radii)
        if wide:
            blurred = np.maximum(edge, np.maximum(np.roll(edge, 1, axis=2), np.roll(edge, -1, axis=2)))
            quartile = np.quantile(blurred, 0.25, axis=1) + 0.25 * np.median(edge, axis=1)
            best = np.argmax(quartile[:, 1:-1], axis=1) + 1
            radius_px = np.take_along_axis(radii, best[:, None], axis=1)[:, 0]
            wide = False
        else:
            tent = np.maximum(0.02, 1.0 - np.abs(np.log(np.geomspace(0.75, 1.33, 33))) / (0.3 if turn == 1 else 0.15))
            pick = np.argmax(edge * tent, axis=2)
            weight = np.take_along_axis(edge, pick[..., None], axis=2)[..., 0]
            found = np.take_along_axis(radii[:, None, :] + 0 * edge, pick[..., None], axis=2)[..., 0]
            step = _circle_step(found - radius_px[:, None], weight, angle, radius_px)
            col += step[:, 0]
            row -= step[:, 1]
            radius_px = radius_px + step[:, 2]
    radii = radius_px[:, None] * np.geomspace(0.6, 1.5, 37)
    edge = _edges(levels, row, col, radii, angle)
    middle = int(np.argmin(np.abs(np.geomspace(0.6, 1.5, 37) - 1.0)))
    rim = edge[:, :, middle - 2 : middle + 3].max(axis=2)
    typical = np.median(edge, axis=2)
    share = (rim > 2.0 * typical + 0.15).mean(axis=1)
    return CoarseCircles(row, col, radius_px, np.quantile(rim, 0.25, axis=1), share)


def _edges(levels: Levels, row, col, radii, angle):
    """(N, A, radii) third largest over lights of the change of sqrt(level) from ring to ring."""
    r = np.rint(row[:, None, None] - np.sin(angle)[:, None] * radii[:, None, :]).astype(np.int64)
    c = np.rint(col[:, None, None] + np.cos(angle)[:, None] * radii[:, None, :]).astype(np.int64)
    inside = (r >= 0) & (r < levels.height) & (c >= 0) & (c < levels.width)
    pixels = np.where(inside, r * levels.width + c, 0)
    value = np.sqrt(np.maximum(levels.at(pixels), 0.0) + 1.0)
    edge = np.zeros_like(value)
    edge[..., 1:-1] = np.abs(value[..., 2:] - value[..., :-2])
    edge[..., 1:-1] *= inside[:, :, 2:] & inside[:, :, :-2]
    rank = max(1, round(len(value) * 3 / 8))
    return np.partition(edge, len(value) - rank, axis=0)[len(value) - rank]


def _circle_step(residual, weight, angle, radius_px):
    design = np.stack([np.cos(angle), np.sin(angle), np.ones(len(angle))], axis=1)
    step = np.zeros((len(residual), 3))
    use = weight
    for _ in range(6):
        normal = np.einsum("na,ai,aj->nij", use, design, design) + 1e-6 * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("na,na,ai->ni", use, residual, design)[..., None])[..., 0]
        left = (residual - step @ design.T) / (0.05 * radius_px[:, None])
        use = weight / (1.0 + left**2) ** 2
    limit = 0.3 * radius_px[:, None]
    return np.clip(step, -limit, limit)
