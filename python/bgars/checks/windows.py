"""Parts of a capture at full resolution, where shifts, blur and noise of single images are measured.

A matt pixel's values lie in the span of three images, whatever the surface is. What image j does wrong (a shift, a
blur) adds a known pattern times an unknown number; all numbers of all images are fitted at once to what the span
leaves over. Their errors come from the scatter of that fit over tiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.view import linear_values

if TYPE_CHECKING:
    from bgars.checks.view import View
    from bgars.records.capture import Capture

__all__ = ["FrameFit", "Windows", "cut_windows", "fit_frames"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SIDE_PX = 160
MOST = 3
TILE_PX = 20
SHADOWED, SHINES = 0.25, 2.2
"""Of the pixel's median: darker or brighter under a light is shadow or highlight, which moves with the light."""
GROW_PX = 3
"""Pixels around shadows and highlights that are left out, too."""
RIDGE = 1e-6
LEAST_SINGULAR = 0.2
"""Of the largest singular value: noise shares below are too alike to tell images apart."""
MIN_STEPS = 1000
"""Pairs of pixels that a noise is measured on: to 3 percent."""


@dataclass(frozen=True, eq=False)
class Windows:
    """(W, L, h, w) linear light over the pixel's usual level, and (W, h, w) pixels that take part."""

    values: Floats
    lit: Mask
    level: float
    """Usual level of a pixel, of full scale."""


@dataclass(frozen=True, eq=False)
class FrameFit:
    """What each image does wrong, with standard errors.

    Attributes
    ----------
    shift_px, u_shift_px : (L, 2) float64
        Displacement of the image's content, x right and y up.
    blur_px2, u_blur_px2 : (L,) float64
        Added variance of the blur; negative: sharper than the others.
    noise : (L,) float64
        Standard deviation of the noise, of full scale.
    tiles : float
    """

    shift_px: Array
    u_shift_px: Array
    blur_px2: Array
    u_blur_px2: Array
    noise: Array
    tiles: float


def cut_windows(capture: Capture, view: View) -> Windows | None:
    """Cut the windows with most detail of the mean image."""
    rows, cols = capture.mask.shape
    side = min(SIDE_PX, rows - 2, cols - 2)
    if side < 3 * TILE_PX:
        side = min(rows, cols) - 2
    if side < 2 * TILE_PX:
        return None
    corners = _best_corners(view, rows, cols, side)
    stacks, masks = [], []
    intensities = capture.rig.intensities.astype(np.float32)[:, None, None]
    for row, col in corners:
        at = np.s_[row : row + side, col : col + side]
        raw = capture.images[:, at[0], at[1]]
        value = linear_values(capture, raw, None if capture.dark is None else capture.dark[at]) / intensities
        stacks.append(value)
        masks.append(capture.mask[at] & ~(raw >= capture.saturation).any(axis=0))
    values = np.array(stacks)
    middle = np.maximum(np.median(values, axis=1), np.float32(1e-6))
    relative = values / middle[:, None]
    bad = (relative.min(axis=1) < SHADOWED) | (relative.max(axis=1) > SHINES) | ~np.array(masks)
    lit = ~_grown(bad | (middle < np.float32(4.0 / 255.0)))
    if not lit.any():
        return None
    level = float(np.median(middle[lit]))
    return Windows((values / np.float32(level)).astype(np.float32), lit, level)


