"""Where balls may be: centres from which the surface slopes away on all sides."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import fft, ndimage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records import FloatArray
    from bgars.rig import LightRig

__all__ = ["Centre", "outward_centres", "slope_field"]

SMALLEST_PX = 4.0
SCALE_STEP = 1.35
MIN_SCORE = 0.13
MAX_CENTRES = 3000


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
    normal = (inverse @ levels.reshape(lights, -1)).reshape(3, height, width)
    length = np.sqrt(np.sum(normal**2, axis=0) + np.float32(floor) ** 2)
    black = normal[2] < floor
    slopes = [np.where(black & (np.abs(normal[i]) < floor), 0.0, normal[i] / length - board[i]) for i in (0, 1)]
    return slopes[0].astype(np.float32), slopes[1].astype(np.float32)


def outward_centres(slope_x: FloatArray, slope_y: FloatArray) -> list[Centre]:
    """Maxima over place and scale of the mean outward slope within a disc, best first.

    A sphere that fills the disc scores 2/3, a board 0, a gap between balls less than 0.
    """
    height, width = slope_x.shape
    largest_px = min(height, width) / 2
    scales_px: list[float] = []
    scale_px = SMALLEST_PX
    while scale_px <= largest_px:
        scales_px.append(scale_px)
        scale_px *= SCALE_STEP
    stack = np.zeros((len(scales_px), height, width), np.float32)
    for index, scale_px in enumerate(scales_px):
        step = max(1, int(scale_px // 10))
        stack[index] = _outward_mean(slope_x, slope_y, scale_px, step)
    centres = []
    for index, scale_px in enumerate(scales_px):
        score = stack[index]
        size = 2 * max(1, int(0.35 * scale_px)) + 1
        peak = (score == ndimage.maximum_filter(score, size)) & (score > MIN_SCORE)
        for row, col in np.argwhere(peak):
            centres.append(Centre(float(row), float(col), scale_px, float(score[row, col])))
    return sorted(centres, key=lambda centre: -centre.score)[:MAX_CENTRES]


def _outward_mean(slope_x: FloatArray, slope_y: FloatArray, scale_px: float, step: int) -> FloatArray:
    """Mean over a disc of the slope along the direction from its centre, on every step-th pixel, interpolated."""
    full_shape = slope_x.shape
    if step > 1:
        slope_x, slope_y = (
            ndimage.uniform_filter(slope, step)[step // 2 :: step, step // 2 :: step] for slope in (slope_x, slope_y)
        )
    radius = scale_px / step
    reach = int(np.ceil(radius))
    x, y = np.meshgrid(np.arange(-reach, reach + 1), np.arange(reach, -reach - 1, -1))
    distance = np.hypot(x, y)
    inside = np.clip(radius + 0.5 - distance, 0.0, 1.0)
    unit = np.where(distance > 0, inside / np.maximum(distance, 1e-6), 0.0)
    area = inside.sum()
    score = _correlate(slope_x, (x * unit / area).astype(np.float32)) + _correlate(
        slope_y, (y * unit / area).astype(np.float32)
    )
    if step > 1:
        row = (np.arange(full_shape[0]) - step // 2) / step
        col = (np.arange(full_shape[1]) - step // 2) / step
        score = ndimage.map_coordinates(score, np.meshgrid(row, col, indexing="ij"), order=1, mode="nearest")
    return score


def _correlate(image: FloatArray, kernel: NDArray[np.float32]) -> FloatArray:
    """Correlation of the image's size, zeros outside."""
    shape = [fft.next_fast_len(n + k - 1, real=True) for n, k in zip(image.shape, kernel.shape, strict=True)]
    spectrum = fft.rfft2(image, shape) * fft.rfft2(kernel[::-1, ::-1], shape)
    full = fft.irfft2(spectrum, shape)
    top, left = (k // 2 for k in kernel.shape)
    correlation: FloatArray = full[top : top + image.shape[0], left : left + image.shape[1]]
    return correlation
