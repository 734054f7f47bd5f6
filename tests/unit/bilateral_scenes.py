"""Surfaces in closed form for the tests of bilateral integration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def unit(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals of length 1."""
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def terrace(size: int = 60, step_px: float = 12.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A wavy ground with a raised disc on it: height in pixels, and normals that know nothing of the jump."""
    row, col = np.indices((size, size))
    x, y = col - size / 2 + 0.5, size / 2 - row - 0.5
    u, v = x / 9.0, y / 11.0
    height = 2.0 * np.sin(u) * np.cos(v) + step_px * (np.hypot(x, y) < size / 4)
    slope_x, slope_y = 2.0 / 9.0 * np.cos(u) * np.cos(v), -2.0 / 11.0 * np.sin(u) * np.sin(v)
    return height, unit(np.stack([-slope_x, -slope_y, np.ones(height.shape)], axis=-1))


def camera_matrix(size: int) -> NDArray[np.float64]:
    """A short lens, with pixels that are not square and a principal point off the centre."""
    return np.array([[1.4 * size, 0, 0.55 * size], [0, 1.6 * size, 0.4 * size], [0, 0, 1]])


def rays(size: int) -> NDArray[np.float64]:
    """(H, W, 3) viewing rays of that camera: x right, y up, one away from it."""
    (f_x, _, c_x), (_, f_y, c_y), _ = camera_matrix(size)
    row, col = np.indices((size, size))
    return np.stack([(col - c_x) / f_x, (c_y - row) / f_y, -np.ones(row.shape)], axis=-1)
