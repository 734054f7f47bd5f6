"""Where balls may be: centres from which the surface slopes away on all sides."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.balls.levels import block_means

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.records.pixels import FloatArray
    from bgars.records.rig import LightRig

__all__ = ["Centre", "outward_centres", "slope_field"]

SMALLEST_PX = 4.0
"""Smallest radius that is looked for, in pixels of the reduced images."""
SCALE_STEP = 1.35
STEPS_PER_SCALE = 10
"""Least pixels a scale has: larger ones are looked for in coarser slopes."""
MIN_SCORE = 0.13
"""Mean outward slope of a centre; a sphere that fills its disc has 0.67, a board 0."""
MAX_CENTRES = 3000
BLAS_ALONE = 1 << 18
"""Multiplications of a product up to which BLAS works on one thread."""


class Centre(NamedTuple):
    """A place that slopes look away from, in pixels of the reduced images."""

    row: float
    col: float
    scale_px: float
    score: float


def slope_field(
    levels: FloatArray, rig: LightRig, pixel_um: float | None, floor: float
) -> tuple[FloatArray, FloatArray]:
    """Components x and y of the unit normal of least squares over all lights, (H, W) float32; 0 where all is black.

    It is no accurate normal: highlights, attached and cast shadows all pull it away from the centre of a ball, and so
    it is outward whatever the ball is made of (Woodham 1980, eq. 10, taken beyond its range).

    Parameters
    ----------
    levels : (L, H, W) float32
        Linear grey levels over intensity.
    rig : LightRig
        The lights.
    pixel_um : float or None
        Size of a pixel of `levels`, needed for near lights.
    floor : float
        Grey levels that count as nothing.
    """
    inverse = np.linalg.pinv(rig.directions).astype(np.float32)
    lights, height, width = levels.shape
    if rig.positions_um is not None and rig.intensity_distance_um is not None and pixel_um is not None:
        levels = levels.copy()
        board = np.zeros((3, height, width), np.float32)
        x_um = ((np.arange(width) + 0.5 - width / 2) * pixel_um).astype(np.float32)[None, :]
        y_um = ((height / 2 - np.arange(height) - 0.5) * pixel_um).astype(np.float32)[:, None]
        for light in range(lights):
            x, y, z = rig.positions_um[light]
            distance = np.sqrt((x - x_um) ** 2 + (y - y_um) ** 2 + z**2)
            levels[light] *= ((distance / rig.intensity_distance_um[light]) ** 2).astype(np.float32)
            board += inverse[:, light, None, None] * (z / distance).astype(np.float32)
        board /= np.sqrt(np.sum(board**2, axis=0))
    else:
        board = (inverse @ rig.directions[:, 2].astype(np.float32))[:, None, None]
        board = board / np.linalg.norm(board)
    normal = np.einsum("cl,lhw->chw", inverse, levels)
    length = np.sqrt(np.sum(normal**2, axis=0) + np.float32(floor) ** 2)
    black = normal[2] < floor
    slopes = [np.where(black & (np.abs(normal[i]) < floor), 0.0, normal[i] / length - board[i]) for i in (0, 1)]
    return slopes[0].astype(np.float32), slopes[1].astype(np.float32)


def outward_centres(slope_x: FloatArray, slope_y: FloatArray) -> list[Centre]:
    """Maxima over place and scale of the mean outward slope within a disc, best first.

    A sphere that fills the disc scores 2/3, a board 0, a gap between balls less than 0.
    """
    largest_px = min(slope_x.shape) / 2
    scales_px: list[float] = []
    scale_px = SMALLEST_PX
    while scale_px <= largest_px:
        scales_px.append(scale_px)
        scale_px *= SCALE_STEP
    centres = []
    for step, group in groupby(scales_px, lambda scale_px: max(1, int(scale_px // STEPS_PER_SCALE))):
        coarse = [block_means(slope, step) for slope in (slope_x, slope_y)]
        for scale_px, score in _outward_means(coarse, [(scale_px, scale_px / step) for scale_px in group]):
            size = 2 * max(1, int(0.35 * scale_px) // step) + 1
            peak = (score == _largest_around(score, size // 2)) & (score > MIN_SCORE)
            for row, col in np.argwhere(peak).tolist():
                value = float(score[row, col])
                centres.append(Centre(row * step + step // 2, col * step + step // 2, scale_px, value))
    return sorted(centres, key=lambda centre: -centre.score)[:MAX_CENTRES]


def _outward_means(slopes: list[FloatArray], scales: list[tuple[float, float]]) -> Iterator[tuple[float, FloatArray]]:
    """Each scale with the mean over its disc of the slope along the direction from the centre, zeros outside.

    Parameters
    ----------
    slopes : two (H, W) float32
        Slopes along x and y.
    scales : list of (float, float)
        Name of a scale, and its radius in pixels of `slopes`; ascending.
    """
    height, width = slopes[0].shape
    margin = 2 * math.ceil(scales[-1][1])
    shape = [_fast_length(side + margin) for side in (height, width)]
    # For all scales the same.
    along_x, along_y = (np.fft.rfft2(slope, shape) for slope in slopes)
    waves = [2.0 * np.pi / shape[0] * np.arange(shape[0]), 2.0 * np.pi / shape[1] * np.arange(shape[1] // 2 + 1)]
    for scale_px, radius in scales:
        reach = math.ceil(radius)
        side = np.arange(-reach, reach + 1, dtype=np.float32)
        distance = np.hypot(side, side[:, None])
        inside = np.clip(np.float32(radius + 0.5) - distance, 0.0, 1.0)
        outward = inside / (np.maximum(distance, np.float32(1e-6)) * inside.sum())
        # Odd along one axis and even along the other: sums of sines and cosines, an eighth of a transform's time. They
        # are mirrored, because convolution mirrors: x falls along columns, y (up) grows along rows.
        down, across = (np.outer(wave, side).astype(np.float32) for wave in waves)
        kernel_x = _product(np.cos(down), (outward * side) @ np.sin(across).T)
        kernel_y = _product(np.sin(down), (outward * side[:, None]) @ np.cos(across).T)
        mean = np.fft.irfft2(np.complex64(1j) * (kernel_x * along_x - kernel_y * along_y), shape)
        yield scale_px, mean[:height, :width].astype(np.float32)


def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    """Matrix product, some rows at a time: large ones wake the threads of BLAS, which spin for longer than it takes."""
    parts = math.ceil(left.size * right.shape[1] / BLAS_ALONE)
    product: FloatArray = np.concatenate([rows @ right for rows in np.array_split(left, parts)])
    return product


def _largest_around(values: FloatArray, reach: int) -> FloatArray:
    """The largest value of the square that reaches so far on all sides, cut off at the edge of the image."""
    for axis in (0, 1):
        rest = [(0, 0), (0, 0)]
        rest[axis] = (reach, reach)
        lined = np.moveaxis(np.pad(values, rest, constant_values=-np.inf), axis, 0)
        width, window = 1, 2 * reach + 1
        while width < window:
            # Windows of twice the width are two that lie beside each other, or overlap.
            step = min(width, window - width)
            lined = np.maximum(lined[:-step], lined[step:])
            width += step
        values = np.moveaxis(lined, 0, axis)
    return values


def _fast_length(least: int) -> int:
    """The smallest length from `least` on whose transform is fast: its only factors are 2, 3 and 5."""
    lengths: list[int] = [
        rest << max(0, math.ceil(math.log2(least / rest)))
        for rest in (3**threes * 5**fives for threes in range(12) for fives in range(9))
    ]
    return min(lengths)
