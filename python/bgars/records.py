"""The records that flow from stage to stage: one frozen dataclass an arrow.

Conventions: image arrays index [row, col]; world axes x right, y up (-row), z toward the camera; lengths in micrometres
where a name ends in ``_um`` and in pixels where it ends in ``_px``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars
from bgars.errors import InputError
from bgars.plain_arrays import (
    every_pixel,
    integer_full_scale,
    keep,
    masked_pixels,
    pixel_array,
    plain,
    plain_bool,
    plain_fields,
    without_mask,
)
from bgars.scalar_checks import check_pitch
from bgars.shown import ShownCapture, ShownField, ShownHeight
from bgars.surface_records import Component, DepthMap
from bgars.truth_record import Truth

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.material_records import ReflectanceFit
    from bgars.rig import LightRig
    from bgars.surface_records import BilateralFit

__all__ = [
    "BoolArray",
    "Capture",
    "Component",
    "DepthMap",
    "FloatArray",
    "HeightMap",
    "NormalField",
    "PixelArray",
    "Truth",
    "every_pixel",
    "float_full_scale",
    "integer_full_scale",
    "pixel_array",
]

PixelArray = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
FloatArray = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


def float_full_scale(pixels: PixelArray, threads: int | None) -> float:
    """Return the largest finite value of float pixels: their full scale, where no saturation level is known."""
    return _bgars.float_full_scale(plain("images", pixels, np.float32), threads=threads)


@dataclass(frozen=True, eq=False, repr=False)
class Capture(ShownCapture):
    """One part, photographed under one light at a time.

    Attributes
    ----------
    images : (L, H, W) uint8, uint16 or float32
        One image a light, grey levels as the camera gave them.
    rig : LightRig
        The L lights, in the order of the images.
    mask : (H, W) bool
        True = use.
    pixel_pitch_um, pixel_pitch_u_um : float or None
        Size of a pixel on the board, None when unknown (lengths then stay in pixels); its standard uncertainty.
    camera_distance_mm : float or None
        Entrance pupil to board along the optical axis; infinite for a telecentric lens, None when not stated.
    dark : (H, W) of the images' dtype, or None
        Image with all lights off.
    response : (256,) or (65536,) float32, or None
        Linear grey level of every code (the camera's inverse response); None for a linear camera.
    black_level, saturation : float
        Grey level of no light, used where there is no dark frame; that at and above which a pixel counts as clipped.
    full_scale : float
        Grey level of full scale; thresholds "of 255" scale with it and albedo 1 means it. NaN: the kernels find it.
    files, folder : tuple of Path, Path or None
        The image files, for messages and reports; where the capture was read from.
    assumed : tuple of str
        What had to be assumed to read it: each was also a :class:`~bgars.CaptureWarning`.
    """

    images: PixelArray
    rig: LightRig
    mask: BoolArray
    pixel_pitch_um: float | None = None
    dark: PixelArray | None = None
    response: FloatArray | None = None
    black_level: float = 0.0
    saturation: float = float("inf")
    full_scale: float = 255.0
    files: tuple[Path, ...] = ()
    folder: Path | None = None
    pixel_pitch_u_um: float | None = None
    camera_distance_mm: float | None = None
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels; what a numpy masked stack hides is not used."""
        hidden = masked_pixels(self.images)
        mask = plain_bool("mask", self.mask)
        if hidden is not None and hidden.shape != mask.shape:
            msg = f"mask: must have shape {hidden.shape}, that of the images, got {mask.shape}"
            raise InputError(msg)
        arrays: dict[str, Any] = {
            "images": pixel_array("images", self.images),
            "mask": mask if hidden is None else mask & ~hidden,
        }
        if self.dark is not None:
            arrays["dark"] = plain("dark", self.dark)
        if self.response is not None:
            arrays["response"] = plain("response", self.response, np.float32)
        keep(self, arrays)

    @property
    def name(self) -> str:
        """Name of the capture's folder, or "capture"."""
        return "capture" if self.folder is None else self.folder.resolve().name


HALF_CONFIDENCE_DEG = 5.0
"""Standard error of the direction at which the confidence is one half."""

PERCENTILE_PIXELS = 1 << 16
"""Pixels that a percentile for display is taken from, about."""


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
    measured : (H, W) bool
        False where a normal is a prior fill or invalid; of methods that fill nothing in, a read-only view of `mask`.
    lights_kept : (H, W) uint16
        Number of lights that entered the pixel's least squares.
    method : str
        Estimator that was used.
    pixel_pitch_um : float or None
        Size of a pixel on the board.
    kept_sets : (H, W, L) bool or None
        The lights themselves, where asked for.
    choice : str
        What was used, and why, in one line.
    reflectance : ReflectanceFit or None
        What the reflectance estimator learnt, where it ran.
    """

    normals: FloatArray
    albedo: FloatArray
    mask: BoolArray
    confidence: FloatArray
    measured: BoolArray
    lights_kept: NDArray[np.uint16]
    method: str
    pixel_pitch_um: float | None = None
    kept_sets: BoolArray | None = field(default=None, repr=False)
    choice: str = ""
    reflectance: ReflectanceFit | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels."""
        shows_mask = isinstance(self.measured, np.ndarray) and self.measured.base is self.mask
        types = {"normals": np.float32, "albedo": np.float32, "mask": np.bool_, "confidence": np.float32}
        types |= {"measured": np.bool_, "lights_kept": np.uint16, "kept_sets": np.bool_}
        mask = self.mask
        plain_fields(self, types)
        if shows_mask and self.mask is not mask:
            measured = self.mask.view()
            measured.flags.writeable = self.measured.flags.writeable
            keep(self, {"measured": measured})

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
        """Return the record's scalars as plain Python values."""
        height = self.height[self.mask]
        return {
            "unit": self.unit,
            f"height_range_{self.unit}": [float(height.min()), float(height.max())],
            "pixels": int(self.mask.sum()),
            "components": len(self.components),
            "iterations": self.iterations,
            "residual": self.residual,
        }
