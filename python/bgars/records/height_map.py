"""Integrated heights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.records.component import Component
from bgars.records.normal_field import NormalField
from bgars.records.pixels import BoolArray, FloatArray
from bgars.records.plain_arrays import (
    plain,
    plain_fields,
    without_mask,
)
from bgars.records.scalar_checks import check_pitch
from bgars.records.shown import ShownHeight

if TYPE_CHECKING:
    from bgars.records.bilateral_fit import BilateralFit

__all__ = ["HeightMap", "need_height"]


@dataclass(frozen=True, eq=False, repr=False)
class HeightMap(ShownHeight):
    """Integrated heights, zero mean in each connected component that no anchor holds.

    Attributes
    ----------
    height_px : (H, W) float32
        Height toward the camera in pixels; NaN outside the mask.
    mask : (H, W) bool
        True where there is a height.
    pixel_pitch_um : float or None
        Size of a pixel on the board.
    iterations : int
        Iterations of the solver.
    residual : float
        True residual of the normal equations relative to the right side.
    components : tuple of Component
        The connected parts, in reading order.
    labels : (H, W) int32
        Index into `components` of each pixel, -1 outside the mask.
    bilateral : BilateralFit or None
        Jumps and energies, from the bilateral method.
    """

    height_px: FloatArray
    mask: BoolArray
    pixel_pitch_um: float | None
    iterations: int
    residual: float
    components: tuple[Component, ...]
    labels: NDArray[np.int32]
    bilateral: BilateralFit | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels."""
        plain_fields(self, {"height_px": np.float32, "mask": np.bool_, "labels": np.int32})

    def check_field(self, field: NormalField | None) -> None:
        """Raise InputError unless a field, where there is one, has the size of this map."""
        if field is not None and field.mask.shape != self.mask.shape:
            msg = f"field: must have the shape of the height map {self.mask.shape}, got {field.mask.shape}"
            raise InputError(msg)

    @classmethod
    def from_array(cls, height: NDArray[np.floating], *, pixel_pitch_um: float | None = None) -> HeightMap:
        """Wrap heights that come from elsewhere, as one part.

        Parameters
        ----------
        height : (H, W) floating
            Heights in micrometres when a pixel pitch is given, else in pixels; NaN, or masked = invalid.
        pixel_pitch_um : float, optional
            Size of a pixel.

        Raises
        ------
        InputError
            Another shape; a pitch that is not a number, finite and above 0.
        """
        check_pitch(pixel_pitch_um)
        height = plain("height", without_mask(height, math.nan))
        if height.ndim != len(("row", "col")) or height.dtype.kind not in "fui":
            msg = f"height: must be numbers of shape (H, W), got {height.dtype} of shape {height.shape}"
            raise InputError(msg)
        height_px = (height / (1.0 if pixel_pitch_um is None else pixel_pitch_um)).astype(np.float32)
        mask: BoolArray = np.isfinite(height_px)
        rows, cols = np.nonzero(mask)
        first = (int(rows[0]), int(cols[0])) if rows.size else (0, 0)
        return cls(
            height_px=height_px,
            mask=mask,
            pixel_pitch_um=pixel_pitch_um,
            iterations=0,
            residual=0.0,
            components=(Component(int(mask.sum()), *first),),
            labels=np.where(mask, 0, -1).astype(np.int32),
        )

    @property
    def height_um(self) -> FloatArray | None:
        """(H, W) float32 heights in micrometres, or None when the pixel pitch is unknown."""
        if self.pixel_pitch_um is None:
            return None
        return (self.height_px * self.pixel_pitch_um).astype(np.float32)

    @property
    def unit(self) -> str:
        """Unit of :attr:`height`: "um" when the pixel pitch is known, else "px"."""
        return "px" if self.pixel_pitch_um is None else "um"

    @property
    def height(self) -> FloatArray:
        """(H, W) float32 heights in :attr:`unit`."""
        height_um = self.height_um
        return self.height_px if height_um is None else height_um

    def summary(self) -> dict[str, Any]:
        """Return the record's scalars as plain Python values; without a valid pixel the range is NaN."""
        height = self.height[self.mask]
        span = [float(height.min()), float(height.max())] if height.size else [math.nan, math.nan]
        return {
            "unit": self.unit,
            f"height_range_{self.unit}": span,
            "pixels": int(self.mask.sum()),
            "components": len(self.components),
            "iterations": self.iterations,
            "residual": self.residual,
        }


def need_height(height: object, field: object = None) -> None:
    """Raise InputError unless this is a height map, and a field, where there is one, is one of its size."""
    if not isinstance(height, HeightMap):
        msg = (
            "height: must be a HeightMap, as bgars.integrate_normals or bgars.HeightMap.from_array(heights) makes it, "
            f"got {type(height).__name__}"
        )
        raise InputError(msg)
    if field is not None and not isinstance(field, NormalField):
        msg = f"field: must be a NormalField, as bgars.estimate_normals makes it, got {type(field).__name__}"
        raise InputError(msg)
    height.check_field(field)
