"""The same kernel in numba as short loops over a row: LLVM vectorises all but the table look-up, for this very machine.

Not what the limit is set against (that is the one-pass kernel with a scalar network), but the fastest numba found.
"""

from __future__ import annotations

import numba
import numpy as np
from numba_kernel import NumbaKernel, cutoff


@numba.njit(parallel=True, fastmath=True, boundscheck=False, cache=False)
def _kernel(images, lights, inverses, gap, full_scale, normals, albedo):  # noqa: ANN001, ANN202 - numba types it
    width = images.shape[2]
    for row in numba.prange(images.shape[1]):
        i0, i1, i2, i3 = images[0, row], images[1, row], images[2, row], images[3, row]
        i4, i5, i6, i7 = images[4, row], images[5, row], images[6, row], images[7, row]
        out, out_albedo = normals[row], albedo[row]
        scale, dark = np.float32(1.0) / full_scale, np.uint8(0)
        cuts, kept = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
        x, y, z = np.zeros(width, np.float32), np.zeros(width, np.float32), np.zeros(width, np.float32)
        for col in range(width):
            v0, v1, v2, v3 = np.int16(i0[col]), np.int16(i1[col]), np.int16(i2[col]), np.int16(i3[col])
            v4, v5, v6, v7 = np.int16(i4[col]), np.int16(i5[col]), np.int16(i6[col]), np.int16(i7[col])
            cuts[col] = cutoff(v0, v1, v2, v3, v4, v5, v6, v7, gap)
        for col in range(width):
            cut = cuts[col]
            low = (i0[col] <= cut) | (i1[col] <= cut) << 1 | (i2[col] <= cut) << 2 | (i3[col] <= cut) << 3
            high = (i4[col] <= cut) | (i5[col] <= cut) << 1 | (i6[col] <= cut) << 2 | (i7[col] <= cut) << 3
            kept[col] = low | high << 4
        for col in range(width):
            cut = cuts[col]
            f0, f1 = np.float32(i0[col] if i0[col] <= cut else dark), np.float32(i1[col] if i1[col] <= cut else dark)
            f2, f3 = np.float32(i2[col] if i2[col] <= cut else dark), np.float32(i3[col] if i3[col] <= cut else dark)
            f4, f5 = np.float32(i4[col] if i4[col] <= cut else dark), np.float32(i5[col] if i5[col] <= cut else dark)
            f6, f7 = np.float32(i6[col] if i6[col] <= cut else dark), np.float32(i7[col] if i7[col] <= cut else dark)
            sums = f0 * lights[0, 0] + f1 * lights[1, 0] + f2 * lights[2, 0] + f3 * lights[3, 0]
            x[col] = sums + f4 * lights[4, 0] + f5 * lights[5, 0] + f6 * lights[6, 0] + f7 * lights[7, 0]
            sums = f0 * lights[0, 1] + f1 * lights[1, 1] + f2 * lights[2, 1] + f3 * lights[3, 1]
            y[col] = sums + f4 * lights[4, 1] + f5 * lights[5, 1] + f6 * lights[6, 1] + f7 * lights[7, 1]
            sums = f0 * lights[0, 2] + f1 * lights[1, 2] + f2 * lights[2, 2] + f3 * lights[3, 2]
            z[col] = sums + f4 * lights[4, 2] + f5 * lights[5, 2] + f6 * lights[6, 2] + f7 * lights[7, 2]
        for col in range(width):
            m = inverses[kept[col]]
            n_x = m[0] * x[col] + m[1] * y[col] + m[2] * z[col]
            n_y = m[1] * x[col] + m[3] * y[col] + m[4] * z[col]
            n_z = m[2] * x[col] + m[4] * y[col] + m[5] * z[col]
            length = np.sqrt(n_x * n_x + n_y * n_y + n_z * n_z)
            inverse_length = np.float32(1.0) / length if n_z > 0 else np.float32(0.0)
            out[col, 0] = n_x * inverse_length
            out[col, 1] = n_y * inverse_length
            out[col, 2] = n_z * inverse_length
            out_albedo[col] = length * scale if n_z > 0 else np.float32(0.0)


class NumbaSplit(NumbaKernel):
    """The short loops on the same table and outputs."""

    def __call__(self) -> None:
        """Estimate every pixel."""
        gap = np.int16(self.gap)
        _kernel(self.images, self.lights, self.inverses, gap, np.float32(255.0), self.normals, self.albedo)
