"""Images of a surface's shape: slope, curvature, and what stands out at a chosen scale, such as dents and scratches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads its modules when they are used

from bgars.errors import InputError
from bgars.records.height_map import need_height
from bgars.records.scalar_checks import number
from bgars.records.short import Short

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.height_map import HeightMap

    FloatArray = NDArray[np.float32]

__all__ = ["ShapeImages", "need_scale", "shape_images"]

LEAST_WEIGHT = 0.5
"""Share of a smoothing window, as far as it lies in the image, that must be valid."""
REACH = 4.0
"""Radius of the window, in standard deviations."""
LEAST_SPREAD = 1e-9
"""Determinant of the weights' moments, in scales, above which pixels fix a plane."""


@dataclass(frozen=True, eq=False, repr=False)
class ShapeImages(Short):
    """Shape of a surface, smoothed to a scale; NaN where invalid. The unit is that of the heights, um or px.

    Attributes
    ----------
    slope_deg : (H, W) float32
        Angle between the surface and the image plane.
    mean_curvature : (H, W) float32
        Half the sum of the principal curvatures, 1 / unit; a dome is negative, a dent positive.
    gaussian_curvature : (H, W) float32
        Product of the principal curvatures, 1 / unit^2; positive on domes and dents, negative on saddles.
    flattened : (H, W) float32
        Heights minus their smoothed version, in the unit: what is finer than the scale, such as scratches.
    unit : str
        "um" or "px".
    scale_px : float
        Standard deviation of the Gaussian that smoothed, in pixels.
    pixel_pitch_um : float or None
        That of the heights.
    """

    slope_deg: FloatArray
    mean_curvature: FloatArray
    gaussian_curvature: FloatArray
    flattened: FloatArray
    unit: str
    scale_px: float
    pixel_pitch_um: float | None = None


def shape_images(height: HeightMap, *, scale_px: float = 2.0) -> ShapeImages:
    """Return slope, curvatures and fine relief of a height map.

    Each height is smoothed by the plane that fits the valid pixels around it best, weighted by a Gaussian (local linear
    regression; Fan and Gijbels, Local Polynomial Modelling and Its Applications, 1996, section 3.1): inside the surface
    this is the Gaussian's mean, and at its edges a tilted plane stays one. Slope and curvatures are those of the
    smoothed surface, by central differences (do Carmo, Differential Geometry of Curves and Surfaces, 1976, section
    3-3). Nearer than `scale_px` to an edge, curvatures may be wrong by half, in corners by more.

    Parameters
    ----------
    height : HeightMap
        From :func:`bgars.integrate_normals`.
    scale_px : float
        Standard deviation of the Gaussian, above 0: details finer than this go to `flattened`.

    Raises
    ------
    InputError
        A scale that is not finite and above 0, or a map of fewer than 2 x 2 pixels.

    Examples
    --------
    A ball of radius 50 has mean curvature -1 / 50 at its top:

    >>> import bgars, numpy as np
    >>> row, col = np.mgrid[-20:21, -20:21]
    >>> ball = bgars.HeightMap.from_array(np.sqrt(2500.0 - row**2 - col**2).astype(np.float32))
    >>> shape = bgars.shape_images(ball)
    >>> round(float(shape.mean_curvature[20, 20]), 3), round(float(shape.slope_deg[20, 30]), 0)
    (-0.02, 12.0)
    """
    need_height(height)
    scale_px = need_scale(scale_px, "scale_px")
    if min(height.mask.shape) < len(("one", "two")):
        msg = f"height: must have 2 x 2 pixels at least, got {height.mask.shape}"
        raise InputError(msg)
    spacing = 1.0 if height.pixel_pitch_um is None else height.pixel_pitch_um
    smooth = _smoothed(height, scale_px)
    z_down, z_x = np.gradient(smooth, spacing)
    z_y = -z_down
    z_x_down, z_xx = np.gradient(z_x, spacing)
    z_yy = -np.gradient(z_y, spacing, axis=0)
    z_xy = -z_x_down
    steep = 1.0 + z_x**2 + z_y**2
    mean = ((1.0 + z_x**2) * z_yy - 2.0 * z_x * z_y * z_xy + (1.0 + z_y**2) * z_xx) / (2.0 * steep**1.5)
    return ShapeImages(
        np.degrees(np.arctan(np.sqrt(steep - 1.0))).astype(np.float32),
        mean.astype(np.float32),
        ((z_xx * z_yy - z_xy**2) / steep**2).astype(np.float32),
        (height.height - smooth).astype(np.float32),
        height.unit,
        scale_px,
        height.pixel_pitch_um,
    )


def need_scale(scale_px: float, name: str) -> float:
    """Return a scale, or raise InputError with the name that it was given by."""
    scale_px = number(name, scale_px)
    if not (math.isfinite(scale_px) and scale_px > 0):
        msg = f"{name}: must be finite and above 0, got {scale_px:g}"
        raise InputError(msg)
    return scale_px


def _smoothed(height: HeightMap, scale_px: float) -> NDArray[np.float64]:
    """(H, W) value at each pixel of the plane that fits around it, by its normal equations; NaN where too little is."""
    reach = min(int(REACH * scale_px + 0.5), max(height.mask.shape))
    offset = np.arange(-reach, reach + 1) / scale_px
    gaussian = np.exp(-0.5 * offset**2)
    gaussian /= gaussian.sum()
    kernels = [gaussian * offset**power for power in range(3)]

    def moments(values: NDArray[np.float64], *powers: tuple[int, int]) -> list[NDArray[np.float64]]:
        along = [scipy.ndimage.correlate1d(values, kernel, axis=0, mode="constant") for kernel in kernels]
        return [scipy.ndimage.correlate1d(along[row], kernels[col], axis=1, mode="constant") for row, col in powers]

    weight, row, col, row_row, row_col, col_col = moments(
        height.mask.astype(np.float64), (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)
    )
    mean, by_row, by_col = moments(np.where(height.mask, height.height.astype(np.float64), 0.0), (0, 0), (1, 0), (0, 1))
    minors = row_row * col_col - row_col**2, row_col * col - row * col_col, row * row_col - row_row * col
    determinant = weight * minors[0] + row * minors[1] + col * minors[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        smooth: NDArray[np.float64] = (minors[0] * mean + minors[1] * by_row + minors[2] * by_col) / determinant
        # Pixels in one line fix no plane: their mean it is.
        is_flat = determinant > LEAST_SPREAD
        smooth = np.where(is_flat, smooth, mean / weight)
    in_image = np.multiply.outer(
        *(scipy.ndimage.correlate1d(np.ones(side), gaussian, mode="constant") for side in weight.shape)
    )
    smooth[(weight < LEAST_WEIGHT * in_image) | ~height.mask] = np.nan
    return smooth