def _best_corners(view: View, rows: int, cols: int, side: int) -> list[tuple[int, int]]:
    """First row and column of windows with the strongest gradients, apart from each other."""
    mean = view.mean * view.use
    across, down = np.abs(np.diff(mean, axis=1))[1:], np.abs(np.diff(mean, axis=0))[:, 1:]
    detail = np.minimum(across + down, 0.1)
    high, wide = detail.shape
    sums = np.pad(np.cumsum(np.cumsum(detail, axis=0), axis=1), ((1, 0), (1, 0)))
    candidates = []
    steps_down = np.linspace(0, rows - side, max(1, min(6, 2 * (rows - side) // side + 1))).astype(int)
    steps_right = np.linspace(0, cols - side, max(1, min(6, 2 * (cols - side) // side + 1))).astype(int)
    for row in steps_down:
        for col in steps_right:
            top, bottom = int(row * high / rows), int((row + side) * high / rows)
            left, right = int(col * wide / cols), int((col + side) * wide / cols)
            total = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
            candidates.append((float(total), int(row), int(col)))
    chosen: list[tuple[int, int]] = []
    for _, row, col in sorted(candidates, reverse=True):
        if all(abs(row - other[0]) >= side or abs(col - other[1]) >= side for other in chosen):
            chosen.append((row, col))
        if len(chosen) == MOST:
            break
    return chosen


def _grown(bad: Mask) -> Mask:
    grown = bad.copy()
    for _ in range(GROW_PX):
        wider = grown.copy()
        wider[:, 1:] |= grown[:, :-1]
        wider[:, :-1] |= grown[:, 1:]
        wider[:, :, 1:] |= grown[:, :, :-1]
        wider[:, :, :-1] |= grown[:, :, 1:]
        grown = wider
    return grown


def fit_frames(windows: Windows, lights: Array) -> FrameFit | None:
    """Fit shift and blur of every image, and measure its noise."""
    count = len(lights)
    left = np.eye(count) - lights @ np.linalg.pinv(lights)
    noise = _noise(windows, left)
    smooth = _smoothed(windows.values)
    lit = windows.lit[:, 3:-3, 3:-3]
    inner = smooth[..., 3:-3, 3:-3]
    right = 0.5 * (smooth[..., 3:-3, 4:-2] - smooth[..., 3:-3, 2:-4])
    up = 0.5 * (smooth[..., 2:-4, 3:-3] - smooth[..., 4:-2, 3:-3])
    bend = (
        smooth[..., 3:-3, 4:-2] + smooth[..., 3:-3, 2:-4] + smooth[..., 2:-4, 3:-3] + smooth[..., 4:-2, 3:-3]
    ) - 4.0 * inner
    patterns = np.stack([-right, -up, 0.5 * bend], axis=2)
    residual = np.tensordot(left.astype(np.float32), inner, axes=(1, 1)).transpose(1, 0, 2, 3)
    size = 3 * count
    normals, rights = [], []
    for window in range(len(lit)):
        for rows in _cuts(lit.shape[1]):
            for cols in _cuts(lit.shape[2]):
                mask = lit[window, rows, cols]
                if mask.sum() < TILE_PX:
                    continue
                pattern = patterns[window][:, :, rows, cols][:, :, mask].astype(np.float64)
                flat = pattern.reshape(size, -1)
                products = (flat @ flat.T).reshape(count, 3, count, 3) * left[:, None, :, None]
                normals.append(products.reshape(size, size))
                own = residual[window][:, rows, cols][:, mask].astype(np.float64)
                rights.append((pattern * own[:, None]).sum(axis=2).ravel())
    if len(normals) < 4:  # noqa: PLR2004 - tiles that make a scatter
        return None
    matrix = np.sum(normals, axis=0)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    inverse = np.linalg.pinv(matrix / scale[:, None] / scale[None, :] + RIDGE * np.eye(size), hermitian=True)
    inverse = inverse / scale[:, None] / scale[None, :]
    solution = inverse @ np.sum(rights, axis=0)
    spread = np.zeros((size, size))
    for one, two in zip(normals, rights, strict=True):
        off = two - one @ solution
        spread += np.outer(off, off)
    error = np.sqrt(np.maximum(np.diag(inverse @ spread @ inverse), 0.0)).reshape(count, 3)
    value = solution.reshape(count, 3)
    return FrameFit(value[:, :2], error[:, :2], value[:, 2], error[:, 2], noise * windows.level, float(len(normals)))


def _cuts(size: int) -> list[slice]:
    return [slice(first, min(first + TILE_PX, size)) for first in range(0, size, TILE_PX)]


def _smoothed(values: Floats) -> Floats:
    """Binomial filter of five pixels along both axes: its variance is 1 px^2, so that gradients reach over a pixel."""
    for _ in range(2):
        values = 0.25 * (np.roll(values, 1, axis=-1) + np.roll(values, -1, axis=-1)) + 0.5 * values
        values = 0.25 * (np.roll(values, 1, axis=-2) + np.roll(values, -1, axis=-2)) + 0.5 * values
    smooth: Floats = values
    return smooth


def _noise(windows: Windows, left: Array) -> Array:
    """(L,) noise over the usual level, from what the span leaves over between neighbouring pixels."""
    residual = np.tensordot(left.astype(np.float32), windows.values, axes=(1, 1))
    step = (residual[..., 1:] - residual[..., :-1]) / np.float32(2.0**0.5)
    both = windows.lit[..., 1:] & windows.lit[..., :-1]
    chosen = step[:, both]
    if chosen.shape[1] < MIN_STEPS:
        return np.zeros(len(left))
    mad = 1.4826 * np.median(np.abs(chosen), axis=1)
    measured, shares = mad.astype(np.float64) ** 2, left**2
    # What a few lights cannot tell apart (small singular values) is taken as common to all images.
    common = float(measured.sum() / shares.sum())
    own = np.linalg.lstsq(shares, measured - common * shares.sum(axis=1), rcond=LEAST_SINGULAR)[0]
    variance = common + own
    noise: Array = np.sqrt(np.maximum(variance, 0.0))
    return noise
