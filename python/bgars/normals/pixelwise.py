"""Normals from nothing but images and lights (the Rust kernels, with plain arguments)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.normals.kernel_outputs import fresh_outputs, measured_by, outputs_of
from bgars.records.capture import Capture
from bgars.records.given_pixels import grey_pixels
from bgars.records.kernel_capture import kernel_capture
from bgars.records.normal_field import NormalField
from bgars.records.plain_arrays import every_pixel, masked_pixels, plain_bool
from bgars.records.rig import LightRig
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from bgars.records.pixels import PixelArray

__all__ = [
    "PIXELWISE_METHODS",
    "PixelwiseMethod",
    "capture_of",
    "combined_mask",
    "pixelwise_normals",
]

PixelwiseMethod = Literal["lambertian", "specular-filter", "robust-filter", "blind"]
"""What needs nothing but images and lights: ``blind`` fits a material of its own (docs/method.md)."""
PIXELWISE_METHODS: tuple[PixelwiseMethod, ...] = get_args(PixelwiseMethod)
DEFAULT_THRESHOLD = 50.0
STACK_NDIM = 3


def pixelwise_normals(
    capture: Capture,
    *,
    method: PixelwiseMethod,
    mask: NDArray[np.bool_] | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    keep_sets: bool = False,
    out: NormalField | None = None,
    fills: bool = False,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> NormalField:
    """Estimate every pixel by one of the methods that need no balls; arguments as of :func:`bgars.estimate_normals`.

    `mask` comes from :func:`combined_mask`; `fills` says that somebody will fill in normals that are not measured.
    """
    lights, *shape = capture.images.shape
    size = (shape[0], shape[1])
    set_lights = lights if keep_sets else 0
    fills = fills or method == "blind"
    if out is None:
        outputs = fresh_outputs(size, set_lights, fills=fills)
    else:
        outputs = outputs_of(out, size, set_lights, fills=fills)
    choice = _bgars.estimate_normals(
        kernel_capture(capture),
        mask=mask,
        method=method,
        threshold=threshold,
        threads=threads,
        progress=progress,
        out=outputs,
    )
    return NormalField(
        normals=outputs.normals,
        albedo=outputs.albedo,
        mask=outputs.mask,
        confidence=outputs.confidence,
        is_measured=measured_by(outputs),
        lights_kept=outputs.lights_kept,
        method=method,
        pixel_pitch_um=capture.pixel_pitch_um,
        kept_sets=outputs.kept_sets,
        method_reason=choice or f"{method}, as asked",
    )


def capture_of(
    images: Capture | ArrayLike,
    light_directions: ArrayLike | None,
    light_intensities: ArrayLike | None,
    saturation: float | None,
) -> Capture:
    """Return the capture, or one made of plain arrays; arguments as of :func:`bgars.estimate_normals`."""
    if isinstance(images, Capture):
        for name, value in (
            ("light_directions", light_directions),
            ("light_intensities", light_intensities),
            ("saturation", saturation),
        ):
            if value is not None:
                msg = f"{name}: the capture brings its own; leave it out, or give plain arrays"
                raise InputError(msg)
        return images
    if isinstance(images, str | Path):
        need_whole(images)
    if light_directions is None:
        msg = "light_directions: needed with plain image arrays, shape (L, 3)"
        raise InputError(msg)
    stack, hidden = pixel_stack(images), masked_pixels(images)
    rig = LightRig.from_directions(light_directions, intensities=light_intensities)
    if len(rig) != len(stack):
        msg = f"images and light_directions: {len(stack)} images but {len(rig)} lights; they must be equal in number"
        raise InputError(msg)
    return Capture(
        images=stack,
        rig=rig,
        mask=every_pixel(stack.shape[1:]) if hidden is None else ~hidden,
        saturation=math.nan if saturation is None else saturation,
    )


def pixel_stack(images: ArrayLike) -> PixelArray:
    """Return a C-contiguous (L, H, W) stack of a supported dtype, without a copy where possible."""
    stack = grey_pixels("images", images)
    if stack.ndim != STACK_NDIM:
        msg = f"images: must have shape (L, H, W) or (L, H, W, 3), got {stack.shape}"
        raise InputError(msg)
    return stack


def combined_mask(capture: Capture, mask: ArrayLike | None) -> NDArray[np.bool_] | None:
    """The pixels to use; None for all of them."""
    if mask is None:
        if capture.mask.strides == (0, 0) and capture.mask.size and capture.mask[0, 0]:
            return None  # one True for all pixels, as captures without a mask have it
        return np.ascontiguousarray(capture.mask)
    given = plain_bool("mask", mask)
    if given.shape != capture.images.shape[1:]:
        expected = tuple(capture.images.shape[1:])
        msg = f"mask: must be bool of shape {expected}, got shape {given.shape}"
        raise InputError(msg)
    combined: NDArray[np.bool_] = np.ascontiguousarray(given & capture.mask)
    if not combined.any():
        msg = "mask: no pixel to use (all False)"
        raise InputError(msg)
    return combined
