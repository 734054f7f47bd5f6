"""What a bilateral integration saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bgars.records.short import Short

__all__ = ["BilateralFit"]


@dataclass(frozen=True, eq=False, repr=False)
class BilateralFit(Short):
    """Where a bilateral integration saw jumps, and how it came to rest.

    Attributes
    ----------
    rightward, upward : (H, W) float32
        Share in [0, 1] that the difference to the right (upward) has in a pixel's equation; the opposite difference has
        the rest. 1/2 = smooth; near 0 the surface jumps on the right (upper) side, near 1 on the other. NaN outside the
        mask.
    energies : (N,) float64
        Energy after each re-weighting.
    converged : bool
        False where `max_iters` ended it while the energy still moved; the surface is the last one.
    k : float
        Sharpness of the sigmoid.
    solver : {"converged", "compatible"}
    """

    rightward: NDArray[np.float32]
    upward: NDArray[np.float32]
    energies: NDArray[np.float64]
    converged: bool
    k: float
    solver: str

    def jumps(self, least: float = 0.9) -> NDArray[np.bool_]:
        """(H, W) True where one side of a pixel has at least this share: the pixels along a jump."""
        with np.errstate(invalid="ignore"):
            lopsided: NDArray[np.bool_] = np.maximum(abs(self.rightward - 0.5), abs(self.upward - 0.5)) >= least - 0.5
        return lopsided
