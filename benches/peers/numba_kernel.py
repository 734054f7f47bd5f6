"""The normal kernel in numba, tuned: one pass, planar rows, a sorting network in registers, a table of inverses.

Written from the method (sort, cut at the first gap, least squares on what is left), in float32, for 8 lights of 8 bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np
from subsets import subset_inverses

if TYPE_CHECKING:
    from numpy.typing import NDArray


@numba.njit(inline="always")
def order(a, b):  # noqa: ANN001, ANN201 - numba types it
    """Compare and exchange."""
    return min(a, b), max(a, b)


@numba.njit(inline="always")
def cutoff(v0, v1, v2, v3, v4, v5, v6, v7, gap):  # noqa: ANN001, ANN201 - numba types it
    """Greatest value kept: Batcher's 19 exchanges, then the first gap from the third value on."""
    v0, v1 = order(v0, v1)
    v2, v3 = order(v2, v3)
    v4, v5 = order(v4, v5)
    v6, v7 = order(v6, v7)
    v0, v2 = order(v0, v2)
    v1, v3 = order(v1, v3)
    v4, v6 = order(v4, v6)
    v5, v7 = order(v5, v7)
    v1, v2 = order(v1, v2)
    v5, v6 = order(v5, v6)
    v0, v4 = order(v0, v4)
    v1, v5 = order(v1, v5)
    v2, v6 = order(v2, v6)
    v3, v7 = order(v3, v7)
    v2, v4 = order(v2, v4)
    v3, v5 = order(v3, v5)
    v1, v2 = order(v1, v2)
    v3, v4 = order(v3, v4)
    v5, v6 = order(v5, v6)
    cut = v7
    cut = v6 if v7 - v6 > gap else cut
    cut = v5 if v6 - v5 > gap else cut
    cut = v4 if v5 - v4 > gap else cut
    cut = v3 if v4 - v3 > gap else cut
    return v2 if v3 - v2 > gap else cut


@numba.njit(parallel=True, fastmath=True, boundscheck=False, cache=False)
def _kernel(images, lights, inverses, gap, full_scale, normals, albedo):  # noqa: ANN001, ANN202 - numba types it
    for row in numba.prange(images.shape[1]):
        i0, i1, i2, i3 = images[0, row], images[1, row], images[2, row], images[3, row]
        i4, i5, i6, i7 = images[4, row], images[5, row], images[6, row], images[7, row]
        out, out_albedo = normals[row], albedo[row]
        scale = np.float32(1.0) / full_scale
        for col in range(images.shape[2]):
            v0, v1, v2, v3 = np.int32(i0[col]), np.int32(i1[col]), np.int32(i2[col]), np.int32(i3[col])
            v4, v5, v6, v7 = np.int32(i4[col]), np.int32(i5[col]), np.int32(i6[col]), np.int32(i7[col])
            cut = cutoff(v0, v1, v2, v3, v4, v5, v6, v7, gap)
            k0, k1, k2, k3 = v0 <= cut, v1 <= cut, v2 <= cut, v3 <= cut
            k4, k5, k6, k7 = v4 <= cut, v5 <= cut, v6 <= cut, v7 <= cut
            kept = k0 | k1 << 1 | k2 << 2 | k3 << 3 | k4 << 4 | k5 << 5 | k6 << 6 | k7 << 7
            f0, f1 = np.float32(v0 if k0 else 0), np.float32(v1 if k1 else 0)
            f2, f3 = np.float32(v2 if k2 else 0), np.float32(v3 if k3 else 0)
            f4, f5 = np.float32(v4 if k4 else 0), np.float32(v5 if k5 else 0)
            f6, f7 = np.float32(v6 if k6 else 0), np.float32(v7 if k7 else 0)
            x = f0 * lights[0, 0] + f1 * lights[1, 0] + f2 * lights[2, 0] + f3 * lights[3, 0]
            x += f4 * lights[4, 0] + f5 * lights[5, 0] + f6 * lights[6, 0] + f7 * lights[7, 0]
            y = f0 * lights[0, 1] + f1 * lights[1, 1] + f2 * lights[2, 1] + f3 * lights[3, 1]
            y += f4 * lights[4, 1] + f5 * lights[5, 1] + f6 * lights[6, 1] + f7 * lights[7, 1]
            z = f0 * lights[0, 2] + f1 * lights[1, 2] + f2 * lights[2, 2] + f3 * lights[3, 2]
            z += f4 * lights[4, 2] + f5 * lights[5, 2] + f6 * lights[6, 2] + f7 * lights[7, 2]
            m = inverses[kept]
            n_x = m[0] * x + m[1] * y + m[2] * z
            n_y = m[1] * x + m[3] * y + m[4] * z
            n_z = m[2] * x + m[4] * y + m[5] * z
            # A singular set has an inverse of zeros: such a pixel, and one that faces away, comes out as zeros.
            length = np.sqrt(n_x * n_x + n_y * n_y + n_z * n_z)
            inverse_length = np.float32(1.0) / length if n_z > 0 else np.float32(0.0)
            out[col, 0] = n_x * inverse_length
            out[col, 1] = n_y * inverse_length
            out[col, 2] = n_z * inverse_length
            out_albedo[col] = length * scale if n_z > 0 else np.float32(0.0)


class NumbaKernel:
    """The kernel with its table and its outputs, which are reused from call to call."""

    def __init__(self, images: NDArray[np.uint8], directions: NDArray[np.float64], threshold: float) -> None:
        self.images = images
        self.lights = directions.astype(np.float32)
        self.inverses = packed(subset_inverses(directions)).astype(np.float32)
        self.gap = np.int32(np.floor(threshold))
        self.normals = np.zeros((*images.shape[1:], 3), dtype=np.float32)
        self.albedo = np.zeros(images.shape[1:], dtype=np.float32)

    def __call__(self) -> None:
        """Estimate every pixel."""
        _kernel(self.images, self.lights, self.inverses, self.gap, np.float32(255.0), self.normals, self.albedo)


def packed(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3) symmetric to (N, 8): xx xy xz yy yz zz and two zeros, so that a row is a quarter of a cache line."""
    table = np.zeros((len(matrices), 8))
    table[:, :6] = matrices[:, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)]
    return table
