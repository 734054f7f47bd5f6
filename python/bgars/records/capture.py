"""A capture: one part, photographed under one light at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.records.given_pixels import grey_pixels
from bgars.records.pixels import BoolArray, FloatArray, PixelArray, float_full_scale
from bgars.records.plain_arrays import integer_full_scale, keep, masked_pixels, plain, plain_bool
from bgars.records.rig import LightRig
from bgars.records.shown import ShownCapture

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["Capture"]

STACK_NDIM = 3


@dataclass(frozen=True, eq=False, repr=False)
class Capture(ShownCapture):
    """One part, photographed under one light at a time.

    Attributes
    ----------
    images : (L, H, W) uint8, uint16 or float32
        One image per light, grey levels as the camera gave them. The constructor also takes (L, H, W, 3), of which it
        keeps the luminance, floats of other sizes, and whole numbers from 0 to 65535: as uint8 where none is above 255.
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
        Grey level of no light, used where there is no dark frame; that at and above which a pixel counts as clipped:
        by default the largest of an integer type, infinite for floats.
    full_scale : float
        Grey level of full scale; thresholds "of 255" scale with it and albedo 1 means it. By default the largest of an
        integer type; for floats `saturation`, or where that is infinite their largest value.
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
    saturation: float = math.nan
    full_scale: float = math.nan
    files: tuple[Path, ...] = ()
    folder: Path | None = None
    pixel_pitch_u_um: float | None = None
    camera_distance_mm: float | None = None
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels; what a numpy masked stack hides is not used."""
        rig: object = self.rig
        if not isinstance(rig, LightRig):
            msg = (
                "rig: must be a LightRig, as bgars.LightRig.from_directions(directions) makes it, "
                f"got {type(rig).__name__}"
            )
            raise InputError(msg)
        hidden = masked_pixels(self.images)
        mask = plain_bool("mask", self.mask)
        if hidden is not None and hidden.shape != mask.shape:
            msg = f"mask: must have shape {hidden.shape}, that of the images, got {mask.shape}"
            raise InputError(msg)
        arrays: dict[str, Any] = {
            "images": grey_pixels("images", self.images),
            "mask": mask if hidden is None else mask & ~hidden,
        }
        if self.dark is not None:
            arrays["dark"] = _like(arrays["images"], plain("dark", self.dark))
        if self.response is not None:
            if np.ndim(self.images) > STACK_NDIM:
                msg = "images: must have one value per pixel with a response: luminance is a sum of light, not of codes"
                raise InputError(msg)
            arrays["response"] = plain("response", self.response, np.float32)
        keep(self, arrays)
        keep(self, self._levels())

    def _levels(self) -> dict[str, float]:
        """Saturation and full scale, where they were not given."""
        top = integer_full_scale(self.images)
        saturation = self.saturation
        if saturation != saturation:  # noqa: PLR0124 - NaN; it may be anything that somebody gave
            saturation = math.inf if top is None else top
        if self.full_scale == self.full_scale:
            return {"saturation": saturation}
        if top is None:
            # Not a saturation of 0, which is refused later.
            is_told = isinstance(saturation, int | float) and 0.0 < saturation < math.inf
            top = saturation if is_told else _largest(self.images)
        return {"saturation": saturation, "full_scale": top}

    @property
    def name(self) -> str:
        """Name of the capture's folder, or "capture"."""
        return "capture" if self.folder is None else self.folder.resolve().name


def _largest(images: PixelArray) -> float:
    """The largest value of a stack of floats, above 0; what is no stack is refused later."""
    return float_full_scale(images, None) if images.ndim == STACK_NDIM and images.size else 1.0


def _like(images: PixelArray, dark: NDArray[Any]) -> NDArray[Any]:
    """A dark frame brought to the images' type by what was done to them; where that would lose digits, as it is."""
    if dark.dtype in (np.uint8, np.uint16, np.float32) and dark.ndim < images.ndim:
        return dark
    grey = grey_pixels("dark", dark[None])[0]
    return np.asarray(grey, images.dtype) if np.can_cast(grey.dtype, images.dtype) else grey
