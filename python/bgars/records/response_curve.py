"""The response curve of a camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bgars.records.short import Short

__all__ = ["ResponseCurve", "srgb_light"]

Array = NDArray[np.float64]

SRGB_LINEAR_BELOW, SRGB_SLOPE, SRGB_OFFSET, SRGB_EXPONENT = 0.04045, 12.92, 0.055, 2.4
"""The constants of IEC 61966-2-1."""


def srgb_light(encoded: NDArray[np.floating]) -> Array:
    """Light behind values 0 to 1 that sRGB encoded, the encoding of most JPEG files (IEC 61966-2-1, equations 5 and 6).

    Examples
    --------
    >>> round(float(srgb_light(np.array([0.5]))[0]), 3)
    0.214
    """
    curved = ((encoded + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)) ** SRGB_EXPONENT
    return np.where(encoded <= SRGB_LINEAR_BELOW, encoded / SRGB_SLOPE, curved)


@dataclass(frozen=True, eq=False, repr=False)
class ResponseCurve(Short):
    """Inverse response of the camera.

    Attributes
    ----------
    levels, radiances : (K,) float64
        Grey levels as a share of full scale, 0 to 1, and the light that they stand for, 1 at full scale.
    u_radiance : float
        Standard uncertainty, of full scale.
    source : str
        How it was found.
    """

    levels: Array
    radiances: Array
    u_radiance: float = 0.0
    source: str = ""

    @property
    def nonlinearity(self) -> float:
        """Largest deviation from a straight line, 1 = full scale."""
        return float(np.abs(self.radiances - self.levels).max())

    @property
    def gamma(self) -> float:
        """Exponent of the nearest power law."""
        use = (self.levels > 0.1) & (self.levels < 1.0) & (self.radiances > 0)  # noqa: PLR2004 - away from the black
        if not use.any():
            return 1.0
        x, y = np.log(self.levels[use]), np.log(self.radiances[use])
        return float(x @ y / (x @ x))
