"""The board's shape: a quadratic surface, its heights and slopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.circle_pixels import inside_circles

if TYPE_CHECKING:
    from bgars.records.normal_field import NormalField

__all__ = ["SHAPE_TERMS", "Board", "board_from_normals", "outside_balls", "slope_terms"]

Array = NDArray[np.float64]

SHAPE_TERMS = 5
"""Coefficients c1 to c5 of z = c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2; height 0 at the image centre by definition."""
TRIM = 3.0
"""Normals farther from the fit, in standard deviations, are no board."""
MIN_BOARD_PIXELS = 100
"""Fewer pixels of board have no shape."""
MAX_SAMPLES = 60_000
ROUNDS = 4
OUTSIDE = 1.1
"""Pixels this many radii from a ball's centre are board."""


class Board:
    """A quadratic board ``z = c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2``, all in pixels.

    Parameters
    ----------
    coefficients : (5,) float64
        c1 to c5.
    """

    def __init__(self, coefficients: Array | None = None) -> None:
        self.coefficients: Array = np.zeros(SHAPE_TERMS) if coefficients is None else np.asarray(coefficients, float)
        self.is_flat = not self.coefficients.any()

    def height(self, x: Array, y: Array) -> Array:
        """Height at (x, y), any shape."""
        c1, c2, c3, c4, c5 = self.coefficients
        height: Array = x * (c1 + c3 * x + c4 * y) + y * (c2 + c5 * y)
        return height

    def slopes(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Slopes dz/dx and dz/dy at (x, y)."""
        c1, c2, c3, c4, c5 = self.coefficients
        return c1 + 2.0 * c3 * x + c4 * y, c2 + c4 * x + 2.0 * c5 * y


def slope_terms(x: Array, y: Array) -> tuple[Array, Array]:
    """(..., 5) derivatives of both slopes by c1 to c5."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    return (
        np.stack([one, zero, 2.0 * x, y, zero], axis=-1),
        np.stack([zero, one, zero, x, 2.0 * y], axis=-1),
    )


def outside_balls(height: int, width: int, table: Array) -> NDArray[np.bool_]:
    """(H, W) True where no ball is, with a margin; `table` (N, 5) as x, y, z, radius, q in pixels."""
    return ~inside_circles(((x, y, OUTSIDE * radius + 2.0) for x, y, _, radius, _ in table), (height, width))


def board_from_normals(field: NormalField, outside: NDArray[np.bool_]) -> Array | None:
    """Fit the quadratic board to the normals of board pixels, trimmed.

    Parameters
    ----------
    field : NormalField
        Normals of the whole image.
    outside : (H, W) bool
        True where no ball is.

    Returns
    -------
    (5,) float64 or None
        Coefficients in pixels; None where there are too few board pixels.
    """
    pixels = np.flatnonzero(field.mask & outside)
    if pixels.size < MIN_BOARD_PIXELS:
        return None
    rows, cols = np.divmod(pixels[:: max(1, pixels.size // MAX_SAMPLES)], field.mask.shape[1])
    height, width = field.mask.shape
    x, y = cols + 0.5 - width / 2.0, height / 2.0 - rows - 0.5
    normals = field.normals[rows, cols].astype(np.float64)
    slopes = np.concatenate([-normals[:, 0] / normals[:, 2], -normals[:, 1] / normals[:, 2]])
    # Both slopes are linear in 1, x and y: with x and y in halves of the image, normal equations are exact enough.
    half = max(height, width) / 2.0
    unit = np.array([1.0, 1.0, half, half, half])
    system = np.concatenate(slope_terms(x / half, y / half))
    keep = np.isfinite(slopes)
    coefficients: Array = np.zeros(SHAPE_TERMS)
    for _ in range(ROUNDS):
        weighted = system[keep]
        normal = np.einsum("ni,nj->ij", weighted, weighted)
        coefficients = np.linalg.lstsq(normal, np.einsum("ni,n->i", weighted, slopes[keep]), rcond=None)[0]
        residuals = np.abs(slopes - np.einsum("ni,i->n", system, coefficients))
        spread = max(1.4826 * float(np.median(residuals[keep])), 1e-6)
        keep = residuals < TRIM * spread
    in_pixels: Array = coefficients / unit
    return in_pixels
