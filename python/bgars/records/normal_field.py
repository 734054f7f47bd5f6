"""Estimated normals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.pixels import BoolArray, FloatArray
from bgars.records.plain_arrays import (
    keep,
    plain_fields,
)
from bgars.records.renamed import renamed
from bgars.records.shown import ShownField

if TYPE_CHECKING:
    from bgars.records.reflectance_fit import ReflectanceFit

__all__ = ["NormalField"]

HALF_CONFIDENCE_DEG = 5.0
"""Standard error of the direction at which the confidence is one half."""

PERCENTILE_PIXELS = 1 << 16
"""Pixels that a percentile for display is taken from, about."""


@renamed(measured="is_measured", choice="method_reason")
@dataclass(frozen=True, eq=False, repr=False)
class NormalField(ShownField):
    """Estimated normals.

    Attributes
    ----------
    normals : (H, W, 3) float32
        Unit normals, x right, y up, z toward the camera, n_z > 0; NaN where invalid.
    albedo : (H, W) float32
        Diffuse reflectance times light intensity, 1 = full scale of the camera; NaN where invalid.
    mask : (H, W) bool
        True where the normal is valid.
    confidence : (H, W) float32
        ``1 / (1 + (s / 5 deg)^2)`` with s the standard error of the direction; 0 where invalid.
    is_measured : (H, W) bool
        False where a normal is a prior fill or invalid; of methods that fill nothing in, a read-only view of `mask`.
    lights_kept : (H, W) uint16
        Number of lights that entered the pixel's least squares.
    method : str
        Estimator that was used.
    pixel_pitch_um : float or None
        Size of a pixel on the board.
    kept_sets : (H, W, L) bool or None
        The lights themselves, where asked for.
    method_reason : str
        What was used, and why, in one line.
    reflectance : ReflectanceFit or None
        What the reflectance estimator fitted, where it ran.
    """

    normals: FloatArray
    albedo: FloatArray
    mask: BoolArray
    confidence: FloatArray
    is_measured: BoolArray
    lights_kept: NDArray[np.uint16]
    method: str
    pixel_pitch_um: float | None = None
    kept_sets: BoolArray | None = field(default=None, repr=False)
    method_reason: str = ""
    reflectance: ReflectanceFit | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels."""
        shows_mask = isinstance(self.is_measured, np.ndarray) and self.is_measured.base is self.mask
        types = {"normals": np.float32, "albedo": np.float32, "mask": np.bool_, "confidence": np.float32}
        types |= {"is_measured": np.bool_, "lights_kept": np.uint16, "kept_sets": np.bool_}
        mask = self.mask
        plain_fields(self, types)
        if shows_mask and self.mask is not mask:
            measured = self.mask.view()
            measured.flags.writeable = self.is_measured.flags.writeable
            keep(self, {"is_measured": measured})

    @property
    def standard_error_deg(self) -> FloatArray:
        """(H, W) float32 standard error of the direction in degrees, by `confidence`; infinite where invalid."""
        with np.errstate(divide="ignore"):
            error_deg: FloatArray = (HALF_CONFIDENCE_DEG * np.sqrt(1.0 / self.confidence - 1.0)).astype(np.float32)
        return error_deg

    def grey_levels(self) -> NDArray[np.uint8]:
        """Albedo as (H, W) grey for pictures: 255 at its 99th percentile (of a sample of pixels), 128 where invalid."""
        step = max(1, self.albedo.size // PERCENTILE_PIXELS)
        sample = self.albedo.ravel()[::step]
        known = sample[np.isfinite(sample)]
        top = max(float(np.percentile(known, 99.0)) if known.size else 1.0, 1e-12)
        level = np.minimum(self.albedo * np.float32(255.0 / top), np.float32(255.0))
        grey: NDArray[np.uint8] = np.where(np.isfinite(level), level, np.float32(128.0)).astype(np.uint8)
        return grey
