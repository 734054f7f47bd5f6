"""Which way green points in a normal map: the curl of its field tells.

Slopes ``p = dz/dx`` and ``q = dz/dy`` of a surface have ``dp/dy = dq/dx``; with green the wrong way round the two are
opposite. Their correlation is +1 on a noiseless surface of the right handedness, -1 on its mirror image, and 0 where
there is no torsion (a cylinder, a plane) or only noise.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["curl_agreement"]

LEAST_N_Z = 0.2
"""Slopes of steeper normals are mostly error."""
LARGEST_PART = 0.95
"""Of the derivatives: beyond are jumps, where the surface is not seen."""
SURE_SIGMA = 6.0
"""Of a sum of products of independent noise: once in a billion maps."""
LEAST_AGREEMENT = 0.1
LEAST_CELLS = 64


def curl_agreement(normals: FloatArray, usable: BoolArray) -> float:
    """From -1, green points down, to 1, green points up; 0 where that cannot be told.

    Derivatives are taken at pixels and at blocks of 2, 4, 8 and 16 of them: codes of 8 bits hide a gentle surface at
    pixels, and a fine relief vanishes in blocks. The scale that is surest counts.
    """
    use = usable & (normals[..., 2] > LEAST_N_Z)
    n_z = np.where(use, normals[..., 2], 1.0)
    p, q = (np.where(use, -normals[..., axis] / n_z, 0.0).astype(np.float64) for axis in (0, 1))
    best, surest = 0.0, SURE_SIGMA
    while min(use.shape) > 1:
        agreement, sigma = _at_one_scale(p, q, use)
        if sigma > surest and abs(agreement) > LEAST_AGREEMENT:
            best, surest = agreement, sigma
        p, q, use = _halved(p, use), _halved(q, use), _halved(use.astype(np.float64), use) > 1.0 - 1e-9
    return best


def _at_one_scale(p: NDArray[np.float64], q: NDArray[np.float64], use: BoolArray) -> tuple[float, float]:
    """Agreement of the two mixed derivatives in cells of four values, and how many sigma it is from none."""
    p_y = (p[:-1, :-1] + p[:-1, 1:] - p[1:, :-1] - p[1:, 1:]) / 2.0
    q_x = (q[:-1, 1:] + q[1:, 1:] - q[:-1, :-1] - q[1:, :-1]) / 2.0
    cells = use[:-1, :-1] & use[:-1, 1:] & use[1:, :-1] & use[1:, 1:]
    p_y, q_x = p_y[cells], q_x[cells]
    if p_y.size < LEAST_CELLS:
        return 0.0, 0.0
    size = np.maximum(np.abs(p_y), np.abs(q_x))
    small = size <= np.quantile(size, LARGEST_PART)
    p_y, q_x = p_y[small], q_x[small]
    products = p_y * q_x
    squares = float(np.sum(p_y**2 + q_x**2))
    spread = math.sqrt(float(np.sum(products**2)))
    if squares == 0.0 or spread == 0.0:
        return 0.0, 0.0
    total = float(products.sum())
    return 2.0 * total / squares, abs(total) / spread


def _halved(values: NDArray[np.float64], use: BoolArray) -> NDArray[np.float64]:
    """Means of blocks of two by two."""
    rows, cols = (size // 2 * 2 for size in use.shape)
    upper, lower = values[0:rows:2, :cols], values[1:rows:2, :cols]
    columns = upper + lower
    blocks: NDArray[np.float64] = (columns[:, ::2] + columns[:, 1::2]) / 4.0
    return blocks
