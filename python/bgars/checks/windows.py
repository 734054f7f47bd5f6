"""Parts of a capture at full resolution, where the noise of single images is measured.

A matt pixel's values lie in the span of three images, whatever the surface is; what the span leaves over between
neighbours is noise.
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

__all__ = ["Windows", "cut_windows", "noise_of"]

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


def noise_of(windows: Windows, lights: Array) -> Array:
    """(L,) standard deviation of each image's noise, of full scale; 0 where too few pixels tell it.

    From what the span of three images leaves over between neighbouring pixels.
    """
    left = np.eye(len(lights)) - lights @ np.linalg.pinv(lights)
    residual = np.einsum("kl,wlij->kwij", left.astype(np.float32), windows.values)
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
    noise: Array = np.sqrt(np.maximum(variance, 0.0)) * windows.level
    return noise
