"""Normals that somebody else estimated, as a field."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.records.normal_field import NormalField
from bgars.records.plain_arrays import plain, without_mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bgars.records.capture import Capture
    from bgars.records.pixels import BoolArray

__all__ = ["GIVEN", "given_field", "within"]

GIVEN = "normals as given"
PER_PIXEL = ("albedo", "confidence", "is_measured", "lights_kept")
ROUNDING = 1e-3
"""Of lengths that are left as they are: float16 has three digits."""


def given_field(given: NormalField | ArrayLike, capture: Capture, name: str) -> NormalField:
    """Return a field of the images' size: the given one, or one made of an array (H, W, 3) of any lengths.

    What an array does not say is not made up: albedo is NaN, confidence 0 (any error is possible), no lights are kept,
    and `method_reason` is :data:`GIVEN`. Of a field, too, vectors are made unit length, and those that are 0 or not
    finite leave its mask; it gets the capture's pitch where it has none.

    Raises
    ------
    InputError
        Normals, or other arrays of a field, that are not as large as the images.
    """
    if isinstance(given, NormalField):
        return _checked(given, capture, name)
    normals = plain("method", without_mask(given, np.nan))
    shape = (*capture.mask.shape, 3)
    if normals.shape != shape or normals.dtype.kind not in "fiu":
        msg = f"method: normals must be numbers of shape {shape}, got {normals.dtype} of shape {normals.shape}"
        raise InputError(msg)
    wide = normals.astype(np.float64)
    length = np.linalg.norm(wide, axis=2)
    mask = np.isfinite(length) & (length > 0)
    unit = np.where(mask[..., None], wide / np.where(mask, length, 1.0)[..., None], np.nan).astype(np.float32)
    nothing = np.full(mask.shape, np.nan, np.float32)
    lights, unsure = np.zeros(mask.shape, np.uint16), np.zeros(mask.shape, np.float32)
    return NormalField(unit, nothing, mask, unsure, mask, lights, name, capture.pixel_pitch_um, method_reason=GIVEN)


def _checked(field: NormalField, capture: Capture, name: str) -> NormalField:
    """The field with its arrays of one size, vectors of length 1, and none in its mask that is 0 or not finite."""
    shape = capture.mask.shape
    if field.mask.shape != shape:
        msg = f"method: normals have shape {field.mask.shape}, but the images have {shape}"
        raise InputError(msg)
    for array, wanted in {"normals": (*shape, 3), **dict.fromkeys(PER_PIXEL, shape)}.items():
        if getattr(field, array).shape != wanted:
            msg = f"method: {name}: {array} must have shape {wanted}, got {getattr(field, array).shape}"
            raise InputError(msg)
    if field.method_reason == "" and name != "given":
        field = replace(field, method_reason=f"{name}, as asked")
    if field.pixel_pitch_um is None and capture.pixel_pitch_um is not None:
        field = replace(field, pixel_pitch_um=capture.pixel_pitch_um)
    length = np.linalg.norm(field.normals, axis=2)
    is_normal = np.isfinite(length) & (length > 0)
    if (np.abs(length[is_normal] - 1.0) > ROUNDING).any():
        safe = np.where(is_normal, length, np.float32(1.0))
        field = replace(field, normals=(field.normals / safe[..., None]).astype(np.float32))
    return within(field, is_normal)


def within(field: NormalField, use: BoolArray | None) -> NormalField:
    """The field without what lies outside a mask (H, W), where there is one."""
    if use is None or not (field.mask & ~use).any():
        return field
    return replace(
        field,
        normals=np.where(use[..., None], field.normals, np.float32(np.nan)),
        albedo=np.where(use, field.albedo, np.float32(np.nan)),
        mask=field.mask & use,
        confidence=np.where(use, field.confidence, np.float32(0)),
        is_measured=field.is_measured & use,
        lights_kept=np.where(use, field.lights_kept, np.uint16(0)),
    )
